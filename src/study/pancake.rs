//! Pancake flipping: when each method first succeeds, how reliably late in a session, and how
//! robust its answer is to another pancake.

use anyhow::{Context, Result};
use learner::LearnerConfig;
use learner::compliance::ComplianceConfig;
use learner::exploration::{ExplorationKind, StiffnessKind};
use learner::judge::Judge;
use learner::problem::Problem;
use learner::reward::RewardKind;
use learner::summary::LATE_TRIALS;
use learner::targets::measured;
use nalgebra::DVector;
use physics::arm::ArmModel;
use physics::pancake::{PancakeConfig, PancakePlant};
use physics::plant::Plant;
use physics::referee::{Referee, Toss, TossConfig};
use rand::RngExt;
use rt_controller::hot::posture::PostureMove;
use rt_controller::run::Controlled;
use search::Search;
use search::normals::stream;
use search::power::{Elites, PowerConfig, Scatter, Weights};
use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::measures::Measures;
use shm_types::policy::PolicyMsg;

use super::Sample;
use super::runs::{Came, Executed, session};
use crate::config::Config;
use crate::config::plant::DynamicsKind;
use crate::tasks::executor::episode_moved;
use crate::{judging, setup};

/// Perturbed rollouts that judge an answer.
pub const N_PERTURBED: u64 = 20;
/// A first success by this rollout is an early one.
const EARLY: u64 = 45;
/// Streams of random numbers beyond those of the rollouts: worlds to judge in, worlds to learn in.
pub const JUDGING: u64 = 1 << 32;
pub const LEARNING: u64 = 2 << 32;
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
    dynamics: DynamicsKind,
}

const PLAIN: Method = Method {
    name: "",
    config: |_| {},
    perturbed: false,
    wrong_mass: false,
    dynamics: DynamicsKind::Multibody,
};

/// The default of `skillet learn pancake`.
const DEFAULT: Method = Method { name: "demonstration", ..PLAIN };

/// The default in both simulations.
const DYNAMICS: &[Method] = &[
    Method { name: "multibody", ..PLAIN },
    Method { name: "split", dynamics: DynamicsKind::Split, ..PLAIN },
];

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

/// The default without what makes its stiffness vary: two factors for the whole movement, no pay for
/// compliance, draws only.
pub fn uniform(config: &mut LearnerConfig) {
    config.exploration.grows = false;
    config.exploration.stiffness = StiffnessKind::Uniform;
    config.compliance = ComplianceConfig::off();
    let power = &mut config.search.power;
    (power.mean_every, power.candidates) = (0, 1);
    (power.success_rate, power.fewer_elites) = (0.0, false);
}

/// The default search on all parameters.
fn white(config: &mut LearnerConfig) {
    config.exploration.kind = ExplorationKind::White;
}

/// Reward and search of the paper, with the settings that suit them best.
fn paper(config: &mut LearnerConfig) {
    white(config);
    config.reward.kind = RewardKind::Paper;
    config.compliance = ComplianceConfig::off();
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
        mean_every: 0,
        candidates: 1,
        success_rate: 0.0,
        fewer_elites: false,
        ..PowerConfig::default()
    };
}

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    run_method(&DEFAULT, seed)
}

pub fn run_variants(seed: u64) -> Result<Vec<Sample>> {
    run_methods(VARIANTS, seed)
}

pub fn run_dynamics(seed: u64) -> Result<Vec<Sample>> {
    run_methods(DYNAMICS, seed)
}

fn run_methods(methods: &[Method], seed: u64) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    for method in methods {
        samples.extend(run_method(method, seed)?);
    }
    Ok(samples)
}

fn run_method(method: &Method, seed: u64) -> Result<Vec<Sample>> {
    let mut config = Config::default();
    config.learner.seed = seed;
    config.plant.dynamics = method.dynamics;
    (method.config)(&mut config.learner);
    let bench = Bench::new(config, method.wrong_mass)?;
    let world = |rollout| match method.perturbed {
        true => bench.perturbed(seed, LEARNING + rollout),
        false => bench.world,
    };
    let (executed, answer) = learn(&bench, world)?;
    let mut samples = summary(method.name, &executed);
    let robust = bench.robustness(&answer, |n| bench.perturbed(seed, JUDGING + n))?;
    samples.push(Sample::mean(method.name, "robustness", robust));
    Ok(samples)
}

/// When the first success came, and how often the last rollouts succeeded; executions of the mean apart.
pub fn summary(name: &str, executed: &[Executed]) -> Vec<Sample> {
    let first = executed.iter().find(|executed| executed.trial.success);
    let first = first.map(|executed| executed.trial.rollout);
    let late = &executed[executed.len().saturating_sub(LATE_TRIALS)..];
    let rate = |of: &dyn Fn(&Executed) -> bool| {
        let chosen: Vec<_> = late.iter().filter(|executed| of(executed)).collect();
        let n = chosen.iter().filter(|executed| executed.trial.success).count();
        (!chosen.is_empty()).then(|| n as f64 / chosen.len() as f64)
    };
    let all = rate(&|_| true).unwrap_or(0.0);
    let mut samples = vec![
        Sample::median(name, "first success", first.map_or(f64::INFINITY, |first| first as f64)),
        Sample::rate(name, "success by 100", first.is_some()),
        Sample::rate(name, "success by 45", first.is_some_and(|first| first <= EARLY)),
        Sample::mean(name, "success in the last 20", all),
        Sample::median(name, "success in the last 20, median", all),
        Sample::rate(name, "success in the last 20 below half", all < 0.5),
    ];
    for (metric, is_mean) in [("of these, draws", false), ("of these, means", true)] {
        let rate = rate(&|executed: &Executed| executed.is_mean == is_mean);
        samples.extend(rate.map(|rate| Sample::mean(name, metric, rate)));
    }
    samples
}

/// A problem and the θ a search came to.
pub type Answer = (Problem, DVector<f64>);

/// Measures, success and reward of a rollout.
pub type Judged = (Measures, bool, f64);

/// What was executed, and the search's answer; `world` gives that of each rollout.
pub fn learn(
    bench: &Bench,
    world: impl Fn(u64) -> PancakeConfig,
) -> Result<(Vec<Executed>, Answer)> {
    learn_by(bench, |problem, rollout, theta| bench.rollout(problem, theta, &world(rollout)))
}

/// The same, where `execute` runs θ as a rollout of that number.
pub fn learn_by(
    bench: &Bench,
    mut execute: impl FnMut(&Problem, u64, &DVector<f64>) -> Result<Came>,
) -> Result<(Vec<Executed>, Answer)> {
    let config = &bench.config.learner;
    let problem = Problem::new(config, &setup::demonstrations(&bench.config)?)?
        .with_prediction(config, bench.judge.predictor());
    let mut search: Box<dyn Search> = problem.search(config);
    let executed =
        session(&mut *search, config.rollouts, |rollout, theta| execute(&problem, rollout, theta))?;
    let mean = search.mean().clone();
    Ok((executed, (problem, mean)))
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
    pub fn new(mut config: Config, wrong_mass: bool) -> Result<Bench> {
        if wrong_mass {
            hold_stiffly(&mut config);
        }
        let (arm, world) = (setup::arm(&config)?, config.plant.world(config.controller.period_s()));
        let model = if wrong_mass { light_pan(&config)? } else { setup::arm(&config)? };
        let judge = judging::judge(&config)?;
        Ok(Bench { config, arm, model, world, judge })
    }

    /// With another arm, and another one that the controller takes it for.
    pub fn with_arm(self, arm: ArmModel, model: ArmModel) -> Bench {
        Bench { arm, model, ..self }
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

    /// The share of successes of an answer in some worlds.
    pub fn robustness(
        &self,
        (problem, theta): &Answer,
        world: impl Fn(u64) -> PancakeConfig,
    ) -> Result<f64> {
        share(N_PERTURBED, |draw| Ok(self.rollout(problem, theta, &world(draw))?.success))
    }

    /// What θ comes to in `world`.
    pub fn rollout(
        &self,
        problem: &Problem,
        theta: &DVector<f64>,
        world: &PancakeConfig,
    ) -> Result<Came> {
        self.rollout_on(problem, theta, &mut self.plant(world))
    }

    pub fn plant(&self, world: &PancakeConfig) -> PancakePlant {
        PancakePlant::new(&self.arm, &self.config.plant.start_posture(), world)
    }

    /// The same on a plant of one's own.
    pub fn rollout_on<P: Plant>(
        &self,
        problem: &Problem,
        theta: &DVector<f64>,
        plant: &mut P,
    ) -> Result<Came> {
        Ok(self.came(&self.judged_on(problem, theta, plant)?))
    }

    /// What the search is told of it.
    pub fn came(&self, (measures, success, reward): &Judged) -> Came {
        let measured = measured(self.config.learner.search.targets(), measures);
        Came { success: *success, reward: *reward, measured }
    }

    /// θ on a plant of one's own, with all that was measured.
    pub fn judged_on<P: Plant>(
        &self,
        problem: &Problem,
        theta: &DVector<f64>,
        plant: &mut P,
    ) -> Result<Judged> {
        let records = self.records(problem, theta, plant)?;
        let policy = self.policy(problem, theta);
        Ok(self.judge.judge(&policy, &EpisodeHeader::default(), &records)?)
    }

    pub fn policy(&self, problem: &Problem, theta: &DVector<f64>) -> PolicyMsg {
        problem.decode(theta, Default::default())
    }

    /// Records of the policy θ on `plant`.
    pub fn records<P: Plant>(
        &self,
        problem: &Problem,
        theta: &DVector<f64>,
        plant: &mut P,
    ) -> Result<Vec<TickRecord>> {
        self.records_moved(problem, theta, plant, &PostureMove::NONE)
    }

    /// The same with the posture moved.
    pub fn records_moved<P: Plant>(
        &self,
        problem: &Problem,
        theta: &DVector<f64>,
        plant: &mut P,
        posture: &PostureMove,
    ) -> Result<Vec<TickRecord>> {
        let policy = self.policy(problem, theta);
        let (q0, config) = (self.config.plant.start_posture(), &self.config.controller);
        let referee = Referee::Toss(Toss::new(&TossConfig::default()));
        let mut controlled = Controlled { model: &self.model, plant, q0, referee };
        Ok(episode_moved(&mut controlled, config, &policy, posture)?.1)
    }
}

/// The share of successes of `n` perturbed rollouts, each by its number.
pub fn share(n: u64, mut succeeds: impl FnMut(u64) -> Result<bool>) -> Result<f64> {
    let mut successes = 0;
    for draw in 0..n {
        successes += u64::from(succeeds(draw)?);
    }
    Ok(successes as f64 / n as f64)
}

/// With less the wrist would sag so far under what a model does not know of that no rollout begins.
pub fn hold_stiffly(config: &mut Config) {
    let controller = &mut config.controller;
    (controller.posture_stiffness, controller.posture_damping) = (4000.0, 126.0);
}

/// The built-in arm with a part of its pan's mass.
fn light_pan(config: &Config) -> Result<ArmModel> {
    let urdf = scaled(&setup::arm_text(config)?, PAN_MASS, KNOWN_MASS)?;
    Ok(ArmModel::from_urdf(&urdf, &config.plant.tip)?)
}

/// Where the pan's mass stands in the URDF: after these two, one after the other.
pub const PAN_MASS: [&str; 2] = ["<link name=\"pan\">", "<mass value=\""];

/// A URDF in which the number after `place` is multiplied by `factor`.
pub fn scaled(urdf: &str, [place, key]: [&str; 2], factor: f64) -> Result<String> {
    let (before, after) = urdf.split_once(place).with_context(|| format!("no {place}"))?;
    let (head, rest) = after.split_once(key).with_context(|| format!("no {key}"))?;
    let (number, tail) = rest.split_once('"').context("the number does not end")?;
    let number = factor * number.parse::<f64>().context("no number")?;
    Ok(format!("{before}{place}{head}{key}{number}\"{tail}"))
}
