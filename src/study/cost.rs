//! What an update costs: one step of Eq. (7) by trials, components and parameters, and the updates of
//! whole searches. Wall-clock times: run it with `--threads 1` on a quiet machine.

use std::time::Instant;

use anyhow::{Context, Result};
use learner::problem::Problem;
use nalgebra::{DMatrix, DVector};
use rand_chacha::ChaCha8Rng;
use search::gaussian::Gaussian;
use search::mixture::{About, Component, EmStep, Mixture};
use search::normals::{standard_normal, stream};
use search::trial::Trial;
use search::{Method, SearchConfig, Space, build};

use super::Sample;
use crate::config::Config;
use crate::{judging, setup};

/// Trials, components, parameters: the reference, then one of them changed at a time.
const CASES: [(u64, usize, usize); 8] = [
    (200, 10, 2),
    (400, 10, 2),
    (200, 20, 2),
    (200, 10, 8),
    (200, 10, 32),
    (200, 10, 112),
    (400, 10, 112),
    (200, 5, 112),
];
const REPETITIONS: usize = 9;
/// Trials of a long session.
const LONG: u64 = 10_000;
/// Trials of a search that learns from measures.
const AIM_TRIALS: u64 = 100;

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    for (n, k, dim) in CASES {
        let metric = format!("D = {dim}, K = {k}, {n} trials, ms");
        samples.push(Sample::median("one step of Eq. (7)", &metric, em_step(seed, n, k, dim)));
    }
    for (name, method) in [("tempered", Method::Tempered), ("power", Method::Power)] {
        for dim in [2, 8] {
            let (median, worst) = session(seed, method, dim);
            let metric = |what: &str| format!("D = {dim}, {what} of {LONG} updates, ms");
            samples.push(Sample::median(name, &metric("median"), median));
            samples.push(Sample::median(name, &metric("worst"), worst));
        }
    }
    for (name, predict) in [("aim", true), ("aim, data alone", false)] {
        let (median, worst) = aim_session(seed, predict)?;
        samples.push(Sample::median(name, "median of the updates 51 to 100, ms", median));
        samples.push(Sample::median(name, "worst of the updates 51 to 100, ms", worst));
    }
    Ok(samples)
}

/// Median time of a step, all trials as elites, ms.
fn em_step(seed: u64, n: u64, k: usize, dim: usize) -> f64 {
    let mut rng = stream(seed, 1);
    let mut point = |spread: f64| normal(&mut rng, dim) * spread;
    let components = (0..k).map(|_| {
        let gaussian = Gaussian::isotropic(point(3.0), 1.0);
        Component { prior: 1.0 / k as f64, gaussian }
    });
    let mixture = Mixture { components: components.collect() };
    let trials: Vec<Trial> = (1..=n)
        .map(|rollout| Trial {
            rollout,
            theta: point(3.0),
            reward: 1.0,
            success: false,
            measured: Vec::new(),
        })
        .collect();
    let step =
        EmStep { n_elites: 0, sigma_0: DMatrix::identity(dim, dim) * 0.1, about: About::OldMean };
    let times = (0..REPETITIONS).map(|_| {
        let start = Instant::now();
        std::hint::black_box(mixture.em_step(&trials, &step));
        start.elapsed().as_secs_f64() * 1e3
    });
    median(times.collect())
}

/// Median and worst time of telling one trial in a long session on a hill, ms.
fn session(seed: u64, method: Method, dim: usize) -> (f64, f64) {
    let config = SearchConfig { method, ..SearchConfig::default() };
    let mut search = build(&config, seed, Space::white(DVector::repeat(dim, 2.0)));
    let mut times = Vec::new();
    for rollout in 1..=LONG {
        let theta = search.ask(rollout, &[]).theta;
        let reward = (-0.5 * theta.norm_squared()).exp();
        let trial = Trial { rollout, theta, reward, success: false, measured: Vec::new() };
        let start = Instant::now();
        search.tell(&trial);
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    let worst = times.iter().copied().fold(0.0, f64::max);
    (median(times), worst)
}

/// The same of the search that learns from measures, on the pancake's policies, without a success: then it
/// looks for candidates after every trial. Measured is what is predicted, a little off.
fn aim_session(seed: u64, predict: bool) -> Result<(f64, f64)> {
    let mut config = Config::of_task("pancake");
    config.learner.search.method = Method::Aim;
    config.learner.search.aim.predict = predict;
    let predictor = judging::judge(&config)?.predictor();
    let problem = Problem::new(&config.learner, &setup::demonstrations(&config)?)?
        .with_prediction(&config.learner, predictor);
    let prediction = problem.spaces[0].prediction.clone().context("the task has a prediction")?;
    let (mut search, mut rng) = (problem.search(&config.learner), stream(seed, 2));
    let mut times = Vec::new();
    for rollout in 1..=AIM_TRIALS {
        let theta = search.ask(rollout, &[]).theta;
        let off = |value: Option<f64>| value.map(|v| v + 0.05 * standard_normal(&mut rng));
        let measured = prediction.of(&theta).into_iter().map(off).collect();
        let trial = Trial { rollout, theta, reward: 0.0, success: false, measured };
        let start = Instant::now();
        search.tell(&trial);
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    let late = times.split_off(AIM_TRIALS as usize / 2);
    let worst = late.iter().copied().fold(0.0, f64::max);
    Ok((median(late), worst))
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn normal(rng: &mut ChaCha8Rng, dim: usize) -> DVector<f64> {
    DVector::from_fn(dim, |_, _| standard_normal(rng))
}
