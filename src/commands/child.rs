//! `skillet child`: becomes another program, which the kernel kills when its parent ends.

use std::os::unix::process::CommandExt;
use std::process::Command;

use anyhow::{Context, Result};

use crate::Verdict;
use crate::cli::child::ChildArgs;
use crate::setup::die_with_parent;

pub fn run(args: &ChildArgs) -> Result<Verdict> {
    die_with_parent(args.parent)?;
    let (program, arguments) = args.program.split_first().context("a program has a name")?;
    let failed = || format!("starting {}", program.to_string_lossy());
    Err(Command::new(program).args(arguments).exec()).with_context(failed)
}
