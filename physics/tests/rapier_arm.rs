//! The simulated arm against the arm's own inverse dynamics.

// Monogram notation.
#![allow(non_snake_case)]

mod common;

use common::{OBLIQUE_ARM, moved, quintic, random_state, random_within, softness, wam_with_pan};
use physics::arm::inverse_kinematics;
use physics::arm::{ArmModel, JointVector, dynamics, kinematics};
use physics::pancake::WAM7_START_POSTURE;
use physics::rapier::{RapierArm, new_world};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Largest relative error of the acceleration of `model` in `n` random states with random torques.
/// The step is tiny, so that what is left is the model and not the time discretisation.
fn worst_acceleration_error(model: &ArmModel, n: usize) -> f64 {
    const DT_S: f64 = 1e-6;
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut worst: f64 = 0.0;
    for _ in 0..n {
        let (q, qd) = random_state(model, &mut rng);
        let tau = random_within(&model.limits().tau_max, &mut rng);
        let M = dynamics::mass_matrix(model, &q).cholesky().unwrap();
        let expected = M.solve(&(tau - dynamics::bias(model, &q, &qd)));

        let mut world = new_world(&model.gravity(), DT_S, 4, softness());
        let arm = RapierArm::insert(&mut world, model, &q);
        arm.set_state(&mut world, &q, &qd);
        arm.set_torques(&mut world, &tau);
        world.step();
        let measured = (arm.qd(&world) - qd) / DT_S;
        let error = (measured - expected).norm() / expected.norm();
        assert!(error.is_finite());
        worst = worst.max(error);
    }
    worst
}

#[test]
fn acceleration_of_wam_with_pan_matches_newton_euler() {
    let worst = worst_acceleration_error(&wam_with_pan(), 200);
    println!("WAM with pan: worst relative acceleration error {worst:.2e}");
    assert!(worst <= 1e-4, "{worst:e}");
}

#[test]
fn acceleration_of_oblique_arm_matches_newton_euler() {
    let worst = worst_acceleration_error(&ArmModel::from_urdf(OBLIQUE_ARM, "tool").unwrap(), 50);
    println!("oblique arm: worst relative acceleration error {worst:.2e}");
    assert!(worst <= 1e-4, "{worst:e}");
}

/// As vendors write arms: a frame without mass between two joints, a joint without stops, a point mass.
fn vendor_arm() -> ArmModel {
    let frame = r#"<link name="frame"/><joint name="extra" type="continuous">
        <parent link="two"/><child link="frame"/><axis xyz="0 1 0"/>
        <limit effort="10" velocity="5"/></joint>
        <link name="point"><inertial><mass value="0.1"/>
        <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>
        <joint name="p" type="fixed"><origin xyz="0.3 0 0"/><parent link="three"/>
        <child link="point"/></joint></robot>"#;
    let joint = r#"rpy="1.2 0 0"/>
    <parent link="two"/>"#;
    assert!(OBLIQUE_ARM.contains(joint));
    let text = OBLIQUE_ARM.replace(joint, &joint.replace("\"two\"", "\"frame\""));
    ArmModel::from_urdf(&text.replace("</robot>", frame), "tool").unwrap()
}

#[test]
fn acceleration_of_an_arm_with_a_massless_frame_matches_newton_euler() {
    let worst = worst_acceleration_error(&vendor_arm(), 50);
    println!("arm with a massless frame: worst relative acceleration error {worst:.2e}");
    assert!(worst <= 1e-4, "{worst:e}");
}

#[test]
fn a_joint_without_stops_turns_past_half_a_turn() {
    let model = vendor_arm();
    let mut world = new_world(&model.gravity(), 1e-3, 4, softness());
    let mut q = JointVector::zeros();
    q[2] = 3.0;
    let arm = RapierArm::insert(&mut world, &model, &q);
    for _ in 0..1000 {
        let q = arm.q(&world);
        let mut qdd = JointVector::zeros();
        qdd[2] = 2.0;
        let qd = arm.qd(&world);
        arm.set_torques(&mut world, &dynamics::rnea(&model, &q, &qd, &qdd));
        world.step();
    }
    let turned = arm.q(&world)[2];
    assert!((turned - 4.0).abs() < 0.05, "{turned}");
}

#[test]
fn state_reads_back_as_set() {
    let model = wam_with_pan();
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let (q, qd) = random_state(&model, &mut rng);
    let mut world = new_world(&model.gravity(), 1e-3, 4, softness());
    let arm = RapierArm::insert(&mut world, &model, &WAM7_START_POSTURE);
    arm.set_state(&mut world, &q, &qd);
    assert!((arm.q(&world) - q).amax() < 1e-15);
    assert_eq!(arm.qd(&world), qd);
}

#[test]
fn joint_limits_are_rigid_and_do_not_rebound() {
    let model = wam_with_pan();
    let mut world = new_world(&model.gravity(), 1e-3, 4, softness());
    let arm = RapierArm::insert(&mut world, &model, &WAM7_START_POSTURE);
    let mut overshoot: f64 = f64::NEG_INFINITY;
    for _ in 0..1000 {
        let mut tau = dynamics::gravity_torque(&model, &arm.q(&world));
        tau[4] += 2.0;
        arm.set_torques(&mut world, &tau);
        world.step();
        overshoot = overshoot.max(arm.q(&world)[4] - model.limits().q_max[4]);
    }
    println!("joint 5 goes {overshoot:.1e} rad beyond its stop");
    assert!(overshoot.abs() < 1e-3);
    assert!((arm.q(&world)[4] - model.limits().q_max[4]).abs() < 1e-3);
}

#[test]
fn swing_keeps_its_energy() {
    // Rapier's default joint damping would take 1.3 J.
    let model = wam_with_pan();
    let energy = |q: &JointVector, qd: &JointVector| {
        let height: f64 = kinematics::body_poses(&model, q)
            .iter()
            .zip(model.bodies())
            .map(|(X_WB, body)| body.mass * 9.81 * (X_WB * nalgebra::Point3::from(body.p_BBcm)).z)
            .sum();
        height + 0.5 * (dynamics::mass_matrix(&model, q) * qd).dot(qd)
    };
    let mut world = new_world(&model.gravity(), 1e-3, 4, softness());
    let mut q0 = JointVector::zeros();
    q0[1] = 0.3;
    q0[3] = 1.5;
    let arm = RapierArm::insert(&mut world, &model, &q0);
    let start = energy(&q0, &JointVector::zeros());
    let mut worst: f64 = 0.0;
    // Short enough to stay clear of the joint stops, which do take energy.
    for _ in 0..250 {
        world.step();
        worst = worst.max((energy(&arm.q(&world), &arm.qd(&world)) - start).abs());
    }
    let q = arm.q(&world);
    let kinetic = 0.5 * (dynamics::mass_matrix(&model, &q) * arm.qd(&world)).dot(&arm.qd(&world));
    println!("free swing: energy drifts {worst:.4} J at {kinetic:.1} J of motion");
    assert!(worst < 0.02 * kinetic, "{worst} J of {kinetic} J");
}

#[test]
fn computed_torque_tracks_a_fast_move() {
    const DURATION_S: f64 = 0.5;
    let model = wam_with_pan();
    let q0 = WAM7_START_POSTURE;
    let solve = |y: f64| inverse_kinematics::solve(&model, &moved(&model, &q0, [0.0, y, 0.0]), &q0);
    let (from, to) = (solve(-0.2).unwrap(), solve(0.2).unwrap());

    let mut world = new_world(&model.gravity(), 1e-3, 4, softness());
    let arm = RapierArm::insert(&mut world, &model, &from);
    let mut squares = 0.0;
    let mut peak_tau = JointVector::zeros();
    for tick in 0..500 {
        let (s, sd, sdd) = quintic(tick as f64 * 1e-3 / DURATION_S);
        let q_d = from + (to - from) * s;
        let qd_d = (to - from) * (sd / DURATION_S);
        let qdd_d = (to - from) * (sdd / DURATION_S.powi(2));
        let (q, qd) = (arm.q(&world), arm.qd(&world));
        let error = kinematics::tip_pose(&model, &q).translation.vector
            - kinematics::tip_pose(&model, &q_d).translation.vector;
        squares += error.norm_squared();

        let qdd_c = qdd_d + (qd_d - qd) * 40.0 + (q_d - q) * 400.0;
        let tau = dynamics::rnea(&model, &q, &qd, &qdd_c);
        peak_tau = peak_tau.zip_map(&tau, |peak: f64, t| peak.max(t.abs()));
        arm.set_torques(&mut world, &tau);
        world.step();
    }
    let rms_mm = (squares / 500.0).sqrt() * 1e3;
    println!("0.4 m in 0.5 s: pan error {rms_mm:.3} mm RMS, peak torques {peak_tau:.1?}");
    let reached = kinematics::tip_pose(&model, &arm.q(&world)).translation.vector.y;
    assert!((reached - 0.2).abs() < 1e-3);
    assert!(rms_mm <= 0.2, "{rms_mm} mm");
}
