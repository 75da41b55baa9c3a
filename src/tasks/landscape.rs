//! Sec. 4.2, first experiment: the highest of three hills.

use learner::reward::RewardKind;
use physics::{action, landscape};
use search::Method;

use super::{Task, World};
use crate::config::Config;
use crate::draw::plot::Axis;
use crate::report::{Pictures, Plane};

pub const TASK: Task = Task {
    name: "landscape",
    about: "Find the highest of three hills (Sec. 4.2, first experiment)",
    world: World::Action(|_| Box::new(action::Landscape)),
    configure,
    check: |_| Ok(()),
    has_target: false,
    options: &[],
    action_units: &[],
    success: None,
    pictures,
};

fn configure(config: &mut Config) {
    let learner = &mut config.learner;
    learner.rollouts = 200;
    learner.action.start = vec![8.0, 2.0];
    learner.search.method = Method::Tempered;
    learner.reward.kind = RewardKind::Value;
}

fn pictures(_: &Config) -> Pictures {
    let axis = |label| Axis { label, min: -1.0, max: 11.0 };
    Pictures::Plane(Plane {
        x: axis("Θ₁"),
        y: axis("Θ₂"),
        reward: Box::new(landscape::height),
        max: landscape::PEAK_VALUE,
    })
}
