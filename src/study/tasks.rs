//! Every task that knows success, with its own settings, as `skillet learn` runs it: those without an
//! arm, and those with one.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::Result;
use learner::judge::Judge;
use learner::problem::Problem;
use learner::targets::measured;
use nalgebra::DVector;
use search::aim::Target;
use search::trial::Trial;
use search::{Method, Search};
use shm_types::measures::Measures;
use shm_types::policy::PolicyMsg;

use super::Sample;
use super::runs::{Came, session};
use crate::config::Config;
use crate::tasks::executor::{Executor, executor};
use crate::tasks::{self, Task};
use crate::{judging, setup};

/// The measure by which a task tells in which of several ways a rollout succeeded.
const WAY: &str = "way";
/// Rollouts at the end that show what was learnt.
const LATE: usize = 10;

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    run(seed, "", |task| !task.has_arm(), |_| true)
}

pub fn run_arm_seed(seed: u64) -> Result<Vec<Sample>> {
    run(seed, "", Task::has_arm, |_| true)
}

pub fn run_aim_seed(seed: u64) -> Result<Vec<Sample>> {
    run(seed, ", aim", |task| !task.has_arm(), aims)
}

/// The pancake has a study of its own.
pub fn run_aim_arm_seed(seed: u64) -> Result<Vec<Sample>> {
    run(seed, ", aim", |task| task.has_arm() && task.name != "pancake", aims)
}

/// Learns from measures, where the task says what to aim at.
pub fn aims(config: &mut Config) -> bool {
    config.learner.search.method = Method::Aim;
    !config.learner.search.aim.targets.is_empty()
}

fn run(
    seed: u64,
    suffix: &str,
    is_asked: fn(&Task) -> bool,
    configure: fn(&mut Config) -> bool,
) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    for task in tasks::ALL.iter().filter(|task| is_asked(task)) {
        if let Some(success) = task.success {
            for options in variants(task) {
                let name =
                    options.values().fold(task.name.to_string(), |all, one| all + ", " + one)
                        + suffix;
                let mut config = Config::of_options(task.name, options);
                config.learner.seed = seed;
                if !configure(&mut config) {
                    continue;
                }
                let learnt = learn(&config, |problem| problem.search(&config.learner))?;
                samples.extend(summary(&name, success, &learnt.trials));
                let ways = learnt.ways.map(|ways| Sample::mean(&name, "ways found", ways as f64));
                samples.extend(ways);
            }
        }
    }
    Ok(samples)
}

/// As it comes, then every other choice it leaves, one at a time.
fn variants(task: &Task) -> Vec<BTreeMap<String, String>> {
    let others = task.options.iter().flat_map(|(name, values)| {
        values[1..].iter().map(|value| BTreeMap::from([(name.to_string(), value.to_string())]))
    });
    [BTreeMap::new()].into_iter().chain(others).collect()
}

/// What a session came to: its trials, and in how many ways it succeeded where they are told apart.
pub struct Learnt {
    pub trials: Vec<Trial>,
    ways: Option<usize>,
}

/// A task that is learnt in this process.
pub struct Stage {
    pub problem: Problem,
    judge: Judge,
    execute: Box<Executor>,
    targets: Vec<Target>,
}

/// What became of a rollout.
pub struct Rollout {
    pub came: Came,
    pub measures: Measures,
    /// How long it took, in the time of the simulation.
    pub duration_ns: u64,
}

impl Stage {
    pub fn of(config: &Config) -> Result<Stage> {
        let (judge, execute) = (judging::judge(config)?, executor(config)?);
        let problem = match config.has_arm() {
            true => Problem::new(&config.learner, &setup::demonstrations(config)?)?,
            false => {
                let start = PolicyMsg::of_action(&config.learner.action.start).sealed();
                Problem::around(&start, &config.learner, &[])?
            }
        };
        let problem = problem.with_prediction(&config.learner, judge.predictor());
        Ok(Stage { problem, judge, execute, targets: config.learner.search.targets().to_vec() })
    }

    pub fn execute(&mut self, theta: &DVector<f64>) -> Result<Rollout> {
        let policy = self.problem.decode(theta, Default::default());
        let (header, records) = (self.execute)(&policy)?;
        let (measures, success, reward) = self.judge.judge(&policy, &header, &records)?;
        let came = Came { success, reward, measured: measured(&self.targets, &measures) };
        let duration_ns = records.len() as u64 * header.period_ns;
        Ok(Rollout { came, measures, duration_ns })
    }
}

/// A session with the search that `search` makes of its problem.
pub fn learn(config: &Config, search: impl FnOnce(&Problem) -> Box<dyn Search>) -> Result<Learnt> {
    let mut stage = Stage::of(config)?;
    let mut search = search(&stage.problem);
    let knows_ways = stage.judge.declared().iter().any(|(name, _)| name == WAY);
    let mut ways = BTreeSet::new();
    let trials = session(&mut *search, config.learner.rollouts, |_, theta| {
        let Rollout { came, measures, .. } = stage.execute(theta)?;
        if let Some(way) = measures.get(WAY).filter(|_| came.success) {
            ways.insert(way.to_bits());
        }
        anyhow::Ok(came)
    })?;
    let trials = trials.into_iter().map(|executed| executed.trial).collect();
    Ok(Learnt { trials, ways: knows_ways.then_some(ways.len()) })
}

fn summary(task: &str, success: &str, trials: &[Trial]) -> Vec<Sample> {
    let first = trials.iter().find(|trial| trial.success).map(|trial| trial.rollout as f64);
    let late = &trials[trials.len().saturating_sub(LATE)..];
    let mean = |of: &dyn Fn(&Trial) -> f64| late.iter().map(of).sum::<f64>() / late.len() as f64;
    let by = trials.len();
    vec![
        Sample::median(task, &format!("first {success}"), first.unwrap_or(f64::INFINITY)),
        Sample::rate(task, &format!("{success} by {by}"), first.is_some()),
        Sample::mean(
            task,
            &format!("{success} in the last {LATE}"),
            mean(&|trial| f64::from(u8::from(trial.success))),
        ),
        Sample::mean(task, &format!("reward in the last {LATE}"), mean(&|trial| trial.reward)),
    ]
}
