//! Asking for real time exactly as the loop does, in a process that ends right after: priority,
//! locked memory and affinity leave no trace in this one.

use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};
use rt_controller::{ControllerConfig, rt};
use serde::{Deserialize, Serialize};

use crate::output::print_json;

/// What the loop would get.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Attempt {
    pub fifo: bool,
    /// What is missing and how to get it.
    pub missing: Vec<String>,
}

/// In a process of its own, with `config` to read the same settings from.
pub fn ask(config: Option<&std::path::Path>) -> Result<Attempt> {
    let executable = std::env::current_exe().context("finding this executable")?;
    let mut command = Command::new(executable);
    command.args(["doctor", "--attempt"]).stdin(Stdio::null());
    if let Some(config) = config {
        command.arg("--config").arg(config);
    }
    let output = command.output().context("starting the attempt")?;
    if !output.status.success() {
        bail!("the attempt ended with {}", output.status);
    }
    serde_json::from_slice(&output.stdout).context("reading the attempt")
}

/// The other process: asks, says what it got, and ends.
pub fn answer(config: &ControllerConfig) -> Result<()> {
    let granted = rt::acquire(config.priority, rt::loop_core(config.cpu));
    print_json(&Attempt { fifo: granted.fifo, missing: granted.missing })
}
