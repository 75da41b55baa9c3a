//! The simulated arms against the arm's own inverse dynamics.

// Monogram notation.
#![allow(non_snake_case)]

mod common;

use common::{
    BOTH, LoneArm, OBLIQUE_ARM, moved, quintic, random_state, random_within, softness, wam_with_pan,
};
use physics::arm::dynamics::{bias, gravity_torque, mass_matrix, rnea};
use physics::arm::inverse_kinematics;
use physics::arm::{ArmModel, JointVector, kinematics};
use physics::pancake::WAM7_START_POSTURE;
use physics::plant::Dynamics;
use physics::rapier::{RapierArm, new_world};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const PERIOD_S: f64 = 1e-3;

/// Both arms' accelerations in `n` random states with random torques are right to 1e-4. The step is
/// tiny, so that what is left is the model and not the time discretisation.
fn check_acceleration(name: &str, model: &ArmModel, n: usize) {
    for dynamics in BOTH {
        let worst = worst_acceleration_error(dynamics, model, n);
        println!("{name}, {dynamics:?}: worst relative acceleration error {worst:.2e}");
        assert!(worst <= 1e-4, "{name}, {dynamics:?}: {worst:e}");
    }
}

fn worst_acceleration_error(dynamics: Dynamics, model: &ArmModel, n: usize) -> f64 {
    const DT_S: f64 = 1e-6;
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut worst: f64 = 0.0;
    for _ in 0..n {
        let (q, qd) = random_state(model, &mut rng);
        let tau = random_within(&model.limits().tau_max, &mut rng);
        let M = mass_matrix(model, &q).cholesky().unwrap();
        let expected = M.solve(&(tau - bias(model, &q, &qd)));

        let mut arm = LoneArm::new(dynamics, model, DT_S, &q, &qd);
        arm.step(&tau);
        let measured = (arm.state().1 - qd) / DT_S;
        let error = (measured - expected).norm() / expected.norm();
        assert!(error.is_finite());
        worst = worst.max(error);
    }
    worst
}

#[test]
fn acceleration_of_wam_with_pan_matches_newton_euler() {
    check_acceleration("WAM with pan", &wam_with_pan(), 200);
}

#[test]
fn acceleration_of_oblique_arm_matches_newton_euler() {
    check_acceleration("oblique arm", &ArmModel::from_urdf(OBLIQUE_ARM, "tool").unwrap(), 50);
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
    check_acceleration("arm with a massless frame", &vendor_arm(), 50);
}

#[test]
fn a_joint_without_stops_turns_past_half_a_turn() {
    let model = vendor_arm();
    let mut q0 = JointVector::zeros();
    q0[2] = 3.0;
    for dynamics in BOTH {
        let mut arm = LoneArm::new(dynamics, &model, PERIOD_S, &q0, &JointVector::zeros());
        for _ in 0..1000 {
            let (q, qd) = arm.state();
            let mut qdd = JointVector::zeros();
            qdd[2] = 2.0;
            arm.step(&rnea(&model, &q, &qd, &qdd));
        }
        let turned = arm.state().0[2];
        assert!((turned - 4.0).abs() < 0.05, "{dynamics:?}: {turned}");
    }
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
    for dynamics in BOTH {
        let q0 = WAM7_START_POSTURE;
        let mut arm = LoneArm::new(dynamics, &model, PERIOD_S, &q0, &JointVector::zeros());
        let mut overshoot: f64 = f64::NEG_INFINITY;
        for _ in 0..1000 {
            let mut tau = gravity_torque(&model, &arm.state().0);
            tau[4] += 2.0;
            arm.step(&tau);
            overshoot = overshoot.max(arm.state().0[4] - model.limits().q_max[4]);
        }
        println!("{dynamics:?}: joint 5 goes {overshoot:.1e} rad beyond its stop");
        assert!(overshoot.abs() < 1e-3);
        assert!((arm.state().0[4] - model.limits().q_max[4]).abs() < 1e-3);
    }
}

/// An arm thrown into its stops, several joints at once, stays within them and loses energy there.
#[test]
fn hard_stops_take_energy_and_give_none() {
    let model = wam_with_pan();
    let limits = *model.limits();
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    for (dynamics, most_beyond) in BOTH.into_iter().zip([0.05, 1e-12]) {
        for _ in 0..20 {
            let (q, qd) = random_state(&model, &mut rng);
            let mut arm = LoneArm::new(dynamics, &model, PERIOD_S, &q, &qd);
            let start = energy(&model, &q, &qd);
            let mut most = f64::NEG_INFINITY;
            for _ in 0..2000 {
                arm.step(&JointVector::zeros());
                let (q, qd) = arm.state();
                let beyond = (q - limits.q_max).max().max((limits.q_min - q).max());
                assert!(beyond < most_beyond, "{dynamics:?}: {beyond} rad beyond a stop");
                most = most.max(energy(&model, &q, &qd) - start);
            }
            let (q, qd) = arm.state();
            let left = energy(&model, &q, &qd) - start;
            assert!(most < 1.0 && left < 0.0, "{dynamics:?}: {most} J more, {left} J at the end");
        }
    }
}

/// If a joint is pressed against its stop, the others move as if it were welded.
#[test]
fn a_joint_on_its_stop_is_as_good_as_welded() {
    let model = wam_with_pan();
    let mut q = WAM7_START_POSTURE;
    q[4] = model.limits().q_max[4];
    let mut tau = gravity_torque(&model, &q);
    tau[4] += 5.0;
    tau[5] += 1.0;
    let M = mass_matrix(&model, &q).remove_row(4).remove_column(4);
    let rest = (tau - gravity_torque(&model, &q)).remove_row(4);
    let expected = M.cholesky().unwrap().solve(&rest);
    for dynamics in BOTH {
        let mut arm = LoneArm::new(dynamics, &model, 1e-5, &q, &JointVector::zeros());
        // Rapier notices a stop once it is passed.
        (0..3).for_each(|_| arm.step(&tau));
        let before = arm.state().1;
        arm.step(&tau);
        let qdd = ((arm.state().1 - before) / 1e-5).remove_row(4);
        println!("{dynamics:?}: {qdd:.4?}, {expected:.4?}");
        assert!((qdd - expected).amax() < 2e-2 * expected.amax(), "{dynamics:?}");
    }
}

/// J: potential and kinetic.
fn energy(model: &ArmModel, q: &JointVector, qd: &JointVector) -> f64 {
    let height: f64 = kinematics::body_poses(model, q)
        .iter()
        .zip(model.bodies())
        .map(|(X_WB, body)| body.mass * 9.81 * (X_WB * nalgebra::Point3::from(body.p_BBcm)).z)
        .sum();
    height + 0.5 * (mass_matrix(model, q) * qd).dot(qd)
}

#[test]
fn swing_keeps_its_energy() {
    // Rapier's default joint damping would take 1.3 J.
    let model = wam_with_pan();
    let mut q0 = JointVector::zeros();
    q0[1] = 0.3;
    q0[3] = 1.5;
    let start = energy(&model, &q0, &JointVector::zeros());
    // The multibody is integrated to first order, the other to second.
    for (dynamics, share) in BOTH.into_iter().zip([0.02, 2e-5]) {
        let mut arm = LoneArm::new(dynamics, &model, PERIOD_S, &q0, &JointVector::zeros());
        let mut worst: f64 = 0.0;
        // Short enough to stay clear of the joint stops, which do take energy.
        for _ in 0..250 {
            arm.step(&JointVector::zeros());
            let (q, qd) = arm.state();
            worst = worst.max((energy(&model, &q, &qd) - start).abs());
        }
        let (q, qd) = arm.state();
        let kinetic = 0.5 * (mass_matrix(&model, &q) * qd).dot(&qd);
        println!("{dynamics:?}: energy drifts {worst:.6} J at {kinetic:.1} J of motion");
        assert!(worst < share * kinetic, "{dynamics:?}: {worst} J of {kinetic} J");
    }
}

#[test]
fn computed_torque_tracks_a_fast_move() {
    const DURATION_S: f64 = 0.5;
    let model = wam_with_pan();
    let q0 = WAM7_START_POSTURE;
    let solve = |y: f64| inverse_kinematics::solve(&model, &moved(&model, &q0, [0.0, y, 0.0]), &q0);
    let (from, to) = (solve(-0.2).unwrap(), solve(0.2).unwrap());

    for dynamics in BOTH {
        let mut arm = LoneArm::new(dynamics, &model, PERIOD_S, &from, &JointVector::zeros());
        let mut squares = 0.0;
        let mut peak_tau = JointVector::zeros();
        for tick in 0..500 {
            let (s, sd, sdd) = quintic(tick as f64 * PERIOD_S / DURATION_S);
            let q_d = from + (to - from) * s;
            let qd_d = (to - from) * (sd / DURATION_S);
            let qdd_d = (to - from) * (sdd / DURATION_S.powi(2));
            let (q, qd) = arm.state();
            let error = kinematics::tip_pose(&model, &q).translation.vector
                - kinematics::tip_pose(&model, &q_d).translation.vector;
            squares += error.norm_squared();

            let qdd_c = qdd_d + (qd_d - qd) * 40.0 + (q_d - q) * 400.0;
            let tau = rnea(&model, &q, &qd, &qdd_c);
            peak_tau = peak_tau.zip_map(&tau, |peak: f64, t| peak.max(t.abs()));
            arm.step(&tau);
        }
        let rms_mm = (squares / 500.0).sqrt() * 1e3;
        println!("{dynamics:?}: 0.4 m in 0.5 s: {rms_mm:.3} mm RMS, peak torques {peak_tau:.1?}");
        let reached = kinematics::tip_pose(&model, &arm.state().0).translation.vector.y;
        assert!((reached - 0.2).abs() < 1e-3);
        assert!(rms_mm <= 0.2, "{dynamics:?}: {rms_mm} mm");
    }
}
