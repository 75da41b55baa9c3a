//! `skillet cell`: the services of a cell in the background.

mod down;
mod list;
mod ready;
mod up;

use anyhow::Result;
use shm_types::cell::Cell;

use crate::Verdict;
use crate::cli::cell::{CellVerb, CellsArgs};

pub fn run(args: &CellsArgs) -> Result<Verdict> {
    match &args.verb {
        CellVerb::Up(args) => up::run(args),
        CellVerb::Down(args) => down::run(args),
        CellVerb::List { json } => list::run(*json),
    }
}

/// The cell `name`, unless another command made it for itself.
fn named(name: &str) -> Result<Cell> {
    if let Some(owner) = crate::cell::owner(name) {
        anyhow::bail!(
            "cell '{name}' belongs to a running `skillet {owner}`: stop that command instead"
        );
    }
    Ok(Cell::new(name)?)
}
