//! A reward that drifts (Sec. 4.1): the landscape moves away under a search that has converged.

use anyhow::Result;
use nalgebra::Vector2;
use physics::landscape::{PEAK, PEAK_VALUE, height};
use search::Search;
use search::algorithm1::{Algorithm1, Algorithm1Config};
use search::tempered::{Tempered, TemperedConfig};
use search::trial::Trial;

use super::Sample;
use super::landscape::{near, point, run, space};

const N_TRIALS: u64 = 400;
/// The last trial before the landscape moves, and by how much: where its peak was, the reward is
/// next to nothing then.
const MOVES_AFTER: u64 = 200;
const SHIFT: [f64; 2] = [2.0, -2.0];
/// Trials until the search should be there again.
const SETTLED: usize = 300;
/// Trials the search that forgets remembers.
const MEMORY: u64 = 100;

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let forgetting = TemperedConfig { memory: MEMORY, ..TemperedConfig::default() };
    let searches: [(&str, Box<dyn Search>); 3] = [
        ("algorithm 1", Box::new(Algorithm1::new(Algorithm1Config::default(), seed, space()))),
        ("tempered", Box::new(Tempered::new(TemperedConfig::default(), seed, space()))),
        ("tempered, memory", Box::new(Tempered::new(forgetting, seed, space()))),
    ];
    let moved = |rollout| if rollout > MOVES_AFTER { SHIFT.into() } else { Vector2::zeros() };
    let mut samples = Vec::new();
    for (method, mut search) in searches {
        let reward = |rollout, theta: &Vector2<f64>| height(&(theta - moved(rollout)));
        let result = run(&mut *search, N_TRIALS, reward, |_| {});
        let mean = |trials: &[Trial]| {
            let sum: f64 = trials.iter().map(|trial| trial.reward).sum();
            sum / (trials.len() as f64 * PEAK_VALUE)
        };
        let before = &result.trials[MOVES_AFTER as usize - 20..MOVES_AFTER as usize];
        let after = &result.trials[SETTLED..];
        let centre = point(&result.modes[0].mean) - Vector2::from(SHIFT);
        samples.push(Sample::mean(method, "reward of 181-200", mean(before)));
        samples.push(Sample::mean(method, "reward of 301-400", mean(after)));
        samples.push(Sample::rate(method, "at the new peak", near(&centre, PEAK)));
    }
    Ok(samples)
}
