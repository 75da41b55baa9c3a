//! The selected policy in other worlds: another pancake, or one that lies elsewhere.

use anyhow::{Context, Result};
use learner::judge::Judge;
use physics::arm::ArmModel;
use physics::pancake::outcome::OutcomeConfig;
use physics::pancake::{PancakeConfig, PancakePlant};
use physics::referee::{Referee, Toss};
use rt_controller::run::Controlled;
use shm_types::policy::PolicyMsg;

use crate::config::Config;
use crate::report::{Attempt, Circumstance, Robustness};
use crate::tasks::executor::episode;
use crate::{judging, setup};

/// What is varied, one thing at a time.
const VARIED: [Varied; 4] = [
    Varied {
        name: "pancake starts forward of the centre",
        unit: "cm",
        values: [-2.0, -1.0, 1.0, 2.0],
        apply: |world, cm| world.pancake_offset[0] += 0.01 * cm,
    },
    Varied {
        name: "pancake starts left of the centre",
        unit: "cm",
        values: [-2.0, -1.0, 1.0, 2.0],
        apply: |world, cm| world.pancake_offset[1] += 0.01 * cm,
    },
    Varied {
        name: "mass of the pancake",
        unit: "×",
        values: [0.5, 0.75, 1.5, 2.0],
        apply: |world, factor| world.pancake_mass *= factor,
    },
    Varied {
        name: "friction",
        unit: "×",
        values: [0.5, 0.75, 1.5, 2.0],
        apply: |world, factor| world.friction *= factor,
    },
];

struct Varied {
    name: &'static str,
    unit: &'static str,
    values: [f64; 4],
    apply: fn(&mut PancakeConfig, f64),
}

/// Executes `policy` in each of the worlds.
///
/// # Errors
/// The world of the session is not simulated here, or no longer loads.
pub fn measure(config: &Config, policy: &PolicyMsg, name: String) -> Result<Robustness> {
    let bench = Bench {
        config,
        policy,
        model: setup::arm(config)?,
        judge: judging::judge(config)?,
        world: config.plant.world(config.controller.period_s()),
    };
    let as_learnt = bench.attempt(0.0, &bench.world)?;
    let circumstance = |varied: &Varied| -> Result<Circumstance> {
        let mut attempts = Vec::new();
        for value in varied.values {
            let mut world = bench.world;
            (varied.apply)(&mut world, value);
            attempts.push(bench.attempt(value, &world)?);
        }
        Ok(Circumstance { name: varied.name, unit: varied.unit, attempts })
    };
    let circumstances = VARIED.iter().map(circumstance).collect::<Result<_>>()?;
    Ok(Robustness { policy: name, as_learnt, circumstances })
}

struct Bench<'a> {
    config: &'a Config,
    policy: &'a PolicyMsg,
    model: ArmModel,
    judge: Judge,
    world: PancakeConfig,
}

impl Bench<'_> {
    fn attempt(&self, value: f64, world: &PancakeConfig) -> Result<Attempt> {
        let q0 = self.config.plant.start_posture();
        let mut plant = PancakePlant::new(&self.model, &q0, world);
        let outcome = OutcomeConfig { pan_radius: world.pan_radius, ..OutcomeConfig::default() };
        let referee = Referee::Toss(Toss::new(&outcome.toss));
        let mut controlled = Controlled { model: &self.model, plant: &mut plant, q0, referee };
        let (header, records) = episode(&mut controlled, &self.config.controller, self.policy)?;
        let judged = self.judge.judge(self.policy, &header, &records);
        let (_, success, reward) = judged.context("judging the selected policy")?;
        Ok(Attempt { value, success, reward })
    }
}
