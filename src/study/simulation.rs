//! How true the simulated step is: policies from learning, failures included, in perturbed worlds, with steps
//! of every length against steps so short that shorter ones change little.
//!
//! How little, the neighbour of the reference shows. A friction of 1.0001 times shows the floor: bounces are
//! chaotic, and below what so small a change does nothing is told apart.

use anyhow::Result;
use learner::problem::Problem;
use nalgebra::DVector;
use physics::arm::JointVector;
use physics::pancake::{PancakeConfig, PancakePlant};
use physics::plant::{Measurement, Plant};
use shm_types::episode::EpisodeHeader;

use super::Sample;
use super::pancake::Bench;
use super::runs::session;
use crate::config::Config;
use crate::setup;
use crate::tasks::camera::Camera;

/// Rollouts of a session whose policies are cases, each in so many perturbed worlds.
const ROLLOUTS: [u64; 12] = [4, 8, 12, 16, 20, 25, 30, 40, 50, 65, 80, 100];
const N_WORLDS: u64 = 2;
/// Stream of the worlds' random numbers, beyond those of the rollouts.
const WORLDS: u64 = 3 << 32;

/// How finely the world is stepped; the controller keeps its period.
struct Setting {
    name: &'static str,
    steps_a_period: usize,
    substeps: usize,
    /// Times the friction.
    friction: f64,
}

const fn steps(name: &'static str, steps_a_period: usize, substeps: usize) -> Setting {
    Setting { name, steps_a_period, substeps, friction: 1.0 }
}

const REFERENCE: Setting = steps("reference", 4, 16);
const SETTINGS: [Setting; 5] = [
    steps("neighbour: 2 steps of 8", 2, 8),
    steps("default: 1 step of 4", 1, 4),
    Setting { friction: 1.0001, ..steps("default, friction x 1.0001", 1, 4) },
    steps("1 step of 2", 1, 2),
    steps("1 step of 1", 1, 1),
];

/// What a case came to.
struct Seen {
    caught: bool,
    tossed: bool,
    apex_m: f64,
    turn_rad: f64,
    /// Pancake before the middle of the pan, along the pan, at the crossing.
    forward_m: f64,
}

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let mut config = Config::default();
    config.learner.seed = seed;
    let bench = Bench::new(config, false)?;
    let (problem, thetas) = learn(&bench)?;
    let worlds: Vec<PancakeConfig> =
        (0..N_WORLDS * ROLLOUTS.len() as u64).map(|n| bench.perturbed(seed, WORLDS + n)).collect();
    let run = |setting: &Setting| -> Result<Vec<Seen>> {
        let cases = worlds.iter().enumerate();
        cases
            .map(|(n, world)| {
                let theta = &thetas[n / N_WORLDS as usize];
                see(&bench, &problem, theta, world, setting)
            })
            .collect()
    };
    let reference = run(&REFERENCE)?;
    let mut samples = Vec::new();
    for setting in &SETTINGS {
        samples.extend(compare(setting.name, &reference, &run(setting)?));
    }
    Ok(samples)
}

/// The θ of some rollouts of a session.
fn learn(bench: &Bench) -> Result<(Problem, Vec<DVector<f64>>)> {
    let config = &bench.config.learner;
    let problem = Problem::new(config, &setup::demonstrations(&bench.config)?)?;
    let last = ROLLOUTS[ROLLOUTS.len() - 1];
    let trials = session(&mut *problem.search(config), last, |_, theta| {
        bench.rollout(&problem, theta, &bench.world)
    })?;
    let thetas = trials.into_iter().filter(|trial| ROLLOUTS.contains(&trial.rollout));
    Ok((problem, thetas.map(|trial| trial.theta).collect()))
}

fn see(
    bench: &Bench,
    problem: &Problem,
    theta: &DVector<f64>,
    world: &PancakeConfig,
    setting: &Setting,
) -> Result<Seen> {
    let world = PancakeConfig {
        period_s: world.period_s / setting.steps_a_period as f64,
        solver_iterations: setting.substeps,
        friction: world.friction * setting.friction,
        ..*world
    };
    let plant = PancakePlant::new(&bench.arm, &bench.config.plant.start_posture(), &world);
    let plant = Finer { plant, steps: setting.steps_a_period };
    let records = bench.records(problem, theta, plant)?;
    let (measures, caught, _) = bench.judge.judge(&EpisodeHeader::default(), &records)?;
    let of = |name: &str| measures.get(name).unwrap_or(0.0);
    let (tossed, crossing_s) = (of("tossed") == 1.0, of("crossing_time_s"));
    let mut forward_m = 0.0;
    Camera::new(&bench.arm, bench.config.controller.record_s()).show(
        &records,
        |t_s, tip, object| {
            if tossed && t_s == crossing_s {
                forward_m = tip.inverse_transform_point(&object.p_WO.into()).x;
            }
        },
    );
    Ok(Seen { caught, tossed, apex_m: of("apex_m"), turn_rad: of("flip_angle_rad"), forward_m })
}

/// Verdicts that differ, and what lies between the cases that both tossed.
fn compare(name: &str, reference: &[Seen], seen: &[Seen]) -> Vec<Sample> {
    let pairs = || reference.iter().zip(seen);
    let differing = |is: fn(&Seen) -> bool| {
        pairs().filter(|(a, b)| is(a) != is(b)).count() as f64 / seen.len() as f64
    };
    let errors = |of: fn(&Seen) -> f64| -> Vec<f64> {
        let tossed = pairs().filter(|(a, b)| a.tossed && b.tossed);
        tossed.map(|(a, b)| 1e3 * (of(b) - of(a))).collect()
    };
    let middle = |mut errors: Vec<f64>| -> f64 {
        errors.sort_by(f64::total_cmp);
        errors.get(errors.len() / 2).copied().unwrap_or(0.0)
    };
    let typical = |errors: &[f64]| middle(errors.iter().map(|error| error.abs()).collect());
    let forward = errors(|seen| seen.forward_m);
    vec![
        Sample::mean(name, "catches that differ", differing(|seen| seen.caught)),
        Sample::mean(name, "tosses that differ", differing(|seen| seen.tossed)),
        Sample::mean(name, "apex, mm", typical(&errors(|seen| seen.apex_m))),
        Sample::mean(name, "turn, mrad", typical(&errors(|seen| seen.turn_rad))),
        Sample::mean(name, "forward miss, mm", typical(&forward)),
        Sample::mean(name, "forward miss, signed, mm", middle(forward)),
    ]
}

/// A world of several steps a period.
struct Finer {
    plant: PancakePlant,
    steps: usize,
}

impl Plant for Finer {
    fn is_simulated(&self) -> bool {
        true
    }

    fn begin_reset(&mut self) {
        self.plant.begin_reset();
    }

    fn is_ready(&self) -> bool {
        self.plant.is_ready()
    }

    fn measure(&self) -> Measurement {
        self.plant.measure()
    }

    fn apply(&mut self, tau: &JointVector) {
        self.plant.apply(tau);
    }

    fn advance(&mut self) {
        (0..self.steps).for_each(|_| self.plant.advance());
    }
}
