//! What admission says of linear systems, and what those it admits do with the arm.

#![allow(non_snake_case)] // matrices

mod common;

use common::{controller, field, wam};
use nalgebra::Vector6;
use physics::ideal::IdealArm;
use physics::pancake::WAM7_START_POSTURE;
use physics::plant::Plant;
use rt_controller::ControllerConfig;
use rt_controller::admit::admission::admit;
use rt_controller::hot::policy::Policy;
use rt_controller::hot::rollout::Phase;
use rt_controller::hot::task_space::TaskState;
use shm_types::TASK_DIM;
use shm_types::episode::TickRecord;
use shm_types::policy::{
    ACTIVATION_STATE, ACTIVATION_TIME, ORIENTATION_SPHERE, OUTPUT_ACCELERATION, OUTPUT_VELOCITY,
    PolicyMsg, packed_index,
};

const ROW: usize = TASK_DIM;

fn refusal(message: PolicyMsg) -> Option<String> {
    let admitted = admit(&message.sealed(), &wam(), &ControllerConfig::default());
    admitted.err().map(|error| error.to_string())
}

#[test]
fn a_field_is_refused_with_system_eigenvalue_and_what_would_help() {
    assert_eq!(refusal(field()), None);
    type Break = fn(&mut PolicyMsg);
    let breaks: [(&[&str], Break); 14] = [
        (&["system 3: covariance", "eigenvalue"], |m| {
            m.systems[3].covariance[packed_index(1, 0)] = 5e-4;
        }),
        (&["system 0: covariance"], |m| m.systems[0].covariance[0] = 1e-9),
        (&["output = velocity"], |m| m.output = OUTPUT_ACCELERATION),
        (&["certificate has the eigenvalue", "-1.0"], |m| m.certificate[0] = -1.0),
        (&["certificate has the eigenvalue", "scaled"], |m| m.certificate[5] = 1e4),
        (&["system 2", "½ (PA + AᵀP)", "eigenvalue 1.000e0", "≺ 0"], |m| {
            m.systems[2].of_position[ROW + 1] = 1.0;
        }),
        (&["system 5: at the target", "offset = −of_position"], |m| {
            m.systems[5].offset[4] += 1e-3
        }),
        (&["system 1: of_velocity is not zero", "velocity"], |m| {
            m.systems[1].of_velocity[0] = -0.1
        }),
        (&["system 7: of_drive is not zero", "state"], |m| m.systems[7].of_drive[0] = 0.1),
        (&["system 0: of_position has the norm", "slower"], |m| {
            m.systems[0].of_position[0] = -1e3;
        }),
        (&["following is 600"], |m| m.following = 600.0),
        (&["target", "m from the shoulder"], |m| m.target[0] = 9.0),
        (&["system 4: center"], |m| m.systems[4].center[0] = f64::NAN),
        (&["system 6: following = 60", "more than 303.0"], |m| {
            let A = &mut m.systems[6].of_position;
            (A[4 * ROW + 5], A[5 * ROW + 4]) = (30.0, -30.0);
            let target = m.target;
            let row = |i: usize| -> f64 {
                let row = &m.systems[6].of_position[ROW * i..][..ROW];
                -row.iter().zip(target).map(|(a, x)| a * x).sum::<f64>()
            };
            let offsets = [row(4), row(5)];
            m.systems[6].offset[4..].copy_from_slice(&offsets);
        }),
    ];
    for (words, break_it) in breaks {
        let mut message = field();
        break_it(&mut message);
        let error = refusal(message).unwrap_or_else(|| panic!("{words:?} is admitted"));
        assert!(words.iter().all(|word| error.contains(word)), "{words:?}: {error}");
    }
}

/// The eigenvalues of A are −1 twice, but it leads away from the target first, as seen without P.
#[test]
fn a_certificate_may_be_any_metric() {
    let mut message = PolicyMsg { task_dim: 3, n_systems: 1, ..PolicyMsg::EMPTY };
    (message.activation, message.output, message.following) =
        (ACTIVATION_STATE, OUTPUT_VELOCITY, 50.0);
    let system = &mut message.systems[0];
    (0..3).for_each(|i| system.covariance[packed_index(i, i)] = 1.0);
    (0..3).for_each(|i| system.of_position[ROW * i + i] = -1.0);
    system.of_position[1] = 4.0;
    (0..3).for_each(|i| message.certificate[packed_index(i, i)] = 1.0);
    let plain = refusal(message).expect("not in this metric");
    assert!(plain.contains("eigenvalue 1.000e0"), "{plain}");
    message.certificate[packed_index(1, 1)] = 16.0;
    assert_eq!(refusal(message), None);
}

/// Four systems that each spiral nowhere: their eigenvalues are −10 and −50. Whatever their weights are, ẋ = f(x) comes to
/// rest. Followed with λ = 1 they push along the circle on all sides, and the motion opens.
#[test]
fn a_field_that_is_followed_too_slowly_is_refused_though_each_of_its_systems_comes_to_rest() {
    let mut message = PolicyMsg { task_dim: 3, n_systems: 4, ..PolicyMsg::EMPTY };
    (message.activation, message.output) = (ACTIVATION_STATE, OUTPUT_VELOCITY);
    (0..3).for_each(|i| message.certificate[packed_index(i, i)] = 1.0);
    for (k, system) in message.systems[..4].iter_mut().enumerate() {
        let (axis, side) = (k / 2, if k % 2 == 0 { 0.03 } else { -0.03 });
        system.center[axis] = side;
        (0..3).for_each(|i| system.covariance[packed_index(i, i)] = 9e-4);
        (0..3).for_each(|i| system.of_position[ROW * i + i] = -30.0);
        let coupling = if axis == 0 { 20.0 } else { -20.0 };
        (system.of_position[1], system.of_position[ROW]) = (coupling, coupling);
    }
    // How far from the target, 10 cm at first, after 15 s.
    let ends_at = |message: &PolicyMsg| {
        let law = Policy::new(message);
        let mut x = Vector6::new(0.1, 0.0, 0.0, 0.0, 0.0, 0.0);
        let mut xd = Vector6::zeros();
        for k in 0..15_000 {
            xd += law.command(k as f64 * 1e-3, &TaskState::at(x, xd)).xdd * 1e-3;
            x += xd * 1e-3;
        }
        x.norm()
    };
    message.following = 1.0;
    assert!(ends_at(&message) > 1.0, "{} m", ends_at(&message));
    let error = refusal(message).expect("it grows");
    assert!(error.contains("following = 1 s⁻¹ is too slow") && error.contains("50.0"), "{error}");
    message.following = 51.0;
    assert!(ends_at(&message) < 1e-3, "{} m", ends_at(&message));
    assert_eq!(refusal(message), None);
}

#[test]
fn on_the_sphere_the_target_is_where_rotation_is_zero() {
    let mut message = field();
    message.orientation = ORIENTATION_SPHERE;
    let error = refusal(message).expect("offsets count on rotation vectors of the target");
    assert!(error.contains("on the sphere with zeros"), "{error}");
    for system in &mut message.systems[..8] {
        system.offset[3..].fill(0.0);
    }
    assert_eq!(refusal(message), None);
}

/// Regression in time needs no certificate, and gains of accelerations are bounded as springs' are.
#[test]
fn what_time_drives_is_bounded_but_not_certified() {
    let mut message = PolicyMsg { task_dim: 3, n_systems: 1, ..PolicyMsg::EMPTY };
    (message.activation, message.output) = (ACTIVATION_TIME, OUTPUT_ACCELERATION);
    message.systems[0].covariance[0] = 0.01;
    message.systems[0].of_drive[0] = 0.3;
    assert_eq!(refusal(message), None);
    message.systems[0].of_position[0] = -6e4;
    assert!(refusal(message).expect("too stiff").contains("of_position has the norm 6.000e4"));
    message.systems[0].of_position[0] = 0.0;
    message.systems[0].of_velocity[0] = -2e3;
    assert!(refusal(message).expect("too strong").contains("of_velocity has the norm 2.000e3"));
}

#[test]
fn the_arm_follows_a_field_to_its_target() {
    let (model, config) = (wam(), ControllerConfig::default());
    let mut message = field();
    message.duration_s = 2.5;
    let policy = admit(&message.sealed(), &model, &config).unwrap();
    let mut arm = IdealArm::new(&model, &WAM7_START_POSTURE, config.period_s(), 0.01);
    let mut controller = controller(&model, &config);
    controller.start(&policy);
    let (mut record, mut speed) = (TickRecord::ZERO, 0.0_f64);
    while controller.phase() != Phase::Idle {
        arm.apply(&controller.tick(&arm.measure(), &mut record));
        arm.advance();
        assert_eq!(record.fault, 0, "at {} s", record.t_s);
        speed = speed.max(record.xd[0].abs());
    }
    for i in 0..6 {
        assert!((record.x[i] - message.target[i]).abs() < 5e-3, "coordinate {i}: {:?}", record.x);
    }
    assert!(speed > 0.03, "it moved: {speed} m/s");
}
