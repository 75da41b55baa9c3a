//! `skillet status`: a snapshot of a running controller.

use std::path::Path;
use std::time::Duration;

use anyhow::Result;
use rt_controller::disk::flight_files::FAULTS_DIR;
use rt_controller::fault::Fault;
use serde_json::json;
use shm_types::cell::Cell;
use shm_types::channel::ChannelError;
use shm_types::command::{PACE_MAX, PACE_PLANT, PLANT_ABSENT, PLANT_BUILT_IN, Reply, Status};
use shm_types::equipment::DIGEST_SHOWN;
use shm_types::ports::ToolPorts;

use crate::cell::NamedCell;
use crate::cli::StatusArgs;
use crate::health::{self, Health};
use crate::output::{print, print_json};
use crate::watch::vitals::Presence;
use crate::{Verdict, exit, fields};

const TIMEOUT: Duration = Duration::from_secs(1);

pub fn run(args: &StatusArgs) -> Result<Verdict> {
    let named = NamedCell::of(&args.cell)?;
    let (cell, faults_dir) = (&named.cell, named.state_dir().join(FAULTS_DIR));
    let reply = match ask(cell) {
        Ok(reply) => reply,
        Err(error) if error.is_absence() => return absent(cell, error, args.json),
        Err(error) => return Err(error.into()),
    };
    if args.json {
        print_json(&as_json(cell, &reply))?;
    } else {
        print(&as_text(cell, &reply, &faults_dir))?;
    }
    Ok(match health::level(&reply.status) {
        Health::Bad => Verdict::Negative,
        _ => Verdict::Done,
    })
}

fn ask(cell: &Cell) -> Result<Reply, ChannelError> {
    let ports = ToolPorts::open(cell, TIMEOUT)?;
    ports.ask(TIMEOUT)
}

/// There is no controller, or it does not answer: that is this command's answer.
fn absent(cell: &Cell, error: ChannelError, as_json: bool) -> Result<Verdict> {
    let controller = match error {
        ChannelError::NoAnswer { .. } => Presence::Silent,
        _ => Presence::Absent,
    };
    let error = anyhow::Error::from(error);
    if as_json {
        let controller = controller.name();
        let error = exit::object(&error);
        print_json(&json!({ "cell": cell.name(), "controller": controller, "error": error }))?;
    } else {
        print(&format!("{error}\n"))?;
    }
    Ok(Verdict::NoController)
}

/// The hardware fault that holds the arm.
fn latched(status: &Status) -> Option<&'static str> {
    (status.latched_fault != 0).then(|| Fault::describe(status.latched_fault as u32))
}

fn learner_age_s(status: &Status) -> Option<f64> {
    seconds(status.learner_age_ns)
}

fn seconds(ns: u64) -> Option<f64> {
    (ns != u64::MAX).then(|| fields::seconds(ns))
}

fn as_json(cell: &Cell, reply: &Reply) -> serde_json::Value {
    let status = &reply.status;
    let (health, findings) = health::of(status, cell.name());
    json!({
        "cell": cell.name(),
        "controller": "running",
        "via": reply.via(),
        "health": health,
        "findings": findings,
        "notes": health::notes(status, cell.name()),
        "boot_id": fields::id(status.boot_id),
        "pace": match status.pace {
            PACE_MAX => "max",
            PACE_PLANT => "plant",
            _ => "realtime",
        },
        "phase": fields::phase(status.phase),
        "tick": status.tick,
        "fault": Fault::describe(status.fault as u32),
        "latched_fault": latched(status),
        "latched_s": latched(status).map(|_| fields::seconds(status.latched_ns)),
        "latched_cause_present": status.latched_present == 1,
        "plant": plant(status),
        "equipment": {
            "task": status.equipment.task_name(),
            "arm": status.equipment.arm_name(),
            "urdf_sha256": status.equipment.urdf_text(),
            "plant": status.equipment.plant_name(),
        },
        "fault_records": status.fault_records,
        "period_us": status.period_ns / 1000,
        "realtime_priority": status.privileged == 1,
        "policy": fields::policy(&status.in_loop),
        "applied_tick": status.applied_tick,
        "active_policy": fields::policy(&status.active),
        "last_good_policy": fields::policy(&status.last_good),
        "pinned": status.pinned == 1,
        "pin_restored": status.pin_restored == 1,
        "posture_offset_rad": health::posture(status).map(|_| status.posture),
        "posture_in_s": health::posture(status).map(|_| status.posture_s),
        "imported": status.imported,
        "rollouts_done": status.rollouts_done,
        "rollouts_served": status.rollouts_served,
        "swaps_applied": status.swaps_applied,
        "swaps_torn": status.swaps_torn,
        "policies_refused": status.policies_refused,
        "commands_refused": status.commands_refused,
        "rollbacks": status.rollbacks,
        "state_errors": status.state_errors,
        "spooled_episodes": status.spooled,
        "spool_full": status.spool_full == 1,
        "unacknowledged_episodes": status.unacknowledged,
        "learner_age_s": learner_age_s(status),
        "stalls": stalls(status),
        "deadline_misses": status.deadline_misses,
        "wakeup_us": fields::times_us(status.wakeup_p50_ns, status.wakeup_p99_ns, status.wakeup_max_ns),
        "tick_us": fields::times_us(status.tick_p50_ns, status.tick_p99_ns, status.tick_max_ns),
    })
}

fn stalls(status: &Status) -> serde_json::Value {
    json!({
        "count": status.stalls,
        "longest_s": fields::seconds(status.stall_longest_ns),
        "last_s": fields::seconds(status.stall_last_ns),
        "last_age_s": seconds(status.stall_age_ns),
    })
}

/// A line about the latched fault, if there is one.
fn held(cell: &Cell, status: &Status) -> String {
    let Some(fault) = latched(status) else { return String::new() };
    let (name, age_s) = (cell.name(), status.latched_ns as f64 * 1e-9);
    let next = match status.latched_present {
        1 => "the cause is still present".to_string(),
        _ => format!("fix the cause, then run `skillet rearm --cell {name}`"),
    };
    format!("held        for {age_s:.0} s: {fault}; {next}\n")
}

fn plant(status: &Status) -> &'static str {
    match status.plant {
        PLANT_BUILT_IN => "built-in",
        PLANT_ABSENT => "absent",
        _ => "there",
    }
}

/// The same with its name, where it has told one.
fn plant_text(status: &Status) -> String {
    let name = status.equipment.plant_name();
    match (plant(status), status.plant) {
        (state, _) if name.is_empty() => state.to_string(),
        (_, PLANT_BUILT_IN) => name,
        (state, _) => format!("{state}: {name}"),
    }
}

/// The arm, as a line; nothing for a task without one.
fn arm(status: &Status) -> String {
    let (name, digest) = (status.equipment.arm_name(), status.equipment.urdf_text());
    match digest.get(..DIGEST_SHOWN) {
        Some(digest) => format!("arm         {name}, URDF {digest}\n"),
        None => String::new(),
    }
}

/// The bridge that the reply passed, as a line.
fn way(reply: &Reply) -> String {
    match reply.via() {
        Some(host) => format!("controller  on {host}, through the bridge, as of the last 2 s\n"),
        None => String::new(),
    }
}

fn pace(status: &Status) -> &'static str {
    match (status.pace, status.privileged) {
        (PACE_MAX, _) => "as fast as the simulation allows",
        (PACE_PLANT, 1) => "paced by the plant, SCHED_FIFO",
        (PACE_PLANT, _) => "paced by the plant, without real-time priority",
        (_, 1) => "real time, SCHED_FIFO",
        (_, _) => "real time, without real-time priority",
    }
}

fn as_text(cell: &Cell, reply: &Reply, faults_dir: &Path) -> String {
    let status = &reply.status;
    let (bridge, pace) = (way(reply), pace(status));
    let us = |ns: u64| ns as f64 * 1e-3;
    let learner = match learner_age_s(status) {
        Some(age) => format!("last heartbeat {age:.1} s ago"),
        None => "none".into(),
    };
    let mut text = format!(
        "cell        {}\n{bridge}{}plant       {}\npace        {pace}, period {} µs\nphase       {}, tick {}, fault: {}\n\
         in loop     policy {}, applied at tick {}\n",
        cell.name(),
        arm(status),
        plant_text(status),
        status.period_ns / 1000,
        fields::phase(status.phase),
        status.tick,
        Fault::describe(status.fault as u32),
        status.in_loop.describe(),
        status.applied_tick,
    );
    text += &held(cell, status);
    let (health, findings) = health::of(status, cell.name());
    text +=
        &format!("health      {}\n", [vec![health.name().into()], findings].concat().join("; "));
    for note in health::notes(status, cell.name()) {
        text += &format!("note        {note}\n");
    }
    text += &format!(
        "active      policy {}{}, last good: {}; {} imported, rolled back {}\n",
        status.active.describe(),
        if status.pinned == 1 { ", pinned" } else { "" },
        status.last_good.describe(),
        status.imported,
        times(status.rollbacks),
    );
    text += &format!(
        "rollouts    {} for a learner, {} served, {} episodes not yet durable\n\
         swaps       {} applied, {} torn\n\
         refused     {} policies, {} commands\n\
         learner     {learner}\n",
        status.rollouts_done,
        status.rollouts_served,
        status.unacknowledged,
        status.swaps_applied,
        status.swaps_torn,
        status.policies_refused,
        status.commands_refused,
    );
    let faults = match reply.via() {
        Some(host) => format!("the state folder on {host}"),
        None => faults_dir.display().to_string(),
    };
    text += &trouble(status, &faults);
    text += &format!(
        "tick        p50 {:.1}  p99 {:.1}  max {:.1} µs\n",
        us(status.tick_p50_ns),
        us(status.tick_p99_ns),
        us(status.tick_max_ns)
    );
    if status.is_paced() {
        text += &format!(
            "wake-up     p50 {:.1}  p99 {:.1}  max {:.1} µs, {} of {} deadlines missed\n",
            us(status.wakeup_p50_ns),
            us(status.wakeup_p99_ns),
            us(status.wakeup_max_ns),
            status.deadline_misses,
            status.tick
        );
    }
    text
}

fn times(n: u64) -> String {
    match n {
        1 => "once".into(),
        n => format!("{n} times"),
    }
}

/// Lines about failures, if there were any.
fn trouble(status: &Status, faults: &str) -> String {
    let mut text = String::new();
    if status.spooled > 0 {
        let full = if status.spool_full == 1 { "; it is full, learning is paused" } else { "" };
        text +=
            &format!("spool       {} episodes waiting for their learner{full}\n", status.spooled);
    }
    if status.fault_records > 0 {
        let n = status.fault_records;
        text += &format!("faults      {n} flight records in {faults}\n");
    }
    if status.state_errors > 0 {
        text += &format!(
            "state       {} writes failed; see the controller's log\n",
            status.state_errors
        );
    }
    if status.stalls > 0 {
        let longest = status.stall_longest_ns as f64 * 1e-9;
        text += &format!("stalls      {} since the start, longest {longest:.1} s\n", status.stalls);
    }
    text
}
