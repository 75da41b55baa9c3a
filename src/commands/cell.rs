//! `skillet cell`: the services of a cell in the background.

mod down;
mod list;
mod ready;
mod up;

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use shm_types::cell::Cell;

use crate::Verdict;
use crate::cell::owner;
use crate::cli::cell::{CellVerb, CellsArgs};
use crate::config::judge::absolute;

pub fn run(args: &CellsArgs) -> Result<Verdict> {
    match &args.verb {
        CellVerb::Up(args) => up::run(args),
        CellVerb::Down(args) => down::run(args),
        CellVerb::List { json } => list::run(*json),
    }
}

/// Relative to the current folder if it lies below.
fn short(path: &Path) -> PathBuf {
    path.strip_prefix(absolute(Path::new(""))).unwrap_or(path).to_path_buf()
}

/// The cell `name`, unless another command made it for itself.
fn named(name: &str) -> Result<Cell> {
    if let Some(owner) = owner(name) {
        bail!("cell '{name}' belongs to a running `skillet {owner}`: stop that command instead");
    }
    Ok(Cell::new(name)?)
}
