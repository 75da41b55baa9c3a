//! Every task without an arm that knows success, with its own settings, as `skillet learn` runs it.

use std::collections::BTreeMap;

use anyhow::Result;
use learner::problem::Problem;
use physics::action::ActionWorld;
use rt_controller::executor::action;
use search::trial::{Proposal, Trial};
use shm_types::episode::EpisodeHeader;
use shm_types::policy::PolicyMsg;

use super::Sample;
use crate::config::Config;
use crate::judging;
use crate::tasks::{self, Task, World};

/// Rollouts at the end that show what was learnt.
const LATE: usize = 10;

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    for task in tasks::ALL {
        if let (World::Action(world), Some(success)) = (&task.world, task.success) {
            for options in variants(task) {
                let name =
                    options.values().fold(task.name.to_string(), |all, one| all + ", " + one);
                let mut config = Config::of_options(task.name, options);
                config.learner.seed = seed;
                let trials = learn(&config, world(&config).as_ref())?;
                samples.extend(summary(&name, success, &trials));
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

fn learn(config: &Config, world: &dyn ActionWorld) -> Result<Vec<Trial>> {
    let judge = judging::judge(config)?;
    let start = PolicyMsg::of_action(&config.learner.action.start).sealed();
    let problem = Problem::around(&start, &config.learner, &[])?;
    let mut search = problem.search(&config.learner);
    let mut trials = Vec::new();
    for rollout in 1..=config.learner.rollouts {
        let Proposal { theta, .. } = search.ask(rollout);
        let measures = action::measure(world, theta.as_slice());
        let header = EpisodeHeader { measures, ..EpisodeHeader::default() };
        let (_, success, reward) = judge.judge(&header, &[])?;
        let trial = Trial { rollout, theta, reward, success };
        search.tell(&trial);
        trials.push(trial);
    }
    Ok(trials)
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
