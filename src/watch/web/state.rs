//! What the page shows of a cell beside the picture, as JSON. It is between the page and this version of the tool;
//! scripts use `skillet watch --json`.

use std::path::Path;
use std::time::Duration;

use rt_controller::disk::state_file::State;
use rt_controller::fault::Fault;
use serde_json::{Value, json};
use shm_types::command::Status;

use super::timing::Timing;
use crate::fields::phase;
use crate::health;
use crate::watch::Model;
use crate::watch::session::{Trial, WatchedSession};
use crate::watch::words::{pace, way};

/// Health, learner and policies.
pub fn state(model: &Model, lost: u64, catalogue: &Value) -> Value {
    let (vitals, session) = (&model.vitals, &model.session);
    let (health, findings) = vitals.health().unzip();
    let seconds = |age: Option<Duration>| age.map(|age| (age.as_secs_f64() * 10.0).round() / 10.0);
    json!({
        "kind": "state",
        "controller": vitals.controller().name(),
        "controller_age_s": seconds(Some(vitals.silence())),
        "learner": vitals.learner().name(),
        "learner_age_s": seconds(vitals.learner_age()),
        "health": health.map(|health| health.name()),
        "findings": findings,
        "phase": phase(model.last.record.phase),
        "tick": model.last.record.tick,
        "tick_age_s": seconds(vitals.tick_age()),
        "deadline_misses": model.last.missed,
        "ticks_lost": lost,
        "way": way(model),
        "status": vitals.status().map(|status| of_controller(&status, model)),
        "catalogue": catalogue,
        "rollout": session.trials.back().map_or(0, |trial| trial.rollout),
        "rollouts": session.rollouts,
        "trial_age_s": seconds(session.trial_age()),
        "best": session.best().map(|(rollout, reward)| json!({ "rollout": rollout, "reward": reward })),
        "success_last20": session.success_last20(),
        "measures": measures(session),
        "modes": modes(session),
        "notes": model.notes,
    })
}

fn of_controller(status: &Status, model: &Model) -> Value {
    let held = status.latched_fault;
    json!({
        "pace": pace(status),
        "is_paced": status.is_paced(),
        "in_loop": status.in_loop.describe(),
        "active": status.active.describe(),
        "last_good": status.last_good.describe(),
        "pinned": status.pinned == 1,
        "held": (held != 0).then(|| Fault::describe(held as u32)),
        "notes": health::notes(status, &model.cell),
    })
}

fn measures(session: &WatchedSession) -> Vec<Value> {
    let measures = session.measures.iter().flat_map(|measures| measures.iter());
    measures.map(|measure| json!({ "name": measure.name, "text": measure.text() })).collect()
}

fn modes(session: &WatchedSession) -> Vec<Value> {
    let modes = session.modes.iter().map(|mode| {
        json!({
            "share": mode.prior,
            "trials": mode.n_trials,
            "best_rollout": mode.best_rollout,
            "best_reward": mode.best_reward,
            "tolerance": mode.tolerance(),
            "forbidden": mode.forbidden != 0,
        })
    });
    modes.collect()
}

/// Rewards and successes of the session, and loop timing.
pub fn curves(session: &WatchedSession, timing: &Timing) -> Value {
    let column = |of: &dyn Fn(&Trial) -> Value| session.trials.iter().map(of).collect::<Vec<_>>();
    json!({
        "kind": "curves",
        "rollouts": session.rollouts,
        "trials": {
            "rollout": column(&|trial| trial.rollout.into()),
            "reward": column(&|trial| ((trial.reward * 1e4).round() / 1e4).into()),
            "success": column(&|trial| u8::from(trial.success).into()),
            "is_mean": column(&|trial| u8::from(trial.is_mean).into()),
        },
        "timing": timing.json(),
    })
}

/// Policies that can be activated: numbers of the cell's catalogue, without the forbidden ones. An error is a
/// sentence.
pub fn catalogue(state_dir: &Path) -> Value {
    match State::read(state_dir) {
        Ok(state) => {
            let allowed = state.policies.keys().filter(|id| !state.forbidden.contains(id));
            json!({ "policies": allowed.collect::<Vec<_>>() })
        }
        Err(error) => json!({ "policies": [], "error": error.to_string() }),
    }
}
