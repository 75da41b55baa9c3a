//! `skillet status`: one look at a running controller.

use std::time::Duration;

use anyhow::{Result, bail};
use serde_json::json;
use shm_types::cell::Cell;
use shm_types::channel::ChannelError;
use shm_types::command::{COMMAND_STATUS, Reply};
use shm_types::ports::ToolPorts;

use crate::Verdict;
use crate::cli::StatusArgs;
use crate::config::Config;
use crate::output::{print, print_json};

const TIMEOUT: Duration = Duration::from_secs(1);
const PHASES: [&str; 4] = ["idle", "approach", "execute", "settle"];

pub fn run(args: &StatusArgs) -> Result<Verdict> {
    let config = Config::load(args.config.as_deref())?;
    let cell = Cell::new(args.cell.as_deref().unwrap_or(&config.cell.name))?;
    let reply = match ToolPorts::open(&cell, TIMEOUT) {
        Ok(ports) => ports.request(COMMAND_STATUS, u64::from(std::process::id()), TIMEOUT),
        Err(error @ ChannelError::NoController { .. }) => {
            if args.json {
                print_json(&json!({ "cell": cell.name(), "controller": "absent" }))?;
            } else {
                print(&format!("{error}\n"))?;
            }
            return Ok(Verdict::Negative);
        }
        Err(error) => return Err(error.into()),
    };
    let Some(reply) = reply else {
        bail!(
            "the controller of cell '{}' does not answer: it may be dead or stopped; start it again",
            cell.name()
        );
    };
    if args.json {
        print_json(&as_json(&cell, &reply))?;
    } else {
        print(&as_text(&cell, &reply))?;
    }
    Ok(Verdict::Done)
}

fn phase(reply: &Reply) -> &'static str {
    PHASES.get(reply.phase as usize).copied().unwrap_or("unknown")
}

fn learner_age_s(reply: &Reply) -> Option<f64> {
    (reply.learner_age_ns != u64::MAX).then_some(reply.learner_age_ns as f64 * 1e-9)
}

fn as_json(cell: &Cell, reply: &Reply) -> serde_json::Value {
    json!({
        "cell": cell.name(),
        "controller": "running",
        "pace": if reply.realtime == 1 { "realtime" } else { "max" },
        "phase": phase(reply),
        "tick": reply.tick,
        "fault": rt_controller::tick::Fault::describe(reply.fault as u32),
        "period_us": reply.period_ns / 1000,
        "realtime_priority": reply.privileged == 1,
        "rollout": reply.rollout,
        "policy_id": reply.policy_id,
        "applied_tick": reply.applied_tick,
        "rollouts_done": reply.rollouts_done,
        "policies_refused": reply.policies_refused,
        "unacknowledged_episodes": reply.unacknowledged,
        "learner_age_s": learner_age_s(reply),
        "deadline_misses": reply.deadline_misses,
        "wakeup_us": percentiles(reply.wakeup_p50_ns, reply.wakeup_p99_ns, reply.wakeup_max_ns),
        "tick_us": percentiles(reply.tick_p50_ns, reply.tick_p99_ns, reply.tick_max_ns),
    })
}

fn percentiles(p50_ns: u64, p99_ns: u64, max_ns: u64) -> serde_json::Value {
    let us = |ns: u64| ns as f64 * 1e-3;
    json!({ "p50": us(p50_ns), "p99": us(p99_ns), "max": us(max_ns) })
}

fn as_text(cell: &Cell, reply: &Reply) -> String {
    let us = |ns: u64| ns as f64 * 1e-3;
    let pace = match (reply.realtime, reply.privileged) {
        (1, 1) => "real time, SCHED_FIFO",
        (1, _) => "real time, without real-time priority",
        _ => "as fast as the simulation allows",
    };
    let learner = match learner_age_s(reply) {
        Some(age) => format!("last heartbeat {age:.1} s ago"),
        None => "never seen".into(),
    };
    let mut text = format!(
        "cell        {}\npace        {pace}, period {} µs\nphase       {}, tick {}, fault: {}\n\
         policy      {} of rollout {}, applied at tick {}\n\
         rollouts    {} done, {} policies refused, {} episodes not yet durable\n\
         learner     {learner}\n",
        cell.name(),
        reply.period_ns / 1000,
        phase(reply),
        reply.tick,
        rt_controller::tick::Fault::describe(reply.fault as u32),
        reply.policy_id,
        reply.rollout,
        reply.applied_tick,
        reply.rollouts_done,
        reply.policies_refused,
        reply.unacknowledged,
    );
    text += &format!(
        "tick        p50 {:.1}  p99 {:.1}  max {:.1} µs\n",
        us(reply.tick_p50_ns),
        us(reply.tick_p99_ns),
        us(reply.tick_max_ns)
    );
    if reply.realtime == 1 {
        text += &format!(
            "wake-up     p50 {:.1}  p99 {:.1}  max {:.1} µs, {} deadlines missed\n",
            us(reply.wakeup_p50_ns),
            us(reply.wakeup_p99_ns),
            us(reply.wakeup_max_ns),
            reply.deadline_misses
        );
    }
    text
}
