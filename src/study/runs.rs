//! Whole runs of a search in this process: the one loop of ask and tell all studies share.

use std::convert::Infallible;

use anyhow::Result;
use nalgebra::DVector;
use search::Search;
use search::trial::Trial;

/// Trials at the end of a run that show what the search has come to.
const LATE: usize = 20;

/// `n` trials of `search`; `reward` takes the number of the trial and θ, `observe` sees the search
/// after each trial.
pub fn trials<S: Search + ?Sized>(
    search: &mut S,
    n: u64,
    reward: impl Fn(u64, &DVector<f64>) -> f64,
    mut observe: impl FnMut(&S),
) -> Vec<Trial> {
    let one = |rollout| {
        let execute = |theta: &DVector<f64>| Ok((false, reward(rollout, theta)));
        let Ok(trial) = trial::<_, Infallible>(search, rollout, execute);
        observe(search);
        trial
    };
    (1..=n).map(one).collect()
}

/// The same where rollouts succeed or not: `execute` says whether, and the reward.
pub fn session<S: Search + ?Sized>(
    search: &mut S,
    n: u64,
    mut execute: impl FnMut(u64, &DVector<f64>) -> Result<(bool, f64)>,
) -> Result<Vec<Trial>> {
    (1..=n).map(|rollout| trial(search, rollout, |theta| execute(rollout, theta))).collect()
}

fn trial<S: Search + ?Sized, E>(
    search: &mut S,
    rollout: u64,
    execute: impl FnOnce(&DVector<f64>) -> Result<(bool, f64), E>,
) -> Result<Trial, E> {
    let theta = search.ask(rollout).theta;
    let (success, reward) = execute(&theta)?;
    let trial = Trial { rollout, theta, reward, success };
    search.tell(&trial);
    Ok(trial)
}

/// Mean reward of the last 20 trials.
pub fn late_reward(trials: &[Trial]) -> f64 {
    let late = &trials[trials.len() - LATE..];
    late.iter().map(|trial| trial.reward).sum::<f64>() / late.len() as f64
}

/// The highest reward of a trial.
pub fn best_reward(trials: &[Trial]) -> f64 {
    trials.iter().map(|trial| trial.reward).fold(0.0, f64::max)
}
