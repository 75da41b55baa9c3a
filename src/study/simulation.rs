//! How true the simulated step is: policies from learning, failures included, in perturbed worlds, with steps
//! of every length against steps so short that shorter ones change little.
//!
//! How little, the neighbour of the reference shows. A friction of 1.0001 times shows the floor: bounces are
//! chaotic, and below what so small a change does nothing is told apart.

use anyhow::Result;
use learner::problem::Problem;
use nalgebra::{DVector, Point3, Vector3};
use physics::arm::{ArmModel, JointVector, kinematics};
use physics::pancake::{PancakeConfig, PancakePlant};
use physics::plant::{Dynamics, Measurement, Plant};
use shm_types::episode::EpisodeHeader;

use super::Sample;
use super::pancake::{Bench, uniform};
use super::runs::session;
use super::textbook::{Textbook, textbook};
use crate::config::Config;
use crate::setup;
use crate::tasks::camera::Camera;

/// Rollouts of a session whose policies are cases, each in so many perturbed worlds.
const ROLLOUTS: [u64; 12] = [4, 8, 12, 16, 20, 25, 30, 40, 50, 65, 80, 100];
const N_WORLDS: u64 = 2;
/// Stream of the worlds' random numbers, beyond those of the rollouts.
const WORLDS: u64 = 3 << 32;

/// How the arm moves and how finely the world is stepped; the controller keeps its period.
struct Setting {
    name: &'static str,
    dynamics: Dynamics,
    steps_a_period: usize,
    substeps: usize,
    /// Times the friction.
    friction: f64,
}

const fn multibody(name: &'static str, steps_a_period: usize, substeps: usize) -> Setting {
    Setting { name, dynamics: Dynamics::Multibody, steps_a_period, substeps, friction: 1.0 }
}

const fn split(name: &'static str, steps_a_period: usize, substeps: usize) -> Setting {
    Setting { dynamics: Dynamics::Split, ..multibody(name, steps_a_period, substeps) }
}

/// Shorter steps rather than more sub-steps: those do nothing against what is kept for a whole step.
const REFERENCE: Setting = multibody("reference", 16, 4);
const NUDGE: f64 = 1.0001;
const SETTINGS: [Setting; 10] = [
    multibody("neighbour: 8 steps of 8", 8, 8),
    split("neighbour, split: 4 steps of 4", 4, 4),
    multibody("multibody: 1 step of 4", 1, 4),
    Setting { friction: NUDGE, ..multibody("multibody, friction x 1.0001", 1, 4) },
    multibody("multibody: 1 step of 2", 1, 2),
    multibody("multibody: 1 step of 1", 1, 1),
    split("split: 1 step of 4", 1, 4),
    split("split: 1 step of 2", 1, 2),
    Setting { friction: NUDGE, ..split("split, friction x 1.0001", 1, 2) },
    split("split: 1 step of 1", 1, 1),
];

/// What a case came to.
struct Seen {
    caught: bool,
    tossed: bool,
    apex_m: f64,
    turn_rad: f64,
    /// Pancake before the middle of the pan, along the pan, at the crossing.
    forward_m: f64,
    /// How deep the pancake got into the pan.
    sunk_m: f64,
}

impl Setting {
    fn of(&self, world: &PancakeConfig) -> PancakeConfig {
        PancakeConfig {
            dynamics: self.dynamics,
            period_s: world.period_s / self.steps_a_period as f64,
            solver_iterations: self.substeps,
            friction: world.friction * self.friction,
            ..*world
        }
    }
}

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let mut config = Config::default();
    config.learner.seed = seed;
    // The cases stay the same, whatever the default search becomes.
    uniform(&mut config.learner);
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
    for setting in [&REFERENCE].into_iter().chain(&SETTINGS) {
        samples.extend(by_the_book(&bench, setting)?);
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
    let trials = trials.into_iter().map(|executed| executed.trial);
    let chosen = trials.filter(|trial| ROLLOUTS.contains(&trial.rollout));
    Ok((problem, chosen.map(|trial| trial.theta).collect()))
}

fn see(
    bench: &Bench,
    problem: &Problem,
    theta: &DVector<f64>,
    world: &PancakeConfig,
    setting: &Setting,
) -> Result<Seen> {
    let world = setting.of(world);
    let mut plant = Finer {
        plant: PancakePlant::new(&bench.arm, &bench.config.plant.start_posture(), &world),
        steps: setting.steps_a_period,
        arm: &bench.arm,
        world,
        sunk_m: 0.0,
    };
    let records = bench.records(problem, theta, &mut plant)?;
    let policy = bench.policy(problem, theta);
    let (measures, caught, _) = bench.judge.judge(&policy, &EpisodeHeader::default(), &records)?;
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
    let (apex_m, turn_rad, sunk_m) = (of("apex_m"), of("flip_angle_rad"), plant.sunk_m);
    Ok(Seen { caught, tossed, apex_m, turn_rad, forward_m, sunk_m })
}

/// The same for every seed.
fn by_the_book(bench: &Bench, setting: &Setting) -> Result<[Sample; 3]> {
    let (q0, world) = (bench.config.plant.start_posture(), setting.of(&bench.world));
    let Textbook { rebound, slide, drift_m } = textbook(&bench.arm, &q0, &world)?;
    Ok([
        Sample::mean(setting.name, "rebound on the arm", rebound),
        Sample::mean(setting.name, "slide, off by, %", 100.0 * slide),
        Sample::mean(setting.name, "drift, um/s", 1e6 * drift_m),
    ])
}

/// Case by case: verdicts that differ, and what lies between cases that both tossed. The range of what
/// sinks is the deepest of all.
fn compare<'a>(
    name: &'a str,
    reference: &'a [Seen],
    seen: &'a [Seen],
) -> impl Iterator<Item = Sample> + 'a {
    reference.iter().zip(seen).flat_map(move |(expected, seen)| {
        let mut samples = vec![
            Sample::rate(name, "catches that differ", expected.caught != seen.caught),
            Sample::rate(name, "tosses that differ", expected.tossed != seen.tossed),
            Sample::median(name, "sinks, mm", 1e3 * seen.sunk_m),
        ];
        if expected.tossed && seen.tossed {
            let forward = 1e3 * (seen.forward_m - expected.forward_m);
            let apex = 1e3 * (seen.apex_m - expected.apex_m).abs();
            let turn = 1e3 * (seen.turn_rad - expected.turn_rad).abs();
            samples.extend([
                Sample::median(name, "apex, mm", apex),
                Sample::median(name, "turn, mrad", turn),
                Sample::median(name, "forward miss, mm", forward.abs()),
                Sample::median(name, "forward miss, signed, mm", forward),
                Sample::mean(name, "forward miss, signed, mean, mm", forward),
            ]);
        }
        samples
    })
}

/// A world of several steps a period, in which the pancake is watched for how deep it sinks.
struct Finer<'a> {
    plant: PancakePlant,
    steps: usize,
    arm: &'a ArmModel,
    world: PancakeConfig,
    sunk_m: f64,
}

impl Finer<'_> {
    /// Depth of the lowest point of the pancake, a disc with a round edge, below the pan's surface
    /// where it is over the disc.
    fn depth_m(&self) -> f64 {
        let Measurement { q, object, .. } = self.plant.measure();
        let from_world = kinematics::tip_pose(self.arm, &q).inverse();
        let centre = from_world * Point3::from(object.p_WO);
        let normal = from_world.rotation * (object.R_WO * Vector3::z());
        let PancakeConfig { pancake_radius, pancake_thickness, pancake_border, .. } = self.world;
        let tilt = (1.0 - normal.z * normal.z).max(0.0).sqrt();
        let reach = (pancake_radius - pancake_border) * tilt
            + (pancake_thickness / 2.0 - pancake_border) * normal.z.abs()
            + pancake_border;
        let is_over = centre.coords.xy().norm() + pancake_radius < self.world.pan_radius;
        // What comes from below is beside the pan, not in it.
        if is_over && centre.z > 0.0 { reach - centre.z } else { 0.0 }
    }
}

impl Plant for Finer<'_> {
    fn is_simulated(&self) -> bool {
        true
    }

    fn begin_reset(&mut self) {
        self.plant.begin_reset();
    }

    fn is_ready(&self) -> bool {
        true
    }

    fn measure(&self) -> Measurement {
        self.plant.measure()
    }

    fn apply(&mut self, tau: &JointVector) {
        self.plant.apply(tau);
    }

    fn advance(&mut self) {
        for _ in 0..self.steps {
            self.plant.advance();
            self.sunk_m = self.sunk_m.max(self.depth_m());
        }
    }
}
