//! `skillet hold` and `skillet rearm`: hold the arm, and release it.

use std::time::Duration;

use anyhow::Result;
use rt_controller::fault::Fault;
use serde_json::json;
use shm_types::command::{COMMAND_HOLD, COMMAND_REARM, Command, Reply};
use shm_types::episode::FAULT_HELD;
use shm_types::random_id;

use crate::Verdict;
use crate::cell::{NamedCell, through};
use crate::cli::CellArgs;
use crate::cli::arm::{HoldArgs, RearmArgs};
use crate::output::{print, print_json};

const SOON: Duration = Duration::from_secs(5);

pub fn run(args: &RearmArgs) -> Result<Verdict> {
    let (name, reply) = request(&args.cell, COMMAND_REARM)?;
    if args.json {
        print_json(&json!({ "cell": name, "latched_fault": null, "via": reply.via() }))?;
    } else {
        print(&format!("cell {name} is re-armed{}\n", through(&reply)))?;
    }
    Ok(Verdict::Done)
}

pub fn hold(args: &HoldArgs) -> Result<Verdict> {
    let (name, reply) = request(&args.cell, COMMAND_HOLD)?;
    if args.json {
        let latched = Fault::describe(FAULT_HELD as u32);
        print_json(&json!({ "cell": name, "latched_fault": latched, "via": reply.via() }))?;
    } else {
        print(&format!(
            "the arm of cell {name} is held{}; run `skillet rearm --cell {name}` to resume\n",
            through(&reply)
        ))?;
    }
    Ok(Verdict::Done)
}

/// Sends a command; returns the name of the cell and the reply.
fn request(cell: &CellArgs, kind: u64) -> Result<(String, Reply)> {
    let named = NamedCell::of(cell)?;
    let id = random_id();
    let (reply, _) = named.request(&Command::new(kind, id), SOON)?;
    Ok((named.cell.name().to_string(), reply))
}
