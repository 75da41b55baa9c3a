//! The arm, the policies and the cells that the tests of the loop share.
#![allow(dead_code, non_snake_case)] // each test file uses its own part; M is the mass matrix

pub mod faulty;
pub mod heap;
pub mod service;

use physics::arm::ArmModel;
use physics::pancake::WAM7_START_POSTURE;
use physics::referee::{Referee, Toss, TossConfig};
use rt_controller::ControllerConfig;
use rt_controller::hot::tick::Controller;
use shm_types::TASK_DIM;
use shm_types::policy::{ACTIVATION_STATE, OUTPUT_VELOCITY, PolicyMsg, packed_index};

pub fn wam() -> ArmModel {
    ArmModel::from_urdf(include_str!("../../../robots/wam7/wam7_pan.urdf"), "pan").unwrap()
}

/// Eight springs that shake the pan; `amplitude` in m.
pub fn message(amplitude: f64, stiffness: f64) -> PolicyMsg {
    let mut message = PolicyMsg { task_dim: 4, n_components: 8, ..PolicyMsg::EMPTY };
    message.duration_s = 1.4;
    message.damping = 2.0 * stiffness.sqrt();
    message.orientation_stiffness = 400.0;
    message.orientation_damping = 40.0;
    for (i, component) in message.components.iter_mut().take(8).enumerate() {
        component.center = 0.2 * i as f64;
        component.width = 0.1;
        let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
        component.attractor = [0.78, 0.0, 0.72 + sign * amplitude, sign * amplitude, 0.0, 0.0];
        for row in 0..4 {
            component.stiffness[packed_index(row, row)] = stiffness;
        }
    }
    message.sealed()
}

/// Eight systems of the state in six coordinates, on the way from the start posture's pan to a target
/// beside it; each turns otherwise.
pub fn field() -> PolicyMsg {
    let mut field = PolicyMsg { task_dim: 6, n_systems: 8, ..PolicyMsg::EMPTY };
    (field.activation, field.output, field.following) = (ACTIVATION_STATE, OUTPUT_VELOCITY, 60.0);
    field.duration_s = 1.4;
    (field.orientation_stiffness, field.orientation_damping) = (400.0, 40.0);
    let (start, target) = ([0.78, 0.0, 0.72, 0.0, 0.0, 0.0], [0.74, 0.05, 0.78, 0.1, 0.05, -0.1]);
    field.target = target;
    (0..6).for_each(|i| field.certificate[packed_index(i, i)] = 1.0);
    for (k, system) in field.systems[..8].iter_mut().enumerate() {
        let (way, turn) = (k as f64 / 7.0, 2.0 * (k as f64 / 7.0 - 0.5));
        for i in 0..6 {
            system.center[i] = start[i] + way * (target[i] - start[i]);
            system.covariance[packed_index(i, i)] = 4e-4;
            system.of_position[TASK_DIM * i + i] = -3.0;
        }
        // A rotation between x and z: it changes no distance from the target.
        (system.of_position[2], system.of_position[2 * TASK_DIM]) = (turn, -turn);
        for i in 0..6 {
            let row = &system.of_position[TASK_DIM * i..][..TASK_DIM];
            system.offset[i] = -row.iter().zip(target).map(|(a, x)| a * x).sum::<f64>();
        }
    }
    field.sealed()
}

/// The referee of a toss, as for the pancake.
pub fn referee() -> Referee {
    Referee::Toss(Toss::new(&TossConfig::default()))
}

pub fn controller<'a>(model: &'a ArmModel, config: &ControllerConfig) -> Controller<'a> {
    Controller::new(model, &WAM7_START_POSTURE, config, &referee())
}
