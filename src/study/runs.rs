//! Whole runs of a search in this process: the one loop of ask and tell all studies share.

use std::convert::Infallible;

use anyhow::Result;
use nalgebra::DVector;
use search::Search;
use search::trial::Trial;

/// Trials at the end of a run that show what the search has come to.
const LATE: usize = 20;

/// A trial, and whether it was the search's mean that was executed and no draw around it.
pub struct Executed {
    pub trial: Trial,
    pub is_mean: bool,
}

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
        let Ok(executed) = trial::<_, _, Infallible>(search, rollout, execute);
        observe(search);
        executed.trial
    };
    (1..=n).map(one).collect()
}

/// What an executed θ came to.
pub struct Came {
    pub success: bool,
    pub reward: f64,
    /// Measures of the search's targets, if it has any.
    pub measured: Vec<Option<f64>>,
}

impl From<(bool, f64)> for Came {
    fn from((success, reward): (bool, f64)) -> Came {
        Came { success, reward, measured: Vec::new() }
    }
}

/// The same where rollouts succeed or not: `execute` says whether, and the reward.
pub fn session<S: Search + ?Sized, C: Into<Came>>(
    search: &mut S,
    n: u64,
    mut execute: impl FnMut(u64, &DVector<f64>) -> Result<C>,
) -> Result<Vec<Executed>> {
    (1..=n).map(|rollout| trial(search, rollout, |theta| execute(rollout, theta))).collect()
}

/// One of them.
pub fn trial<S: Search + ?Sized, C: Into<Came>, E>(
    search: &mut S,
    rollout: u64,
    execute: impl FnOnce(&DVector<f64>) -> Result<C, E>,
) -> Result<Executed, E> {
    let theta = search.ask(rollout, &[]).theta;
    // The first rollout is the start, which is nobody's mean yet.
    let is_mean = rollout > 1 && theta == *search.mean();
    let Came { success, reward, measured } = execute(&theta)?.into();
    let trial = Trial { rollout, theta, reward, success, measured };
    search.tell(&trial);
    Ok(Executed { trial, is_mean })
}

/// Mean reward of the last 20 trials.
pub fn late_reward(trials: &[Trial]) -> f64 {
    let late = &trials[trials.len() - LATE..];
    late.iter().map(|trial| trial.reward).sum::<f64>() / late.len() as f64
}

/// Share of successes among them.
pub fn late_success(trials: &[Trial]) -> f64 {
    let late = &trials[trials.len() - LATE..];
    late.iter().filter(|trial| trial.success).count() as f64 / late.len() as f64
}

/// The highest reward of a trial.
pub fn best_reward(trials: &[Trial]) -> f64 {
    trials.iter().map(|trial| trial.reward).fold(0.0, f64::max)
}
