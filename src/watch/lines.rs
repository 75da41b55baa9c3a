//! A watched cell line by line: as JSON for scripts, as text where a terminal cannot draw.

use std::time::{Duration, Instant};

use anyhow::Result;
use serde_json::json;

use super::Model;
use crate::output::print;
use crate::record::watcher::{Watcher, pause};
use crate::{fields, health};

const EVERY: Duration = Duration::from_secs(1);

/// How a line is written.
pub type Line = fn(&Model, &Watcher) -> String;

/// A line every second, at the end, and at once when controller or learner come or go.
pub fn run(
    mut model: Model,
    mut watcher: Watcher,
    line: Line,
    is_over: &dyn Fn() -> bool,
) -> Result<()> {
    let mut said = Instant::now();
    while !is_over() {
        let round = Instant::now();
        let changes = model.look(&mut watcher)?;
        if said.elapsed() >= EVERY || !changes.is_empty() {
            said = Instant::now();
            print(&format!("{}\n", line(&model, &watcher)))?;
        }
        pause(round);
    }
    print(&format!("{}\n", line(&model, &watcher)))
}

/// One JSON object.
pub fn json(model: &Model, watcher: &Watcher) -> String {
    let (wakeup, tick) = model.times();
    let (session, best, vitals) = (&model.session, model.session.best(), &model.vitals);
    let (health, findings) = vitals.health().unzip();
    let seconds = |age: Option<Duration>| age.map(|age| age.as_secs_f64());
    let value = json!({
        "cell": model.cell,
        "controller": vitals.controller().name(),
        "via": vitals.via(),
        "telemetry_hz": model.bridged.as_ref().map(|bridged| bridged.hz),
        "controller_age_s": vitals.silence().as_secs_f64(),
        "health": health.map(|health| health.name()),
        "findings": findings,
        "notes": vitals.status().map(|status| health::notes(&status, &model.cell)),
        "status_age_s": seconds(vitals.status_age()),
        "learner": vitals.learner().name(),
        "learner_age_s": seconds(vitals.learner_age()),
        "tick": model.last.record.tick,
        "tick_age_s": seconds(vitals.tick_age()),
        "phase": fields::phase(model.last.record.phase),
        "ticks_seen": watcher.ticks,
        // What a bridge leaves out is not lost.
        "ticks_lost": model.bridged.is_none().then_some(watcher.lost),
        "deadline_misses": model.last.missed,
        "wakeup_us": { "p50": wakeup.p50, "p99": wakeup.p99, "max": wakeup.max },
        "tick_us": { "p50": tick.p50, "p99": tick.p99, "max": tick.max },
        "policy_digest": fields::id(model.last.policy_digest),
        "trials": session.trials.back().map_or(0, |trial| trial.rollout),
        "trial_age_s": seconds(session.trial_age()),
        "rollouts": session.rollouts,
        "last_reward": session.trials.back().map(|trial| trial.reward),
        "best_reward": best.map(|(_, reward)| reward),
        "best_rollout": best.map(|(rollout, _)| rollout),
        "success_last20": session.success_last20(),
        "under_wish_since": session.wished_since(),
        "modes": session.modes.len(),
        "measures": session.measures.map(|measures| -> serde_json::Map<_, _> {
            measures.iter().map(|measure| (measure.name.to_string(), fields::measure(&measure))).collect()
        }),
    });
    fields::versioned(&value).map_or_else(|error| error.to_string(), |value| value.to_string())
}

/// One line of text.
pub fn text(model: &Model, _: &Watcher) -> String {
    let (session, vitals) = (&model.session, &model.vitals);
    let health = match vitals.health() {
        Some((health, findings)) => [vec![health.name().to_string()], findings].concat().join("; "),
        None => "waiting for the controller".into(),
    };
    let tick = match vitals.tick_age() {
        Some(age) => format!(", tick {} {:.1} s ago", model.last.record.tick, age.as_secs_f64()),
        None => String::new(),
    };
    let trials = match (session.trials.back(), session.best()) {
        (Some(last), Some((_, best))) => {
            let (rollout, of, reward) = (last.rollout, session.rollouts, last.reward);
            format!(", rollout {rollout} of {of}: reward {reward:.3}, best {best:.3}")
        }
        _ => String::new(),
    };
    let (controller, learner) = (vitals.controller().name(), vitals.learner().name());
    let bridge = match (&model.bridged, vitals.via()) {
        (Some(bridged), _) => format!(" ({})", bridged.sentence()),
        (None, Some(host)) => format!(" (through the bridge to {host})"),
        (None, None) => String::new(),
    };
    format!("controller {controller}{bridge}{tick}, learner {learner}{trials}; health {health}")
}
