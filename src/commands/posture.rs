//! `skillet posture`: changes the null-space posture while the tip continues its skill.

use std::time::Duration;

use anyhow::Result;
use serde_json::json;
use shm_types::command::{COMMAND_POSTURE, Command};
use shm_types::{MAX_JOINTS, random_id};

use crate::Verdict;
use crate::cell::{NamedCell, through};
use crate::cli::arm::PostureArgs;
use crate::output::{print, print_json};
use crate::{fields, health};

const SOON: Duration = Duration::from_secs(5);

pub fn run(args: &PostureArgs) -> Result<Verdict> {
    let named = NamedCell::of(&args.cell)?;
    let (name, id) = (named.cell.name(), random_id());
    let (posture, duration_s) = (offset(args), args.within.unwrap_or(0.0));
    let command = Command { posture, duration_s, ..Command::new(COMMAND_POSTURE, id) };
    let (reply, sent_ns) = named.request(&command, SOON)?;
    let (tick, in_s) = (reply.applied_tick, reply.status.posture_s);
    if args.json {
        print_json(&json!({
            "cell": name,
            "posture_offset_rad": posture,
            "posture_in_s": in_s,
            "applied_tick": tick,
            "latency_ms": fields::ms(reply.applied_ns.saturating_sub(sent_ns)),
            "via": reply.via(),
        }))?;
        return Ok(Verdict::Done);
    }
    let mut text = match health::posture(&reply.status) {
        Some(offset) => format!(
            "the posture moves by {offset} within {in_s:.1} s, from tick {tick} on{}\nrun `skillet posture \
             --reset --cell {name}` to undo this\n",
            through(&reply)
        ),
        None => {
            let through = through(&reply);
            format!(
                "the posture returns to its start within {in_s:.1} s, from tick {tick} on{through}\n"
            )
        }
    };
    if reply.status.pinned == 0 && health::has_learner(&reply.status) {
        text += &format!(
            "the learner's rollouts keep the start posture; run `skillet policy pin --cell {name}` to \
             serve the active policy instead\n"
        );
    }
    print(&text)?;
    Ok(Verdict::Done)
}

fn offset(args: &PostureArgs) -> [f64; MAX_JOINTS] {
    let mut offset = args.offset.unwrap_or([0.0; MAX_JOINTS]);
    if let (Some(joint), Some(by)) = (args.joint, args.by) {
        offset[usize::from(joint) - 1] = by;
    }
    offset
}
