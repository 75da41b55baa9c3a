//! Compliance beside a table: the cup of `ball-in-a-cup` catches on its edge as it dips for the ball.
//!
//! The table was fixed before any result was seen. Its edge stands under the outer dip of the
//! demonstration, whose lowest point is [`DIP_M`]; half of the rollouts that are learnt from have it in the
//! way, and it is judged by twenty heights. Phases have no part in it: a swing has several peaks.

use anyhow::Result;
use learner::LearnerConfig;
use learner::compliance::ComplianceConfig;
use learner::exploration::StiffnessKind;
use learner::judge::Judge;
use learner::problem::Problem;
use nalgebra::DVector;
use physics::arm::ArmModel;
use rand::RngExt;
use rt_controller::run::Controlled;
use rt_controller::simulate::simulate;
use search::normals::stream;
use search::power::PowerConfig;
use shm_types::episode::{EpisodeHeader, MAX_RECORDS, TickRecord};

use super::Sample;
use super::disturbance::{Disturbed, Table};
use super::pancake::{JUDGING, LEARNING, share, summary};
use super::runs::session;
use crate::config::Config;
use crate::config::plant::DynamicsKind;
use crate::tasks::ArmWorld;
use crate::{judging, setup};

/// The edge, m from the arm's foot, and the lowest point of the demonstration beyond it, m.
const EDGE_X_M: f64 = 0.68;
const DIP_M: f64 = 0.769;
/// How far above that the table's surface lies, m.
const HEIGHTS_M: [f64; 2] = [0.0, 0.02];
/// The share of rollouts that are learnt from with the table in the way.
const SHARE: f64 = 0.5;

struct Kind {
    name: &'static str,
    config: fn(&mut LearnerConfig),
}

const KINDS: [Kind; 4] = [
    Kind { name: "uniform, unpaid", config: |_| {} },
    Kind { name: "fixed", config: |c| paid(c, StiffnessKind::Fixed) },
    Kind { name: "uniform", config: |c| paid(c, StiffnessKind::Uniform) },
    Kind { name: "components", config: |c| paid(c, StiffnessKind::Components) },
];

/// The task's settings with what the pancake's default has for compliance.
fn paid(config: &mut LearnerConfig, stiffness: StiffnessKind) {
    let default = PowerConfig::default();
    config.exploration.stiffness = stiffness;
    config.compliance = ComplianceConfig::default();
    let power = &mut config.search.power;
    (power.mean_every, power.candidates) = (default.mean_every, default.candidates);
    (power.success_rate, power.fewer_elites) = (default.success_rate, default.fewer_elites);
}

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    for kind in &KINDS {
        samples.extend(learn(kind, seed)?);
    }
    Ok(samples)
}

fn learn(kind: &Kind, seed: u64) -> Result<Vec<Sample>> {
    let mut config = Config::of_task("ball-in-a-cup");
    config.learner.seed = seed;
    config.plant.dynamics = DynamicsKind::Split;
    (kind.config)(&mut config.learner);
    let bench = Bench { arm: setup::arm(&config)?, judge: judging::judge(&config)?, config };

    let learner = &bench.config.learner;
    let problem = Problem::new(learner, &setup::demonstrations(&bench.config)?)?;
    let mut search = problem.search(learner);
    let executed = session(&mut *search, learner.rollouts, |rollout, theta| {
        let (success, reward, _) = bench.rollout(&problem, theta, to_learn_from(seed, rollout))?;
        Ok((success, reward))
    })?;
    let mean = search.mean().clone();

    let mut samples = summary(kind.name, &executed);
    let free = bench.rollout(&problem, &mean, None)?.0;
    samples.push(Sample::rate(kind.name, "answer without a table", free));
    let mut peak = 0.0f64;
    let robust = share(|n| {
        let table = Some(height(seed, JUDGING + n));
        let (success, _, force) = bench.rollout(&problem, &mean, table)?;
        peak = peak.max(force);
        Ok(success)
    })?;
    samples.push(Sample::mean(kind.name, "success at the table", robust));
    samples.push(Sample::median(kind.name, "largest force of the table, N", peak));
    Ok(samples)
}

/// Height of a table, m.
fn height(seed: u64, draw: u64) -> f64 {
    DIP_M + stream(seed, draw).random_range(HEIGHTS_M[0]..=HEIGHTS_M[1])
}

fn to_learn_from(seed: u64, rollout: u64) -> Option<f64> {
    let draw = LEARNING + rollout;
    let has_table = stream(seed, draw + (1 << 40)).random_bool(SHARE);
    has_table.then(|| height(seed, draw))
}

struct Bench {
    config: Config,
    arm: ArmModel,
    judge: Judge,
}

impl Bench {
    /// Success, reward, and the largest force of the table of that height, N.
    fn rollout(
        &self,
        problem: &Problem,
        theta: &DVector<f64>,
        table_m: Option<f64>,
    ) -> Result<(bool, f64, f64)> {
        let policy = problem.decode(theta, Default::default());
        let world = (self.config.task()?.arm()?.world)(&self.config)?;
        let ArmWorld { plant, q0, referee, .. } = world;
        let table = Table::new(table_m.unwrap_or(f64::NEG_INFINITY), EDGE_X_M);
        let mut plant = Disturbed::new(plant, &self.arm, table);
        let mut controlled = Controlled { model: &self.arm, plant: &mut plant, q0, referee };
        let mut records = vec![TickRecord::ZERO; MAX_RECORDS];
        let done = simulate(&mut controlled, &self.config.controller, &policy, &mut records)?;
        records.truncate(done.n_records);
        let header = EpisodeHeader { fault: done.fault, ..EpisodeHeader::default() };
        let (_, success, reward) = self.judge.judge(&policy, &header, &records)?;
        Ok((success, reward, plant.by.peak_n))
    }
}
