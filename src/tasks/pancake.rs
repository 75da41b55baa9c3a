//! The paper's main task (Sec. 3.1): an arm tosses a pancake and catches it after a half flip.

mod measurer;

use anyhow::Result;
use physics::pancake::PancakePlant;
use physics::pancake::outcome::OutcomeConfig;
use physics::referee::{Referee, Toss};

use super::{ArmWorld, Task, World};
use crate::config::Config;
use crate::report::Pictures;
use crate::setup;
use measurer::PancakeMeasurer;

pub const TASK: Task = Task {
    name: "pancake",
    about: "Toss a pancake and catch it after a half flip",
    world: World::Arm(world),
    configure: |_| {},
    check: |_| Ok(()),
    has_target: false,
    options: &[],
    action_units: &[],
    success: Some("caught flip"),
    pictures: |_| Pictures::Toss,
};

fn world(config: &Config) -> Result<ArmWorld> {
    let model = setup::arm(config)?;
    let q0 = config.plant.start_posture();
    let world = config.plant.world(config.controller.period_s());
    let outcome = OutcomeConfig { pan_radius: world.pan_radius, ..OutcomeConfig::default() };
    Ok(ArmWorld {
        plant: Box::new(PancakePlant::new(&model, &q0, &world)),
        referee: Referee::Toss(Toss::new(&outcome.toss)),
        measurer: Box::new(PancakeMeasurer {
            model: model.clone(),
            outcome,
            record_s: config.controller.period_s() * config.controller.record_stride() as f64,
        }),
        model,
        q0,
    })
}
