//! Learning from measures: how soon a flip is caught, with a prediction, with a bad one and with none, beside
//! the default that learns from a reward. On the split plant.

use std::f64::consts::PI;
use std::fmt::Write;

use anyhow::Result;
use learner::Demonstration;
use learner::prediction::{Predicted, Predictor};
use learner::problem::Problem;
use physics::pancake::PancakeConfig;
use search::Method;
use search::aim::Then;
use search::normals::{standard_normal, stream};

use super::Sample;
use super::pancake::{Answer, Bench, JUDGING, LEARNING};
use super::runs::{Came, Executed, trial};
use crate::config::Config;
use crate::config::plant::DynamicsKind;
use crate::setup;

const ROLLOUTS: u64 = 30;
/// By this rollout the first success is to have come.
const SOON: [u64; 2] = [5, 15];
/// Stream of the noise of measures, beyond those of the worlds.
const NOISE: u64 = 5 << 32;
/// Noise of measured apex, turn and forward miss: m, rad, m.
const NOISES: [f64; 3] = [0.01, 0.1, 0.01];
/// A prediction that takes every speed for this much of what it is.
const SLOW: f64 = 0.7;

/// A way to learn, and under which circumstances.
#[derive(Clone, Copy)]
struct Case {
    name: &'static str,
    method: Method,
    predict: bool,
    then: Then,
    demonstration: fn(&Demonstration) -> String,
    /// Every rollout has another pancake.
    varies: bool,
    /// Controller and prediction know too light a pan.
    wrong_mass: bool,
    /// The prediction is wrong, and what is measured is noisy.
    is_slow: bool,
    /// To the last rollout, and with its answer tried in other worlds; else to the first success.
    whole: bool,
}

const DATA: Case = Case {
    name: "aim, data alone",
    method: Method::Aim,
    predict: false,
    then: Then::Aim,
    demonstration: as_it_is,
    varies: false,
    wrong_mass: false,
    is_slow: false,
    whole: true,
};
const AIM: Case = Case { name: "aim", predict: true, ..DATA };
const SCALAR: Case = Case { name: "power", method: Method::Power, ..DATA };
const OTHER: Case = Case { whole: false, ..AIM };

const CASES: [Case; 17] = [
    SCALAR,
    DATA,
    AIM,
    Case { name: "aim, then power", then: Then::Power, ..AIM },
    Case { name: "power, another pancake each time", varies: true, whole: false, ..SCALAR },
    Case { name: "aim, data alone, another pancake each time", varies: true, whole: false, ..DATA },
    Case { name: "aim, another pancake each time", varies: true, ..OTHER },
    Case { name: "aim, predicts 0.7 of the speed, noise", is_slow: true, ..OTHER },
    Case { name: "aim, 70 % of the pan known", wrong_mass: true, ..OTHER },
    Case { name: "aim, lob", demonstration: lob, ..OTHER },
    Case { name: "aim, 0.7 of the amplitude", demonstration: small, ..OTHER },
    Case { name: "aim, half the rotation", demonstration: flat, ..OTHER },
    Case { name: "aim, 1.25 times slower", demonstration: slow, ..OTHER },
    Case { name: "aim, 6 cm forward at the peak", demonstration: forward, ..OTHER },
    Case { name: "power, 70 % of the pan known", wrong_mass: true, whole: false, ..SCALAR },
    Case { name: "power, 1.25 times slower", demonstration: slow, whole: false, ..SCALAR },
    Case {
        name: "power, 6 cm forward at the peak",
        demonstration: forward,
        whole: false,
        ..SCALAR
    },
];

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    for case in &CASES {
        samples.extend(run(case, seed)?);
    }
    Ok(samples)
}

fn run(case: &Case, seed: u64) -> Result<Vec<Sample>> {
    let mut config = Config::of_task("pancake");
    config.plant.dynamics = DynamicsKind::Split;
    let learner = &mut config.learner;
    (learner.seed, learner.rollouts) = (seed, ROLLOUTS);
    learner.search.method = case.method;
    (learner.search.aim.predict, learner.search.aim.then) = (case.predict, case.then);
    let bench = Bench::new(config, case.wrong_mass)?;
    let world = |rollout| match case.varies {
        true => bench.perturbed(seed, LEARNING + rollout),
        false => bench.world,
    };
    let (executed, answer) = learn(case, &bench, seed, world)?;
    let mut samples = first_success(case.name, &executed);
    if case.whole {
        let n = executed.iter().filter(|executed| executed.trial.success).count() as f64;
        samples.push(Sample::mean(case.name, &format!("successes in {ROLLOUTS}"), n));
        let robust = bench.robustness(&answer, |n| bench.perturbed(seed, JUDGING + n))?;
        samples.push(Sample::mean(case.name, "robustness", robust));
    }
    Ok(samples)
}

fn learn(
    case: &Case,
    bench: &Bench,
    seed: u64,
    world: impl Fn(u64) -> PancakeConfig,
) -> Result<(Vec<Executed>, Answer)> {
    let config = &bench.config.learner;
    let text = (case.demonstration)(&setup::built_in_demonstration(&bench.config)?);
    let demonstration = Demonstration::parse(case.name, &text)?;
    let predictor = bench.judge.predictor().map(|true_one| match case.is_slow {
        true => Predictor::new(move |policy| slowed(true_one.of(policy))),
        false => true_one,
    });
    let problem = Problem::new(config, &[demonstration])?.with_prediction(config, predictor);
    let mut search = problem.search(config);
    let mut executed = Vec::new();
    for rollout in 1..=config.rollouts {
        let one = trial(&mut *search, rollout, |theta| -> Result<Came> {
            let came = bench.rollout(&problem, theta, &world(rollout))?;
            Ok(if case.is_slow { noisy(came, seed, rollout) } else { came })
        })?;
        let is_enough = one.trial.success && !case.whole;
        executed.push(one);
        if is_enough {
            break;
        }
    }
    let mean = search.mean().clone();
    Ok((executed, (problem, mean)))
}

/// With every speed times [`SLOW`] heights, and how far one turns and flies, are this squared.
fn slowed(predicted: Predicted) -> Predicted {
    predicted.into_iter().map(|(name, value)| (name, value * SLOW * SLOW)).collect()
}

fn noisy(came: Came, seed: u64, rollout: u64) -> Came {
    let mut rng = stream(seed, NOISE + rollout);
    let mut measured = came.measured;
    for (value, noise) in measured.iter_mut().zip(NOISES) {
        let noise = noise * standard_normal(&mut rng);
        *value = value.map(|value| value + noise);
    }
    Came { measured, ..came }
}

fn first_success(name: &str, executed: &[Executed]) -> Vec<Sample> {
    let first = executed.iter().find(|executed| executed.trial.success);
    let first = first.map_or(f64::INFINITY, |executed| executed.trial.rollout as f64);
    let mut samples = vec![Sample::median(name, "first success", first)];
    for by in SOON {
        samples.push(Sample::rate(name, &format!("success by {by}"), first <= by as f64));
    }
    samples
}

fn as_it_is(demonstration: &Demonstration) -> String {
    altered(demonstration, 1.0, |_, pose| pose)
}

fn small(demonstration: &Demonstration) -> String {
    let start = demonstration.poses()[0];
    altered(demonstration, 1.0, |_, pose| {
        std::array::from_fn(|c| if c < 3 { start[c] + 0.7 * (pose[c] - start[c]) } else { pose[c] })
    })
}

fn flat(demonstration: &Demonstration) -> String {
    altered(demonstration, 1.0, |_, [x, y, z, pitch]| [x, y, z, 0.5 * pitch])
}

fn slow(demonstration: &Demonstration) -> String {
    altered(demonstration, 1.25, |_, pose| pose)
}

/// A bump over the whole movement, highest in its middle.
fn forward(demonstration: &Demonstration) -> String {
    altered(demonstration, 1.0, |phase, [x, y, z, pitch]| {
        [x + 0.06 * (PI * phase).sin().powi(2), y, z, pitch]
    })
}

/// The other demonstration that comes with the project.
fn lob(_: &Demonstration) -> String {
    include_str!("../../demos/pancake_lob.csv").into()
}

/// Another demonstration as a file: so many times slower, its poses (x, y, z, pitch) changed, each by its
/// phase of the movement.
fn altered(
    demonstration: &Demonstration,
    slower: f64,
    change: impl Fn(f64, [f64; 4]) -> [f64; 4],
) -> String {
    let (poses, period_s) = (demonstration.poses(), demonstration.period_s() * slower);
    let mut text = String::from("t_s,x_m,y_m,z_m,pitch_rad\n");
    for (k, pose) in poses.iter().enumerate() {
        let phase = k as f64 / (poses.len() - 1) as f64;
        let [x, y, z, pitch] = change(phase, [pose[0], pose[1], pose[2], pose[3]]);
        let t_s = k as f64 * period_s;
        writeln!(text, "{t_s},{x},{y},{z},{pitch}").expect("a string takes all");
    }
    text
}
