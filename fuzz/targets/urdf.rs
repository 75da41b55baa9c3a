//! An arm as URDF: what is accepted can be computed with.
#![no_main]

use libfuzzer_sys::fuzz_target;
use physics::arm::{ArmModel, JointVector, dynamics, kinematics};

fuzz_target!(|text: &str| {
    if let Ok(model) = ArmModel::from_urdf(text, "pan") {
        assert!((1..=7).contains(&model.n_joints()));
        let bounds = model.limits();
        assert!((0..model.n_joints()).all(|i| bounds.q_min[i] < bounds.q_max[i]));
        let q = JointVector::zeros();
        let _ = kinematics::tip_pose(&model, &q);
        let _ = dynamics::mass_matrix(&model, &q);
        let _ = dynamics::gravity_torque(&model, &q);
    }
});
