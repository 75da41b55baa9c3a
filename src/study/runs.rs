//! Whole runs of a search on the worlds without an arm, in this process.

use anyhow::Result;
use learner::search::{Bounds, Method, Mode, SearchConfig, Space, build};
use learner::trial::Trial;
use nalgebra::{DVector, Vector2};
use physics::landscape;
use physics::skittles::{BOX, SkittlesConfig, Throw};

/// λ of the skittles' reward exp(−λ d), 1/m.
pub const LAMBDA: f64 = 3.0;
/// Where the paper's landscape run starts.
pub const LANDSCAPE_START: [f64; 2] = [8.0, 2.0];

/// The trials of a run and the modes after each.
pub struct Run {
    pub trials: Vec<Trial>,
    pub modes: Vec<Vec<Mode>>,
}

impl Run {
    /// `n` trials in `space`; `reward` takes θ and the number of the trial.
    pub fn new(
        config: &SearchConfig,
        seed: u64,
        space: Space,
        n: u64,
        reward: &dyn Fn(&DVector<f64>, u64) -> f64,
    ) -> Result<Run> {
        let mut search = build(config, seed, space);
        let mut run = Run { trials: Vec::new(), modes: Vec::new() };
        for rollout in 1..=n {
            let theta = search.ask(rollout).theta;
            let reward = reward(&theta, rollout);
            let trial = Trial { rollout, theta, reward, success: false };
            search.tell(&trial);
            run.trials.push(trial);
            run.modes.push(search.modes());
        }
        Ok(run)
    }
}

/// Sec. 4.2's first experiment from the paper's start, without a box.
pub fn landscape_run(method: Method, seed: u64, n: u64) -> Result<Run> {
    let config = SearchConfig { method, ..Default::default() };
    let space = Space::white(DVector::from_column_slice(&LANDSCAPE_START));
    Run::new(&config, seed, space, n, &|theta, _| {
        landscape::height(&Vector2::new(theta[0], theta[1]))
    })
}

/// Sec. 4.2's second experiment in its box.
pub fn skittles_run(method: Method, target: [f64; 2], seed: u64, n: u64) -> Result<Run> {
    let config = SearchConfig { method, ..Default::default() };
    let bounds = Bounds::new(2, &BOX.0, &BOX.1)?;
    let space = Space { bounds: Some(bounds), ..Space::white(DVector::from_vec(vec![0.0, 7.5])) };
    let world = SkittlesConfig { target, ..Default::default() };
    Run::new(&config, seed, space, n, &|theta, _| {
        let throw = Throw { alpha: theta[0], alpha_dot: theta[1] };
        (-LAMBDA * world.fly(&throw).distance_m).exp()
    })
}
