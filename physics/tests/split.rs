//! The body that stands for an arm's tip, against the arm's own mobility.

// Monogram notation.
#![allow(non_snake_case)]

mod common;

use common::{OBLIQUE_ARM, random_state, random_within, softness, wam, wam_with_pan};
use nalgebra::{Matrix6, Vector3, Vector6};
use physics::arm::dynamics::mass_matrix;
use physics::arm::{ArmModel, JointVector, TipKinematics, kinematics};
use physics::rapier::new_world;
use physics::split::{Arm, Push, TipBody};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Λ⁻¹ = J·M⁻¹·Jᵀ of the tip, in the tip's axes.
fn mobility(model: &ArmModel, q: &JointVector) -> Matrix6<f64> {
    let tip = TipKinematics::new(model, q, &JointVector::zeros());
    let M = mass_matrix(model, q).cholesky().unwrap();
    let R = tip.X_WP.rotation.to_rotation_matrix().into_inner().transpose();
    let mut turn = Matrix6::zeros();
    turn.fixed_view_mut::<3, 3>(0, 0).copy_from(&R);
    turn.fixed_view_mut::<3, 3>(3, 3).copy_from(&R);
    let J = turn * tip.J;
    J * M.solve(&J.transpose())
}

/// A push of 1 N·s along z at `from` in the plane z = 0.
fn push_at(from: &Vector3<f64>) -> Vector6<f64> {
    let moment = from.cross(&Vector3::z());
    Vector6::new(0.0, 0.0, 1.0, moment.x, moment.y, moment.z)
}

#[test]
fn the_body_gives_way_along_the_normal_as_the_arm_does() {
    let oblique = ArmModel::from_urdf(OBLIQUE_ARM, "tool").unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for model in [wam_with_pan(), wam("wam7_cup.urdf", "cup"), oblique] {
        let mut worst: f64 = 0.0;
        for _ in 0..100 {
            let (q, _) = random_state(&model, &mut rng);
            let body = Arm::at(&q).free(&model, &JointVector::zeros(), 1e-9).body;
            assert!(body.mass > 0.0 && body.inertia.min() > 0.0, "{body:?}");
            let arm = mobility(&model, &q);
            let I = body.inertia_P().try_inverse().unwrap();
            for _ in 0..10 {
                let mut point = || {
                    let [x, y] = [(); 2].map(|()| rng.random_range(-0.2..0.2));
                    Vector3::new(x, y, 0.0)
                };
                let (at, seen) = (point(), point());
                let of_arm = push_at(&seen).dot(&(arm * push_at(&at)));
                let (at, seen) = (at - body.p_PBcm, seen - body.p_PBcm);
                let omega = I * at.cross(&Vector3::z());
                let of_body = 1.0 / body.mass + omega.cross(&seen).z;
                let own = push_at(&(at + body.p_PBcm));
                // What does not give way at all is taken to give way by 1e-4.
                let off = ((of_body - of_arm).abs() - 2e-4).max(0.0);
                worst = worst.max(off / own.dot(&(arm * own)));
            }
        }
        println!("{} joints: off by {worst:.1e}", model.n_joints());
        assert!(worst < 1e-6, "{worst}");
    }
}

/// An arm of one joint cannot give way along the axis; its tip is a body all the same.
#[test]
fn an_arm_that_cannot_give_way_is_heavy() {
    let text = r#"<robot name="door"><link name="wall"/><link name="door"><inertial>
        <origin xyz="0.4 0 0"/><mass value="3"/>
        <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.2"/></inertial></link>
        <joint name="hinge" type="revolute"><parent link="wall"/><child link="door"/>
        <axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="9" velocity="3"/></joint>
        <link name="handle"/><joint name="grip" type="fixed"><origin xyz="0.8 0 0"/>
        <parent link="door"/><child link="handle"/></joint></robot>"#;
    let model = ArmModel::from_urdf(text, "handle").unwrap();
    let mut arm = Arm { q: JointVector::zeros(), qd: JointVector::zeros() };
    arm.qd[0] = 1.0;
    let free = arm.free(&model, &JointVector::zeros(), 1e-3);
    assert!(free.body.mass > 1e3 && free.body.inertia.iter().all(|I| *I > 0.3), "{:?}", free.body);
    // A push along the hinge moves nothing, one across it does: 0.8 m · 1 N·s / 0.68 kg·m².
    let push = |x: f64, z: f64| {
        let mut pushed = arm;
        let impulse = Vector6::new(0.0, x, z, 0.0, 0.0, 0.0);
        pushed.finish(&model, &free, &Push { impulse, reach: Vector6::zeros() });
        pushed.qd[0]
    };
    assert!((push(0.0, 5.0) - 1.0).abs() < 1e-9);
    assert!((push(1.0, 0.0) - 1.0 - 0.8 / 0.68).abs() < 1e-6, "{}", push(1.0, 0.0));
}

/// In an empty world the body goes where the arm's tip goes, and reports no push.
#[test]
fn the_body_follows_a_free_arm() {
    let model = wam_with_pan();
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    for _ in 0..20 {
        let (q, qd) = random_state(&model, &mut rng);
        let mut arm = Arm { q, qd };
        let mut world = new_world(&model.gravity(), 1e-3, 2, softness());
        let mut tip = TipBody::insert(&mut world, &kinematics::tip_pose(&model, &q));
        for _ in 0..50 {
            let tau = random_within(&model.limits().tau_max, &mut rng) * 0.3;
            let free = arm.free(&model, &tau, 1e-3);
            let push = tip.step(&mut world, &free);
            assert!(push.impulse.amax() < 1e-10 && push.reach.amax() < 1e-12, "{push:?}");
            arm.finish(&model, &free, &push);
            let body = world.bodies[tip.handle()].position().translation;
            let p_WP = kinematics::tip_pose(&model, &arm.q).translation.vector;
            let apart = p_WP - Vector3::new(body.x, body.y, body.z);
            assert!(apart.norm() < free.a.norm() * 1e-6 + 1e-9, "{apart}");
        }
    }
}

/// The reach of an impulse in the middle of a period is half of what it moves in a whole one.
#[test]
fn an_early_push_moves_further() {
    let model = wam_with_pan();
    let (q, dt) = (physics::pancake::WAM7_START_POSTURE, 1e-3);
    let free = Arm::at(&q).free(&model, &JointVector::zeros(), dt);
    let impulse = Vector6::new(0.01, 0.02, -0.1, 0.0, 0.003, 0.0);
    let pushed = |reach: f64| {
        let mut arm = Arm::at(&q);
        arm.finish(&model, &free, &Push { impulse, reach: impulse * reach });
        arm
    };
    let (late, early) = (pushed(0.0), pushed(dt));
    assert_eq!(late.qd, early.qd);
    let mut alone = Arm::at(&q);
    alone.finish(&model, &free, &Push::none());
    assert!((late.q - alone.q).amax() < 1e-15);
    assert!((early.q - alone.q - (early.qd - alone.qd) * dt).amax() < 1e-15);
}
