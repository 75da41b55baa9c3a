//! Sec. 4.2, second experiment: table skittles.

use anyhow::Context;
use learner::reward::RewardKind;
use nalgebra::Vector2;
use physics::skittles::{BOX, SkittlesConfig, Throw};
use search::Method;

use super::{Task, World};
use crate::config::Config;
use crate::draw::plot::Axis;
use crate::report::{Pictures, Plane};

pub const TASK: Task = Task {
    name: "skittles",
    about: "Swing a ball around a post into a skittle (Sec. 4.2, second experiment)",
    world: World::Action(|config| Box::new(world(config))),
    configure,
    check: |config| world(config).validate().context("task.target_m"),
    has_target: true,
    options: &[],
    action_units: &["_rad", "_rad_s"],
    success: None,
    pictures,
};

fn world(config: &Config) -> SkittlesConfig {
    SkittlesConfig { target: config.task.target_m, ..Default::default() }
}

fn configure(config: &mut Config) {
    let learner = &mut config.learner;
    learner.rollouts = 200;
    learner.action.start = vec![0.0, 7.5];
    learner.search.method = Method::Regions;
    learner.action.min = BOX.0.to_vec();
    learner.action.max = BOX.1.to_vec();
    learner.reward.kind = RewardKind::Distance;
}

fn pictures(config: &Config) -> Pictures {
    let (world, lambda) = (world(config), config.learner.reward.lambda);
    let distance = move |theta: &Vector2<f64>| {
        world.fly(&Throw { alpha: theta.x, alpha_dot: theta.y }).distance_m
    };
    let axis = |i: usize, label| Axis { label, min: BOX.0[i], max: BOX.1[i] };
    Pictures::Plane(Plane {
        x: axis(0, "α rad"),
        y: axis(1, "α̇ rad/s"),
        reward: Box::new(move |theta| (-lambda * distance(theta)).exp()),
        max: 1.0,
    })
}
