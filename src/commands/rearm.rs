//! `skillet rearm`: ends the hold after a machine fault.

use std::hash::{BuildHasher, Hasher, RandomState};
use std::time::Duration;

use anyhow::Result;
use serde_json::json;
use shm_types::command::{COMMAND_REARM, Command};

use crate::Verdict;
use crate::cell::NamedCell;
use crate::cli::RearmArgs;
use crate::output::{print, print_json};

const SOON: Duration = Duration::from_secs(5);

pub fn run(args: &RearmArgs) -> Result<Verdict> {
    let cell = NamedCell::of(&args.cell)?;
    let id = RandomState::new().build_hasher().finish();
    cell.request(&Command::new(COMMAND_REARM, id), SOON)?;
    let name = cell.cell.name();
    if args.json {
        print_json(&json!({ "cell": name, "latched_fault": null }))?;
    } else {
        print(&format!("cell {name} is re-armed\n"))?;
    }
    Ok(Verdict::Done)
}
