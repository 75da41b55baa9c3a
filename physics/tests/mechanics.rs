//! Laws that hold for every arm: derivatives, energy, power. Checked on the WAM with its pan and
//! on a three-joint arm with oblique axes.

// Monogram notation.
#![allow(non_snake_case)]

mod common;

use common::{OBLIQUE_ARM, moved, random_state, wam_with_pan};
use nalgebra::{Matrix4, Point3, Vector6};
use physics::arm::inverse_kinematics::{self, IkError};
use physics::arm::kinematics::{body_poses, tip_pose};
use physics::arm::{ArmModel, JointMatrix, JointVector, TipKinematics, dynamics};
use physics::pancake::WAM7_START_POSTURE;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn arms() -> [ArmModel; 2] {
    [wam_with_pan(), ArmModel::from_urdf(OBLIQUE_ARM, "tool").unwrap()]
}

/// Runs `check` on 50 seeded states of every arm.
fn for_random_states(check: impl Fn(&ArmModel, &JointVector, &JointVector)) {
    for model in arms() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..50 {
            let (q, qd) = random_state(&model, &mut rng);
            check(&model, &q, &qd);
        }
    }
}

/// Potential plus kinetic energy from body poses alone, J.
fn energy(model: &ArmModel, q: &JointVector, qd: &JointVector) -> f64 {
    let potential: f64 = body_poses(model, q)
        .iter()
        .zip(model.bodies())
        .map(|(X_WB, body)| {
            -body.mass * model.gravity().dot(&(X_WB * Point3::from(body.p_BBcm)).coords)
        })
        .sum();
    potential + 0.5 * (dynamics::mass_matrix(model, q) * qd).dot(qd)
}

#[test]
fn oblique_arm_has_three_joints_and_all_its_mass() {
    let model = ArmModel::from_urdf(OBLIQUE_ARM, "tool").unwrap();
    assert_eq!(model.n_joints(), 3);
    let mass: f64 = model.bodies().iter().map(|body| body.mass).sum();
    assert!((mass - 4.7).abs() < 1e-12);
}

#[test]
fn tip_pose_follows_the_urdf_transforms() {
    // The chain multiplied out with Rodrigues' formula about the URDF's own axes.
    let model = ArmModel::from_urdf(OBLIQUE_ARM, "tool").unwrap();
    let origin = |xyz: [f64; 3], [r, p, y]: [f64; 3]| -> Matrix4<f64> {
        Matrix4::new_translation(&xyz.into()) * Matrix4::from_euler_angles(r, p, y)
    };
    let turn = |axis: [f64; 3], q: f64| -> Matrix4<f64> {
        Matrix4::new_rotation(nalgebra::Vector3::from(axis).normalize() * q)
    };
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for _ in 0..20 {
        let (q, _) = random_state(&model, &mut rng);
        let expected = origin([0.1, 0.2, 0.3], [0.2, 0.1, -0.4])
            * origin([0.0, 0.0, 0.1], [0.1, 0.2, 0.3])
            * turn([0.3, -0.5, 0.8], q[0])
            * origin([0.1, 0.0, 0.3], [0.0, -0.6, 0.2])
            * turn([1.0, 0.0, 0.0], q[1])
            * origin([0.0, 0.25, 0.0], [1.2, 0.0, 0.0])
            * turn([0.0, 0.0, -2.0], q[2])
            * origin([0.2, 0.0, 0.0], [0.0, 0.9, 0.0]);
        assert!((tip_pose(&model, &q).to_homogeneous() - expected).amax() < 1e-12);
    }
}

#[test]
fn unused_joints_do_nothing() {
    let model = ArmModel::from_urdf(OBLIQUE_ARM, "tool").unwrap();
    let q = JointVector::from_element(0.4);
    let tau = dynamics::rnea(&model, &q, &q, &q);
    let M = dynamics::mass_matrix(&model, &q);
    let J = TipKinematics::new(&model, &q, &q).J;
    for i in 3..7 {
        assert_eq!(tau[i], 0.0);
        assert_eq!(M.column(i), JointMatrix::identity().column(i));
        assert_eq!(J.column(i), Vector6::zeros());
    }
}

#[test]
fn jacobian_and_its_derivative_match_finite_differences() {
    const H: f64 = 1e-6;
    let twist = |model: &ArmModel, q: &JointVector, qd: &JointVector| -> Vector6<f64> {
        let (before, after) = (tip_pose(model, &(q - qd * H)), tip_pose(model, &(q + qd * H)));
        let v = (after.translation.vector - before.translation.vector) / (2.0 * H);
        let w = (after.rotation * before.rotation.inverse()).scaled_axis() / (2.0 * H);
        Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z)
    };
    for_random_states(|model, q, qd| {
        let kinematics = TipKinematics::new(model, q, qd);
        assert!((kinematics.v - kinematics.J * qd).amax() < 1e-12);
        assert!((kinematics.v - twist(model, q, qd)).amax() < 1e-6);
        // At q̈ = 0 the tip accelerates with the change of J·q̇ along q + q̇·t.
        let velocity = |q: &JointVector| TipKinematics::new(model, q, qd).J * qd;
        let change = (velocity(&(q + qd * H)) - velocity(&(q - qd * H))) / (2.0 * H);
        assert!((kinematics.Jdot_qd - change).amax() < 1e-6);
    });
}

#[test]
fn joint_power_equals_tip_power() {
    // τ = JᵀF does the work F·v.
    for_random_states(|model, q, qd| {
        let kinematics = TipKinematics::new(model, q, qd);
        let wrench = Vector6::new(3.0, -5.0, 7.0, -0.2, 0.4, 0.6);
        let tau = kinematics.J.transpose() * wrench;
        assert!((tau.dot(qd) - wrench.dot(&kinematics.v)).abs() < 1e-12);
    });
}

#[test]
fn joint_power_equals_change_of_energy() {
    const H: f64 = 1e-5;
    for_random_states(|model, q, qd| {
        let mut qdd = JointVector::zeros();
        for i in 0..model.n_joints() {
            qdd[i] = 4.0 - 1.5 * i as f64;
        }
        let power = dynamics::rnea(model, q, qd, &qdd).dot(qd);
        let at = |t: f64| energy(model, &(q + qd * t + qdd * (0.5 * t * t)), &(qd + qdd * t));
        let change = (at(H) - at(-H)) / (2.0 * H);
        assert!((power - change).abs() < 1e-5 * (1.0 + power.abs()), "{power} W, {change} W");
    });
}

#[test]
fn newton_euler_equals_mass_matrix_and_bias() {
    for_random_states(|model, q, qd| {
        let mut qdd = JointVector::zeros();
        for i in 0..model.n_joints() {
            qdd[i] = 10.0 - 3.0 * i as f64;
        }
        let M = dynamics::mass_matrix(model, q);
        assert!(M.cholesky().is_some());
        let expected = M * qdd + dynamics::bias(model, q, qd);
        assert!((dynamics::rnea(model, q, qd, &qdd) - expected).amax() < 1e-11);
        let still = dynamics::bias(model, q, &JointVector::zeros());
        assert!((dynamics::gravity_torque(model, q) - still).amax() < 1e-12);
    });
}

#[test]
fn inverse_kinematics_finds_reachable_poses_within_limits() {
    let model = wam_with_pan();
    let q0 = WAM7_START_POSTURE;
    for by in [[0.0, 0.2, 0.0], [-0.1, -0.2, 0.1], [0.0, 0.0, 0.14], [0.0, 0.0, -0.08]] {
        let target = moved(&model, &q0, by);
        let q = inverse_kinematics::solve(&model, &target, &q0).unwrap();
        let X_WP = tip_pose(&model, &q);
        assert!((X_WP.translation.vector - target.translation.vector).norm() < 1e-7);
        assert!(X_WP.rotation.angle_to(&target.rotation) < 1e-7);
        for i in 0..7 {
            assert!((model.limits().q_min[i]..=model.limits().q_max[i]).contains(&q[i]));
        }
        assert_eq!(inverse_kinematics::solve(&model, &target, &q0), Ok(q));
    }
}

#[test]
fn inverse_kinematics_refuses_what_is_out_of_reach() {
    let model = wam_with_pan();
    let q0 = WAM7_START_POSTURE;
    let too_far = moved(&model, &q0, [1.0, 0.0, 0.0]);
    match inverse_kinematics::solve(&model, &too_far, &q0) {
        Err(IkError::OutOfReach { position_error_m, .. }) => assert!(position_error_m > 0.1),
        other => panic!("{other:?}"),
    }
    let nowhere = moved(&model, &q0, [f64::NAN, 0.0, 0.0]);
    assert_eq!(inverse_kinematics::solve(&model, &nowhere, &q0), Err(IkError::NotFinite));
}

#[test]
fn an_arm_with_few_joints_reaches_its_own_rounded_poses_and_no_others() {
    let model = ArmModel::from_urdf(OBLIQUE_ARM, "tool").unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(18);
    for _ in 0..50 {
        let (q, _) = random_state(&model, &mut rng);
        let mut target = tip_pose(&model, &q);
        target.translation.vector.iter_mut().for_each(|x| *x = (*x * 1e6).round() / 1e6);
        let turn = target.rotation.scaled_axis().map(|x| (x * 1e6).round() / 1e6);
        target.rotation = nalgebra::UnitQuaternion::from_scaled_axis(turn);
        let mut near = q;
        (0..model.n_joints()).for_each(|i| near[i] += 0.02);
        let found = inverse_kinematics::solve(&model, &target, &near).unwrap();
        assert!(
            (tip_pose(&model, &found).translation.vector - target.translation.vector).norm() < 1e-5
        );

        // A turn that the three joints cannot give alone.
        let J = TipKinematics::new(&model, &q, &JointVector::zeros()).J;
        let outside = (J * J.transpose()).symmetric_eigen().eigenvectors.column(0).into_owned();
        let smallest = (J.transpose() * outside).norm();
        if smallest < 1e-6 {
            let turn = nalgebra::Vector3::new(outside[3], outside[4], outside[5]) * 0.05;
            let mut away = tip_pose(&model, &q);
            away.translation.vector +=
                nalgebra::Vector3::new(outside[0], outside[1], outside[2]) * 0.05;
            away.rotation = nalgebra::UnitQuaternion::from_scaled_axis(turn) * away.rotation;
            let message = inverse_kinematics::solve(&model, &away, &q).unwrap_err().to_string();
            assert!(message.contains("3 joints controls only 3"), "{message}");
            assert!(!message.contains(" 0.0000 "), "{message}");
        }
    }
}

#[test]
fn start_posture_holds_the_pan_level() {
    let X_WP = tip_pose(&wam_with_pan(), &WAM7_START_POSTURE);
    let expected = nalgebra::Vector3::new(0.78, 0.0, 0.72);
    assert!((X_WP.translation.vector - expected).norm() < 1e-6);
    assert!(X_WP.rotation.angle() < 1e-6);
}
