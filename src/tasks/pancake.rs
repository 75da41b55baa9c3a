//! The paper's main task (Sec. 3.1): an arm tosses a pancake and catches it after a half flip.

mod measurer;
mod prediction;

use std::f64::consts::PI;

use anyhow::Result;
use learner::prediction::Predictor;
use physics::arm::kinematics;
use physics::pancake::PancakePlant;
use physics::pancake::outcome::OutcomeConfig;
use physics::referee::{Referee, Toss};
use search::aim::Target;

use super::camera::Camera;
use super::{ArmTask, ArmWorld, Task, World};
use crate::config::Config;
use crate::record::solids::{Solid, Solids};
use crate::report::{FLIP, Pictures};
use crate::setup;
use measurer::measurer;
use prediction::predict;

const IRON: [f64; 4] = [0.20, 0.21, 0.24, 1.0];
const DOUGH: [f64; 4] = [0.93, 0.72, 0.35, 1.0];

pub const TASK: Task = Task {
    name: "pancake",
    about: "Toss a pancake and catch it after a half flip",
    world: World::Arm(ArmTask {
        urdf: include_str!("../../robots/wam7/wam7_pan.urdf"),
        demonstration: include_str!("../../demos/pancake.csv"),
        world,
        predictor: Some(predictor),
        solids,
    }),
    configure,
    check: |_| Ok(()),
    has_target: false,
    options: &[],
    action_units: &[],
    success: Some(FLIP),
    pictures: |_| Pictures::Toss,
};

/// What was measured of a toss, for a search that learns from it: high enough to turn, not so high that it
/// bounces out, upside down within what a pan in motion forgives, and over the pan.
fn configure(config: &mut Config) {
    config.learner.search.aim.targets = vec![
        Target::new("apex_m", [0.28, 0.65], 0.12),
        Target::new("turn_rad", [-PI - 0.8, -PI + 1.3], 1.0).when("tossed"),
        Target::new("forward_m", [-0.09, 0.09], 0.1).when("tossed"),
    ];
}

fn world(config: &Config) -> Result<ArmWorld> {
    let model = setup::arm(config)?;
    let q0 = config.plant.start_posture();
    let world = config.plant.world(config.controller.period_s());
    let outcome = OutcomeConfig { pan_radius: world.pan_radius, ..OutcomeConfig::default() };
    Ok(ArmWorld {
        plant: Box::new(PancakePlant::new(&model, &q0, &world)),
        referee: Referee::Toss(Toss::new(&outcome.toss)),
        measurer: Box::new(measurer(Camera::new(&model, config.controller.record_s()), &outcome)),
        model,
        q0,
    })
}

/// From the pan at rest in the arm's start posture.
fn predictor(config: &Config) -> Result<Predictor> {
    let tip = kinematics::tip_pose(&setup::arm(config)?, &config.plant.start_posture());
    let (p, turn) = (tip.translation.vector, tip.rotation.scaled_axis());
    let start = [p.x, p.y, p.z, turn.y, turn.x, turn.z];
    Ok(Predictor::new(move |policy| predict(policy, start)))
}

fn solids(config: &Config) -> Solids {
    let world = config.plant.world(config.controller.period_s());
    let (rim, thickness) = (world.rim_height * world.rim_tilt.cos(), world.pan_thickness);
    let disc = Solid::Cone {
        bottom_radius: world.pan_radius,
        top_radius: world.pan_radius,
        height: thickness,
        z: -0.5 * thickness,
        color: IRON,
    };
    // A bowl: translucent where the pancake lies.
    let [r, g, b, _] = IRON;
    let bowl = Solid::Cone {
        bottom_radius: world.pan_radius,
        top_radius: world.pan_radius + world.rim_height * world.rim_tilt.sin(),
        height: rim,
        z: 0.5 * rim,
        color: [r, g, b, 0.35],
    };
    let pancake = Solid::Cone {
        bottom_radius: world.pancake_radius,
        top_radius: 0.92 * world.pancake_radius,
        height: world.pancake_thickness,
        z: 0.0,
        color: DOUGH,
    };
    Solids { tip: ("pan", vec![disc, bowl]), object: ("pancake", vec![pancake]), has_string: false }
}
