//! The pancake world behind [`Plant`].

use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use rapier3d::prelude::{ColliderHandle, PhysicsWorld, RigidBodyHandle};

use super::{PancakeConfig, insert_pan, insert_pancake, object_state};
use crate::arm::{ArmModel, JointVector, kinematics};
use crate::plant::{Measurement, Plant};
use crate::rapier::{ContactSoftness, RapierArm, new_world};

/// An arm with a frying pan and a pancake lying in it.
pub struct PancakePlant {
    model: ArmModel,
    q0: JointVector,
    config: PancakeConfig,
    tau: JointVector,
    sample: u64,
    scene: Scene,
}

/// One world and the handles into it.
struct Scene {
    world: PhysicsWorld,
    arm: RapierArm,
    pancake: (RigidBodyHandle, ColliderHandle),
}

impl PancakePlant {
    /// Builds the world at rest at `q0` (rad), the pancake in the pan as `config` says.
    ///
    /// The model's tip is the pan frame and its last body carries the pan's mass.
    /// Preconditions: `config` passes [`PancakeConfig::check`], `q0` lies within the limits.
    pub fn new(model: &ArmModel, q0: &JointVector, config: &PancakeConfig) -> PancakePlant {
        let scene = Scene::new(model, q0, config);
        let tau = JointVector::zeros();
        PancakePlant { model: model.clone(), q0: *q0, config: *config, tau, sample: 0, scene }
    }
}

impl Plant for PancakePlant {
    fn is_simulated(&self) -> bool {
        true
    }

    /// Builds a fresh world: putting the old one back in place is not bit-identical, because
    /// Rapier keeps contacts, warm starts and its broad phase.
    fn begin_reset(&mut self) {
        self.tau = JointVector::zeros();
        self.scene = Scene::new(&self.model, &self.q0, &self.config);
    }

    fn is_ready(&self) -> bool {
        true
    }

    fn measure(&self) -> Measurement {
        let Scene { world, arm, pancake } = &self.scene;
        let object = object_state(world, *pancake);
        let t_ns = self.sample * (self.config.period_s * 1e9).round() as u64;
        Measurement { q: arm.q(world), qd: arm.qd(world), object, sample: self.sample, t_ns }
    }

    fn apply(&mut self, tau: &JointVector) {
        self.tau = *tau;
    }

    fn advance(&mut self) {
        let Scene { world, arm, .. } = &mut self.scene;
        // Here and not in apply: Rapier holds torques in world axes, and the axes have moved.
        arm.set_torques(world, &self.tau);
        world.step();
        self.sample += 1;
    }
}

impl Scene {
    fn new(model: &ArmModel, q0: &JointVector, config: &PancakeConfig) -> Scene {
        let softness = ContactSoftness {
            frequency_hz: config.contact_frequency_hz,
            damping_ratio: config.contact_damping_ratio,
        };
        let mut world =
            new_world(&model.gravity(), config.period_s, config.solver_iterations, softness);
        let arm = RapierArm::insert(&mut world, model, q0);
        insert_pan(&mut world, arm.last_body(), &model.tip_offset(), config);

        let [x, y] = config.pancake_offset;
        let z = config.start_gap + config.pancake_thickness / 2.0;
        let X_PO = Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::identity());
        let X_WO = kinematics::tip_pose(model, q0) * X_PO;
        let pancake = insert_pancake(&mut world, &X_WO, config);
        Scene { world, arm, pancake }
    }
}
