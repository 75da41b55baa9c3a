//! The search of `skillet learn` beside those of other packages, on the same rollouts.
//!
//! `SKILLET_PYTHON` names an interpreter that has the packages, else it is `python3`; without them the error says
//! what to install. To be run where `clients/python/peers.py` is, which says what each method is told.

use std::os::unix::process::CommandExt;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

use super::Sample;
use crate::children;

const PROGRAM: &str = "clients/python/peers.py";

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let python = children::python();
    run(&python, seed)
}

fn run(python: &str, seed: u64) -> Result<Vec<Sample>> {
    let tool = std::env::current_exe().context("finding this executable")?;
    let output = Command::new(python)
        .args([PROGRAM, "--samples", "--seeds", "1", "--first-seed", &seed.to_string()])
        .env("SKILLET", tool)
        // What a terminal sends to the group of its parent is the parent's matter.
        .process_group(0)
        .stdin(Stdio::null())
        .output()
        .with_context(|| format!("starting {python}: SKILLET_PYTHON names the interpreter"))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        bail!("{python} {PROGRAM} ended with {}: {}", output.status, said.trim());
    }
    serde_json::from_slice(&output.stdout)
        .with_context(|| format!("reading what {PROGRAM} printed"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_fails_or_is_not_there_is_named() {
        let failed = run("false", 1).unwrap_err().to_string();
        assert!(failed.contains(PROGRAM), "{failed}");
        let absent = run("/no/such/python", 1).unwrap_err().to_string();
        assert!(absent.contains("SKILLET_PYTHON"), "{absent}");
    }
}
