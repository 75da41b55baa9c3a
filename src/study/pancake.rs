//! Pancake flipping: when each method first succeeds, how reliably late in a session, and how
//! robust its answer is to another pancake.

use anyhow::{Context, Result};
use learner::exploration::ExplorationKind;
use learner::judge::Judge;
use learner::problem::Problem;
use learner::reward::RewardKind;
use learner::summary::LATE_TRIALS;
use learner::{Demonstration, LearnerConfig};
use nalgebra::DVector;
use physics::arm::ArmModel;
use physics::pancake::{PancakeConfig, PancakePlant};
use physics::plant::Plant;
use physics::referee::{Referee, Toss, TossConfig};
use rand::RngExt;
use rt_controller::run::Controlled;
use rt_controller::simulate::simulate;
use search::Search;
use search::normals::stream;
use search::power::{Elites, PowerConfig, Scatter, Weights};
use shm_types::episode::{EpisodeHeader, MAX_RECORDS, TickRecord};

use super::Sample;
use super::runs::session;
use crate::config::Config;
use crate::{judging, setup};

/// Perturbed rollouts that judge an answer.
const N_PERTURBED: u64 = 20;
/// A first success by this rollout is an early one.
const EARLY: u64 = 45;
/// Streams of random numbers beyond those of the rollouts: worlds to judge in, worlds to learn in.
const JUDGING: u64 = 1 << 32;
const LEARNING: u64 = 2 << 32;
/// Part of the pan's mass that a wrong model of the arm knows of.
const KNOWN_MASS: f64 = 0.7;

/// A way to learn.
struct Method {
    name: &'static str,
    config: fn(&mut LearnerConfig),
    /// Every rollout has another pancake.
    perturbed: bool,
    /// The controller's model of the arm has too light a pan.
    wrong_mass: bool,
}

const PLAIN: Method = Method { name: "", config: |_| {}, perturbed: false, wrong_mass: false };

/// The default of `skillet learn pancake`.
const DEFAULT: Method = Method { name: "demonstration", ..PLAIN };

const VARIANTS: &[Method] = &[
    Method { name: "white", config: white, ..PLAIN },
    Method { name: "paper", config: paper, ..PLAIN },
    Method { name: "wrong mass", wrong_mass: true, ..PLAIN },
    Method { name: "perturbed", perturbed: true, ..PLAIN },
    Method {
        name: "perturbed, memory 20",
        config: |c| c.search.power.memory = 20,
        perturbed: true,
        ..PLAIN
    },
];

/// The default search on all parameters.
fn white(config: &mut LearnerConfig) {
    config.exploration.kind = ExplorationKind::White;
}

/// Reward and search of the paper, with the settings that suit them best.
fn paper(config: &mut LearnerConfig) {
    white(config);
    config.reward.kind = RewardKind::Paper;
    config.search.power = PowerConfig {
        n_elites: 5,
        elites: Elites::All,
        min_successes: 1,
        weights: Weights::Reward,
        scatter: Scatter::Old,
        memory: 0,
        n_initial: 20,
        initial_std: 0.7,
        floor_std: 0.2,
        floor_decay: 0.99,
        floor_min: 0.05,
    };
}

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    run_method(&DEFAULT, seed)
}

pub fn run_variants(seed: u64) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    for method in VARIANTS {
        samples.extend(run_method(method, seed)?);
    }
    Ok(samples)
}

fn run_method(method: &Method, seed: u64) -> Result<Vec<Sample>> {
    let mut config = Config::default();
    config.learner.seed = seed;
    (method.config)(&mut config.learner);
    let bench = Bench::new(config, method.wrong_mass)?;
    let demonstrations = setup::demonstrations(&bench.config)?;
    let (successes, answer) = learn(&bench, &demonstrations, method.perturbed)?;

    let judged: Result<Vec<bool>> = (0..N_PERTURBED)
        .map(|n| Ok(bench.rollout(&answer.0, &answer.1, &bench.perturbed(seed, JUDGING + n))?.0))
        .collect();
    let robust = judged?.into_iter().filter(|success| *success).count();
    let first = successes.iter().position(|success| *success).map(|at| at as u64 + 1);
    let late = &successes[successes.len().saturating_sub(LATE_TRIALS)..];
    let late_rate = late.iter().filter(|success| **success).count() as f64 / late.len() as f64;
    let name = method.name;
    Ok(vec![
        Sample::median(name, "first success", first.map_or(f64::INFINITY, |first| first as f64)),
        Sample::rate(name, "success by 100", first.is_some()),
        Sample::rate(name, "success by 45", first.is_some_and(|first| first <= EARLY)),
        Sample::mean(name, "success in the last 20", late_rate),
        Sample::median(name, "success in the last 20, median", late_rate),
        Sample::rate(name, "success in the last 20 below half", late_rate < 0.5),
        Sample::mean(name, "robustness", robust as f64 / N_PERTURBED as f64),
    ])
}

/// A problem and the θ a search came to.
type Answer = (Problem, DVector<f64>);

/// Success of each rollout, and the search's answer.
fn learn(
    bench: &Bench,
    demonstrations: &[Demonstration],
    perturbed: bool,
) -> Result<(Vec<bool>, Answer)> {
    let config = &bench.config.learner;
    let problem = Problem::new(config, demonstrations)?;
    let mut search: Box<dyn Search> = problem.search(config);
    let trials = session(&mut *search, config.rollouts, |rollout, theta| {
        let world =
            if perturbed { bench.perturbed(config.seed, LEARNING + rollout) } else { bench.world };
        bench.rollout(&problem, theta, &world)
    })?;
    let successes = trials.iter().map(|trial| trial.success).collect();
    let mean = search.mean().clone();
    Ok((successes, (problem, mean)))
}

/// Arm, controller and world of a method.
pub struct Bench {
    pub config: Config,
    /// The arm, and what the controller takes it for.
    pub arm: ArmModel,
    model: ArmModel,
    pub world: PancakeConfig,
    pub judge: Judge,
}

impl Bench {
    pub fn new(config: Config, wrong_mass: bool) -> Result<Bench> {
        let (arm, world) = (setup::arm(&config)?, config.plant.world(config.controller.period_s()));
        let model = if wrong_mass { light_pan(&config)? } else { setup::arm(&config)? };
        let judge = judging::judge(&config)?;
        Ok(Bench { config, arm, model, world, judge })
    }

    /// The world with another pancake: start ±1 cm, mass ±10 %, friction ±20 %.
    pub fn perturbed(&self, seed: u64, draw: u64) -> PancakeConfig {
        let mut rng = stream(seed, draw);
        let mut within = |reach: f64| rng.random_range(-reach..=reach);
        let [x, y] = self.world.pancake_offset;
        PancakeConfig {
            pancake_offset: [x + within(0.01), y + within(0.01)],
            pancake_mass: self.world.pancake_mass * (1.0 + within(0.1)),
            friction: self.world.friction * (1.0 + within(0.2)),
            ..self.world
        }
    }

    /// Success and reward.
    pub fn rollout(
        &self,
        problem: &Problem,
        theta: &DVector<f64>,
        world: &PancakeConfig,
    ) -> Result<(bool, f64)> {
        let plant = PancakePlant::new(&self.arm, &self.config.plant.start_posture(), world);
        let records = self.records(problem, theta, plant)?;
        let (_, success, reward) = self.judge.judge(&EpisodeHeader::default(), &records)?;
        Ok((success, reward))
    }

    /// Of the policy θ on `plant`.
    pub fn records<P: Plant>(
        &self,
        problem: &Problem,
        theta: &DVector<f64>,
        mut plant: P,
    ) -> Result<Vec<TickRecord>> {
        let policy = problem.decode(theta, Default::default());
        let (q0, config) = (self.config.plant.start_posture(), &self.config.controller);
        let referee = Referee::Toss(Toss::new(&TossConfig::default()));
        let mut controlled = Controlled { model: &self.model, plant: &mut plant, q0, referee };
        let mut records = vec![TickRecord::ZERO; MAX_RECORDS];
        let rollout = simulate(&mut controlled, config, &policy, &mut records)?;
        records.truncate(rollout.n_records);
        Ok(records)
    }
}

/// The built-in arm with a part of its pan's mass.
fn light_pan(config: &Config) -> Result<ArmModel> {
    let whole = setup::arm_text(config)?;
    let (before, pan) = whole.split_once("<link name=\"pan\">").context("no pan")?;
    let (head, rest) = pan.split_once("<mass value=\"").context("no mass")?;
    let (mass, tail) = rest.split_once('"').context("no mass")?;
    let mass = KNOWN_MASS * mass.parse::<f64>().context("no mass")?;
    let urdf = format!("{before}<link name=\"pan\">{head}<mass value=\"{mass}\"{tail}");
    Ok(ArmModel::from_urdf(&urdf, &config.plant.tip)?)
}
