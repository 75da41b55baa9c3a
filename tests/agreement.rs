//! Learner and controller do not know each other, so a few things are stated twice. They agree.

use learner::activation::policy_activations;
use learner::initial_policy::{InitialPolicyConfig, initial_policy};
use learner::{Demonstration, activation::Activation, parameters, reward};
use nalgebra::Vector6;
use physics::pancake::outcome::OutcomeConfig;
use rt_controller::admit::admission;
use rt_controller::hot::policy::Policy;
use rt_controller::hot::task_space::TaskState;

/// hᵢ, by which the learner fits attractors and the controller mixes them.
#[test]
fn activations_are_the_same_on_both_sides() {
    let text = include_str!("../demos/pancake.csv");
    let demonstration = Demonstration::parse("demos/pancake.csv", text).unwrap();
    for activation in [Activation::Time, Activation::Decay] {
        let config = InitialPolicyConfig { activation, ..Default::default() };
        let message = initial_policy(&demonstration, &config);
        let policy = Policy::new(&message);
        // Time drives them, wherever the tip is.
        let anywhere = TaskState::at(Vector6::zeros(), Vector6::zeros());
        for tick in 0..2000 {
            let t_s = f64::from(tick) * 1e-3;
            let ours = policy_activations(&message, t_s);
            let theirs = policy.activations(t_s, &anywhere);
            for (i, h) in ours.iter().enumerate() {
                assert!((h - theirs[i]).abs() < 1e-12, "{activation:?}, h{i} at {t_s} s");
            }
        }
    }
}

#[test]
fn what_the_search_can_propose_is_admitted() {
    let bounds = admission::STIFFNESS_MIN..=admission::STIFFNESS_MAX;
    for stiffness in [parameters::STIFFNESS_MIN, parameters::STIFFNESS_MAX] {
        assert!(bounds.contains(&stiffness), "{stiffness}");
    }
}

#[test]
fn exploits_are_the_same_to_the_world_and_to_the_reward() {
    let world = OutcomeConfig::default();
    assert_eq!(world.max_release_speed, reward::RELEASE_SPEED_MAX_M_S);
    assert_eq!(world.max_release_spin, reward::RELEASE_SPIN_MAX_RAD_S);
}
