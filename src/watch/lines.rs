//! A watched cell as JSON, one object a second.

use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use anyhow::Result;
use serde_json::json;
use shm_types::command::Status;

use super::Model;
use crate::health;
use crate::output::print;
use crate::record::watcher::{Watcher, pause};

const EVERY: Duration = Duration::from_secs(1);

pub fn run(
    mut model: Model,
    mut watcher: Watcher,
    statuses: &Receiver<Status>,
    is_over: &dyn Fn() -> bool,
) -> Result<()> {
    let mut said = Instant::now();
    while !is_over() {
        let round = Instant::now();
        while let Some(seen) = watcher.next()? {
            model.take(&seen);
        }
        model.status = statuses.try_iter().last().or(model.status);
        if said.elapsed() >= EVERY {
            said = Instant::now();
            print(&format!("{}\n", line(&model, &watcher)))?;
        }
        pause(round);
    }
    print(&format!("{}\n", line(&model, &watcher)))
}

fn line(model: &Model, watcher: &Watcher) -> serde_json::Value {
    let (wakeup, tick) = model.times();
    let (session, best) = (&model.session, model.session.best());
    json!({
        "cell": model.cell,
        "controller": if model.is_there { "running" } else { "absent" },
        "health": model.status.map(|status| health::of(&status).0.name()),
        "notes": model.status.map(|status| health::notes(&status, &model.cell)),
        "tick": model.last.record.tick,
        "phase": model.last.record.phase,
        "ticks_seen": watcher.ticks,
        "ticks_lost": watcher.lost,
        "deadline_misses": model.last.missed,
        "wakeup_us": { "p50": wakeup.p50, "p99": wakeup.p99, "max": wakeup.max },
        "tick_us": { "p50": tick.p50, "p99": tick.p99, "max": tick.max },
        "policy_digest": format!("{:016x}", model.last.policy_digest),
        "trials": session.trials.back().map_or(0, |trial| trial.rollout),
        "rollouts": session.rollouts,
        "last_reward": session.trials.back().map(|trial| trial.reward),
        "best_reward": best.map(|(_, reward)| reward),
        "best_rollout": best.map(|(rollout, _)| rollout),
        "success_last20": session.success_last20(),
        "modes": session.modes.len(),
    })
}
