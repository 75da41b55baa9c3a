//! Every method on tasks with an arm, and on one with a hand that is pulled as an arm is: the comparators
//! with tuned settings, beside what `skillet learn` does by default and learning from measures.
//!
//! All have the same rollouts, reward, start, box and directions, those of the task. That a direction is
//! about how to succeed, or grows, and what of the reward follows from the policy is used by our default
//! search alone; none of the comparators, as published, has a place for it. Rewards of these tasks are never
//! negative, so every method takes them as they are.

use anyhow::Result;
use learner::problem::Problem;
use search::trial::Trial;
use search::{Search, Space};

use super::Sample;
use super::contender::{self, CONTENDERS, Contender, Ranges};
use super::runs::{late_reward, late_success};
use super::tasks::{aims, learn};
use crate::config::Config;
use crate::config::plant::DynamicsKind;

pub const ROLLOUTS: u64 = 100;
/// Settings drawn for each comparator and task.
const N_SETTINGS: u64 = 8;
/// What a unit of mean reward counts beside the share of successes: it decides between equal shares only.
const TIE: f64 = 1e-4;

/// Directions of which one unit of noise is a sensible change.
const SENSIBLE: Ranges = Ranges {
    initial_std: [0.3, 1.5],
    floor_std: [0.05, 0.5],
    random_std: [0.3, 1.5],
    restart_std: [0.5, 2.0],
    batch: [5, 20],
    n_initial: [3, 20],
};

/// One unit of the obstacle task is a metre, so about a seventh is sensible.
const METRES: Ranges = Ranges {
    initial_std: [0.04, 0.2],
    floor_std: [0.007, 0.07],
    random_std: [0.04, 0.2],
    restart_std: [0.07, 0.3],
    ..SENSIBLE
};

const TASKS: [(&str, Ranges); 3] =
    [("pancake", SENSIBLE), ("ball-in-a-cup", SENSIBLE), ("obstacle", METRES)];

/// What `robots-tune` chose, by the mean score over seeds 0 and 1. Name of the comparator; settings for each of
/// [`TASKS`].
const CHOSEN: [(&str, [u64; 3]); 8] = [
    ("random", [4, 2, 7]),
    ("PoWER", [1, 1, 4]),
    ("CEM", [4, 5, 7]),
    ("PI2-CMA", [6, 4, 3]),
    ("RWR", [3, 4, 3]),
    ("REINFORCE", [6, 1, 3]),
    ("eNAC", [6, 6, 6]),
    ("CMA-ES", [0, 0, 2]),
];

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    for (index, (task, ranges)) in TASKS.into_iter().enumerate() {
        let config = config(task, seed);
        for (name, config) in ours(&config)? {
            let learnt = learn(&config, |problem| problem.search(&config.learner))?;
            samples.extend(summary(name, task, &learnt.trials));
        }
        for (name, contender) in comparators() {
            let (_, settings) = CHOSEN.iter().find(|(other, _)| *other == name).expect("tuned");
            let trials = run(&config, contender, settings[index], ranges)?;
            samples.extend(summary(name, task, &trials));
        }
    }
    Ok(samples)
}

/// The scores from which the settings were chosen; of settings with the same one the first.
pub fn run_tuning_seed(seed: u64) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    for (task, ranges) in TASKS {
        let config = config(task, seed);
        for (name, contender) in comparators() {
            for setting in 0..N_SETTINGS {
                let trials = run(&config, contender, setting, ranges)?;
                let metric = format!("{task}, setting {setting:02}");
                samples.push(Sample::mean(name, &metric, score(&trials)));
            }
        }
    }
    Ok(samples)
}

fn config(task: &str, seed: u64) -> Config {
    let mut config = Config::of_task(task);
    (config.learner.seed, config.learner.rollouts) = (seed, ROLLOUTS);
    // The faster plant, most of all for a ball on a string; the obstacle has none.
    config.plant.dynamics = DynamicsKind::Split;
    config
}

/// The task's own search, and learning from measures where it says what to aim at: without its prediction
/// of them, and with it where it has one.
fn ours(config: &Config) -> Result<Vec<(&'static str, Config)>> {
    let mut all = vec![("default", config.clone())];
    let mut aiming = config.clone();
    if aims(&mut aiming) {
        let predicts = config.task()?.predictor(config)?.is_some();
        let mut alone = aiming.clone();
        alone.learner.search.aim.predict = false;
        all.push(("aim, data alone", alone));
        all.extend(predicts.then_some(("aim", aiming)));
    }
    Ok(all)
}

/// Those that are tuned. One way to succeed is asked for, so none restarts.
fn comparators() -> impl Iterator<Item = (&'static str, Contender)> {
    CONTENDERS.iter().copied().filter(|(name, _)| *name != "CMA-ES restarts")
}

fn run(config: &Config, contender: Contender, setting: u64, ranges: Ranges) -> Result<Vec<Trial>> {
    let search = |problem: &Problem| -> Box<dyn Search> {
        let space = &problem.spaces[0];
        let plain =
            Space { directions: Vec::new(), known: None, prediction: None, ..space.clone() };
        contender::search(contender, setting, ranges, config.learner.seed, plain)
    };
    Ok(learn(config, search)?.trials)
}

fn score(trials: &[Trial]) -> f64 {
    let mean_reward = trials.iter().map(|trial| trial.reward).sum::<f64>() / trials.len() as f64;
    successes(trials) / trials.len() as f64 + TIE * mean_reward
}

fn successes(trials: &[Trial]) -> f64 {
    trials.iter().filter(|trial| trial.success).count() as f64
}

/// What a session of [`ROLLOUTS`] came to.
pub fn summary(method: &str, task: &str, trials: &[Trial]) -> Vec<Sample> {
    let metric = |name: &str| format!("{task}: {name}");
    let first = trials.iter().find(|trial| trial.success).map(|trial| trial.rollout as f64);
    vec![
        Sample::median(method, &metric("first success"), first.unwrap_or(f64::INFINITY)),
        Sample::rate(method, &metric("success by 100"), first.is_some()),
        Sample::mean(method, &metric("successes of 100"), successes(trials)),
        Sample::mean(method, &metric("success in the last 20"), late_success(trials)),
        Sample::mean(method, &metric("reward of last 20"), late_reward(trials)),
    ]
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;

    #[test]
    fn every_comparator_is_tuned_and_stays_on_the_directions() {
        let plane = DMatrix::from_row_slice(3, 2, &[1.0, 0.0, 0.0, 2.0, 0.0, 0.0]);
        let space = Space::along(DVector::from_element(3, 4.0), plane).unwrap();
        let without = if cfg!(feature = "baselines") { 0 } else { 1 };
        assert_eq!(comparators().count() + without, CHOSEN.len());
        for (name, contender) in comparators() {
            let (_, settings) = CHOSEN.iter().find(|(other, _)| *other == name).unwrap();
            for (setting, (_, ranges)) in settings.iter().zip(TASKS) {
                assert!(*setting < N_SETTINGS, "{name}");
                let search = contender::search(contender, *setting, ranges, 1, space.clone());
                let theta = search.ask(2, &[]).theta;
                assert!(theta[0] != 4.0 && theta[1] != 4.0 && theta[2] == 4.0, "{name}: {theta}");
            }
        }
    }
}
