//! Compliance beside a table: the cup of `ball-in-a-cup` catches on its edge as it dips for the ball.
//!
//! The table was fixed before any result was seen. Its edge stands under the outer dip of the
//! demonstration, whose lowest point is [`DIP_M`]; half of the rollouts that are learnt from have it in the
//! way, and it is judged by twenty heights. Phases have no part in it: a swing has several peaks.

use anyhow::Result;
use learner::LearnerConfig;
use learner::compliance::ComplianceConfig;
use learner::exploration::StiffnessKind;
use learner::problem::Problem;
use nalgebra::DVector;
use rand::RngExt;
use rt_controller::run::Controlled;
use search::normals::stream;
use search::power::PowerConfig;

use super::Sample;
use super::disturbance::{Disturbed, Table};
use super::pancake::{JUDGING, LEARNING, N_PERTURBED, share, summary};
use super::runs::session;
use crate::config::Config;
use crate::config::plant::DynamicsKind;
use crate::tasks::ArmWorld;
use crate::tasks::executor::episode;
use crate::{judging, setup};

/// The edge, m from the arm's foot, and the lowest point of the demonstration beyond it, m.
const EDGE_X_M: f64 = 0.68;
const DIP_M: f64 = 0.769;
/// How far above that the table's surface lies, m.
const HEIGHTS_M: [f64; 2] = [0.0, 0.02];
/// The height of a table that is not there, m.
const OUT_OF_THE_WAY: f64 = f64::NEG_INFINITY;
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
    let judge = judging::judge(&config)?;
    let ArmWorld { model, plant, q0, referee, .. } = (config.task()?.arm()?.world)(&config)?;
    let mut plant = Disturbed::new(plant, &model, Table::new(OUT_OF_THE_WAY, EDGE_X_M));

    let learner = &config.learner;
    let problem = Problem::new(learner, &setup::demonstrations(&config)?)?;
    // Success, reward, and the largest force of a table of that height, N.
    let mut rollout = |theta: &DVector<f64>, table_m: f64| -> Result<(bool, f64, f64)> {
        let policy = problem.decode(theta, Default::default());
        plant.by.height_m = table_m;
        let mut controlled = Controlled { model: &model, plant: &mut plant, q0, referee };
        let (header, records) = episode(&mut controlled, &config.controller, &policy)?;
        let (_, success, reward) = judge.judge(&policy, &header, &records)?;
        Ok((success, reward, plant.by.peak_n))
    };
    let mut search = problem.search(learner);
    let executed = session(&mut *search, learner.rollouts, |n, theta| {
        let (success, reward, _) = rollout(theta, to_learn_from(seed, n))?;
        Ok((success, reward))
    })?;
    let mean = search.mean();

    let mut samples = summary(kind.name, &executed);
    let free = rollout(mean, OUT_OF_THE_WAY)?.0;
    samples.push(Sample::rate(kind.name, "answer without a table", free));
    let mut peak = 0.0f64;
    let robust = share(N_PERTURBED, |n| {
        let (success, _, force) = rollout(mean, height(seed, JUDGING + n))?;
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

fn to_learn_from(seed: u64, rollout: u64) -> f64 {
    let draw = LEARNING + rollout;
    let has_table = stream(seed, draw + (1 << 40)).random_bool(SHARE);
    if has_table { height(seed, draw) } else { OUT_OF_THE_WAY }
}
