//! What several tests need: the project's arms, its vectors, and seeded random states.

// Every test binary uses its own part of this file. Monogram names need capitals.
#![allow(dead_code, non_snake_case)]

use std::path::{Path, PathBuf};

use nalgebra::Isometry3;
use physics::arm::{ArmModel, JointVector, kinematics};
use physics::plant::Dynamics;
use physics::rapier::{ContactSoftness, RapierArm, new_world};
use physics::split::{Arm, Push};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rapier3d::prelude::PhysicsWorld;

/// Every test of a simulated arm is run on both.
pub const BOTH: [Dynamics; 2] = [Dynamics::Multibody, Dynamics::Split];

/// A simulated arm with nothing around it.
pub struct LoneArm {
    model: ArmModel,
    dt: f64,
    moves: Moves,
}

enum Moves {
    Multibody { world: Box<PhysicsWorld>, arm: RapierArm },
    Split(Arm),
}

impl LoneArm {
    /// Stepped in periods of `dt` s, from `q` (rad) and `qd` (rad/s).
    pub fn new(
        dynamics: Dynamics,
        model: &ArmModel,
        dt: f64,
        q: &JointVector,
        qd: &JointVector,
    ) -> LoneArm {
        let moves = match dynamics {
            Dynamics::Multibody => {
                let mut world = Box::new(new_world(&model.gravity(), dt, 4, softness()));
                let arm = RapierArm::insert(&mut world, model, q);
                arm.set_state(&mut world, q, qd);
                Moves::Multibody { world, arm }
            }
            Dynamics::Split => Moves::Split(Arm { q: *q, qd: *qd }),
        };
        LoneArm { model: model.clone(), dt, moves }
    }

    /// Positions and speeds, rad and rad/s.
    pub fn state(&self) -> (JointVector, JointVector) {
        match &self.moves {
            Moves::Multibody { world, arm } => (arm.q(world), arm.qd(world)),
            Moves::Split(arm) => (arm.q, arm.qd),
        }
    }

    /// One period under the joint torques `tau`, N·m.
    pub fn step(&mut self, tau: &JointVector) {
        match &mut self.moves {
            Moves::Multibody { world, arm } => {
                arm.set_torques(world, tau);
                world.step();
            }
            Moves::Split(arm) => {
                let free = arm.free(&self.model, tau, self.dt);
                arm.finish(&self.model, &free, &Push::none());
            }
        }
    }
}

pub fn project_path(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

/// A file of reference vectors; `SKILLET_VECTORS` names another directory.
pub fn vectors<T: serde::de::DeserializeOwned>(file: &str) -> T {
    let directory = std::env::var_os("SKILLET_VECTORS")
        .map_or_else(|| project_path("tests/vectors"), PathBuf::from);
    let path = directory.join(file);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path:?}: {e}"));
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{path:?}: {e}"))
}

/// The WAM carrying the pan, tip in the pan.
pub fn wam_with_pan() -> ArmModel {
    wam("wam7_pan.urdf", "pan")
}

pub fn wam(file: &str, tip: &str) -> ArmModel {
    ArmModel::from_urdf_file(project_path("robots/wam7").join(file), tip).unwrap()
}

/// A state well inside the limits, at most 6 rad/s.
pub fn random_state(model: &ArmModel, rng: &mut ChaCha8Rng) -> (JointVector, JointVector) {
    let limits = model.limits();
    let mut q = JointVector::zeros();
    let mut qd = JointVector::zeros();
    for i in 0..model.n_joints() {
        q[i] = rng.random_range(limits.q_min[i] + 0.05..limits.q_max[i] - 0.05);
        let speed = limits.qd_max[i].min(6.0);
        qd[i] = rng.random_range(-speed..speed);
    }
    (q, qd)
}

/// Random numbers within ±`bound`, zero for unused joints.
pub fn random_within(bound: &JointVector, rng: &mut ChaCha8Rng) -> JointVector {
    bound.map(|b| if b > 0.0 { rng.random_range(-b..b) } else { 0.0 })
}

pub fn softness() -> ContactSoftness {
    ContactSoftness { frequency_hz: 240.0, damping_ratio: 1.0 }
}

/// 10s³ − 15s⁴ + 6s⁵ with its first two derivatives by s.
pub fn quintic(s: f64) -> (f64, f64, f64) {
    let s = s.clamp(0.0, 1.0);
    (
        s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s),
        30.0 * s * s * (1.0 - s) * (1.0 - s),
        60.0 * s * (1.0 - s) * (1.0 - 2.0 * s),
    )
}

/// The tip at `q`, moved by (x, y, z) m in the world.
pub fn moved(model: &ArmModel, q: &JointVector, by: [f64; 3]) -> Isometry3<f64> {
    let mut X_WP = kinematics::tip_pose(model, q);
    X_WP.translation.vector += nalgebra::Vector3::from(by);
    X_WP
}

/// A three-joint arm with oblique axes, turned origins and inertials, masses behind fixed joints
/// beside and beyond the tip.
pub const OBLIQUE_ARM: &str = r#"<robot name="oblique">
  <link name="ground"/>
  <link name="stand"/>
  <link name="one"><inertial><origin xyz="0.05 -0.02 0.1" rpy="0.3 -0.2 0.5"/>
    <mass value="2"/><inertia ixx="0.02" ixy="0.001" ixz="-0.002" iyy="0.03" iyz="0.003" izz="0.025"/>
  </inertial></link>
  <link name="two"><inertial><origin xyz="0 0.1 0.02" rpy="-0.4 0.1 0"/>
    <mass value="1.5"/><inertia ixx="0.01" ixy="0" ixz="0.001" iyy="0.012" iyz="0" izz="0.008"/>
  </inertial></link>
  <link name="camera"><inertial><origin xyz="0.01 0 0" rpy="0 0 0.7"/>
    <mass value="0.3"/><inertia ixx="0.0004" ixy="0" ixz="0" iyy="0.0003" iyz="0" izz="0.0005"/>
  </inertial></link>
  <link name="three"><inertial><origin xyz="0.1 0 0"/>
    <mass value="0.7"/><inertia ixx="0.002" ixy="0" ixz="0" iyy="0.004" iyz="0" izz="0.003"/>
  </inertial></link>
  <link name="tool"/>
  <link name="blade"><inertial><origin xyz="0.02 0.03 0.04"/>
    <mass value="0.2"/><inertia ixx="0.0002" ixy="0" ixz="0" iyy="0.0003" iyz="0" izz="0.0002"/>
  </inertial></link>
  <joint name="mount" type="fixed"><origin xyz="0.1 0.2 0.3" rpy="0.2 0.1 -0.4"/>
    <parent link="ground"/><child link="stand"/></joint>
  <joint name="a" type="revolute"><origin xyz="0 0 0.1" rpy="0.1 0.2 0.3"/>
    <parent link="stand"/><child link="one"/><axis xyz="0.3 -0.5 0.8"/>
    <limit lower="-2" upper="2" effort="50" velocity="5"/></joint>
  <joint name="b" type="revolute"><origin xyz="0.1 0 0.3" rpy="0 -0.6 0.2"/>
    <parent link="one"/><child link="two"/><axis xyz="1 0 0"/>
    <limit lower="-2" upper="2" effort="30" velocity="5"/></joint>
  <joint name="camera_fixed" type="fixed"><origin xyz="0.05 0.05 0" rpy="0 0.5 0"/>
    <parent link="two"/><child link="camera"/></joint>
  <joint name="c" type="revolute"><origin xyz="0 0.25 0" rpy="1.2 0 0"/>
    <parent link="two"/><child link="three"/><axis xyz="0 0 -2"/>
    <limit lower="-2" upper="2" effort="10" velocity="5"/></joint>
  <joint name="tool_fixed" type="fixed"><origin xyz="0.2 0 0" rpy="0 0.9 0"/>
    <parent link="three"/><child link="tool"/></joint>
  <joint name="blade_fixed" type="fixed"><origin xyz="0 0.1 0" rpy="0.5 0 0"/>
    <parent link="tool"/><child link="blade"/></joint>
</robot>"#;
