//! The niching search on F1 to F10 of the CEC 2013 competition, within the competition's budgets.

use anyhow::Result;
use physics::niching::{PROBLEMS, Problem};
use search::niching::{Niching, NichingConfig};
use search::trial::Trial;
use search::{Bounds, Search, Space};

use super::Sample;

/// The competition's levels of accuracy that tell most.
const ACCURACIES: [f64; 3] = [1e-1, 1e-4, 1e-5];

/// Peak ratios: the share of the global optima that is found.
pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    for problem in &PROBLEMS {
        let answers = run(problem, seed)?;
        for accuracy in ACCURACIES {
            let ratio = problem.n_found(&answers, accuracy) as f64 / problem.n_optima as f64;
            samples.push(Sample::mean(problem.name, &format!("peak ratio, {accuracy:e}"), ratio));
        }
        samples.push(Sample::mean(problem.name, "answers", answers.len() as f64));
    }
    Ok(samples)
}

/// The answers after the whole budget. The reward is the height above a bound known beforehand.
fn run(problem: &Problem, seed: u64) -> Result<Vec<Vec<f64>>> {
    let bounds = Bounds::new(problem.min.len(), problem.min, problem.max)?;
    let space = Space::white(bounds.at(&vec![0.5; bounds.dim()]));
    let space = Space { bounds: Some(bounds), ..space };
    let mut search = Niching::new(NichingConfig::default(), seed, space);
    for rollout in 1..=problem.budget {
        let theta = search.ask(rollout, &[]).theta;
        let reward = (problem.f)(theta.as_slice()) - problem.lower;
        search.tell(&Trial { rollout, theta, reward, success: false, measured: Vec::new() });
    }
    Ok(search.modes().iter().map(|mode| mode.mean.as_slice().to_vec()).collect())
}
