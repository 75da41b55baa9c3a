//! A run of a search with its default settings, for the figures: its trials, and the modes after each.

use anyhow::Result;
use nalgebra::DVector;
use search::trial::Trial;
use search::{Method, Mode, SearchConfig, Space, build};

use super::runs;
use super::world::Task;

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
        let mut modes = Vec::new();
        let reward = |_, theta: &DVector<f64>| reward(theta);
        let trials = runs::trials(&mut *search, n, reward, |search| modes.push(search.modes()));
        Ok(Run { trials, modes })
    }

    /// `n` trials of `method` on a world of Sec. 4.2.
    pub fn on(task: Task, method: Method, seed: u64, n: u64) -> Result<Run> {
        Run::new(method, seed, task.space(), n, &|theta| task.reward(theta))
    }
}
