//! Checks that the motors are strong enough to hold the arm; otherwise nothing can be learnt.

use anyhow::{Context, Result, bail};
use physics::arm::{ArmModel, JointVector, dynamics};

use crate::config::Config;

/// Checks that the arm can hold itself and its pan in the start posture.
pub fn check_start(config: &Config, model: &ArmModel) -> Result<()> {
    check(model, &config.plant.start_posture()).context("plant.start_posture_rad cannot be held")
}

/// Checks that every motor is strong enough to hold the arm at `q`.
pub fn check(model: &ArmModel, q: &JointVector) -> Result<()> {
    let (needed, limits) = (dynamics::gravity_torque(model, q), model.limits().tau_max);
    let weak = |i: &usize| needed[*i].abs() > limits[*i];
    let weak: Vec<String> = (0..model.n_joints())
        .filter(weak)
        .map(|i| {
            let name = &model.joint_names()[i];
            format!("joint {name} needs {:.2} N·m, its limit is {} N·m", needed[i].abs(), limits[i])
        })
        .collect();
    if weak.is_empty() {
        return Ok(());
    }
    bail!(
        "{}: choose a posture that brings the load closer to the joint, a lighter pan, or a stronger \
         motor (effort in the URDF, or plant.torque_limits_nm)",
        weak.join("; ")
    )
}
