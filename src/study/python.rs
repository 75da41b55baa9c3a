//! Studies that a Python program runs: it prints the samples of a seed as JSON.
//!
//! `SKILLET_PYTHON` names an interpreter that has the packages, else it is `python3`; without them the error says
//! what to install. To be run where the program is: in a checkout.

use std::os::unix::process::CommandExt;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

use super::Sample;
use crate::children;

/// What `program` prints with `--samples` and `arguments`.
pub fn samples(program: &str, arguments: &[&str]) -> Result<Vec<Sample>> {
    run(&children::python(), program, arguments)
}

fn run(python: &str, program: &str, arguments: &[&str]) -> Result<Vec<Sample>> {
    let tool = std::env::current_exe().context("finding this executable")?;
    let output = Command::new(python)
        .args([program, "--samples"])
        .args(arguments)
        .env("SKILLET", tool)
        // What a terminal sends to the group of its parent is the parent's matter.
        .process_group(0)
        .stdin(Stdio::null())
        .output()
        .with_context(|| format!("starting {python}: SKILLET_PYTHON names the interpreter"))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        bail!("{python} {program} ended with {}: {}", output.status, said.trim());
    }
    serde_json::from_slice(&output.stdout)
        .with_context(|| format!("reading what {program} printed"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_fails_or_is_not_there_is_named() {
        let failed = run("false", "study.py", &[]).unwrap_err().to_string();
        assert!(failed.contains("study.py"), "{failed}");
        let absent = run("/no/such/python", "study.py", &[]).unwrap_err().to_string();
        assert!(absent.contains("SKILLET_PYTHON"), "{absent}");
    }
}
