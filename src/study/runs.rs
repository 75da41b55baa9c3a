//! A whole run of a search in this process, with what it had found after each trial.

use anyhow::Result;
use learner::search::{Method, Mode, SearchConfig, Space, build};
use learner::trial::Trial;
use nalgebra::DVector;

use super::comparison::Task;

/// The trials of a run and the modes after each.
pub struct Run {
    pub trials: Vec<Trial>,
    pub modes: Vec<Vec<Mode>>,
}

impl Run {
    /// `n` trials of `method`, with its default settings, in `space`.
    pub fn new(
        method: Method,
        seed: u64,
        space: Space,
        n: u64,
        reward: &dyn Fn(&DVector<f64>) -> f64,
    ) -> Result<Run> {
        let config = SearchConfig { method, ..Default::default() };
        let mut search = build(&config, seed, space);
        let mut run = Run { trials: Vec::new(), modes: Vec::new() };
        for rollout in 1..=n {
            let theta = search.ask(rollout).theta;
            let reward = reward(&theta);
            let trial = Trial { rollout, theta, reward, success: false };
            search.tell(&trial);
            run.trials.push(trial);
            run.modes.push(search.modes());
        }
        Ok(run)
    }

    /// `n` trials of `method` on a world of Sec. 4.2.
    pub fn on(task: Task, method: Method, seed: u64, n: u64) -> Result<Run> {
        Run::new(method, seed, task.space(), n, &|theta| task.reward(theta))
    }
}
