//! An arm as URDF: what is accepted can be computed with.
#![no_main]

use libfuzzer_sys::fuzz_target;
use physics::arm::urdf::{chains, decode};
use physics::arm::{ArmModel, ArmSettings, JointVector, dynamics, kinematics};

fuzz_target!(|data: &[u8]| {
    let text = decode(data);
    let candidate = chains(&text).ok().and_then(|chains| chains.into_iter().next());
    let mut tips = vec![("pan".to_string(), ArmSettings::default())];
    tips.extend(
        candidate
            .map(|chain| (chain.tip, ArmSettings { base: chain.base, ..ArmSettings::default() })),
    );
    for (tip, settings) in tips {
        check(&text, &tip, &settings);
    }
});

fn check(text: &str, tip: &str, settings: &ArmSettings) {
    if let Ok(model) = ArmModel::load(text, tip, settings).map(|loaded| loaded.model) {
        assert!((1..=7).contains(&model.n_joints()));
        let bounds = model.limits();
        assert!((0..model.n_joints()).all(|i| bounds.q_min[i] < bounds.q_max[i]));
        let q = JointVector::zeros();
        let _ = kinematics::tip_pose(&model, &q);
        let _ = dynamics::mass_matrix(&model, &q);
        let _ = dynamics::gravity_torque(&model, &q);
    }
}
