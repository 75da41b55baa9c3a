//! The pancake world: an arm with a frying pan, and a pancake lying in it.

use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use rapier3d::prelude::{ColliderHandle, PhysicsWorld, RigidBodyHandle};

use super::{PancakeConfig, insert_pan, insert_pancake, object_state};
use crate::arm::{ArmModel, JointVector, kinematics};
use crate::plant::ObjectState;
use crate::rapier::{ContactSoftness, RapierArm, Scene, ScenePlant, new_world};

/// The model's tip is the pan frame; the configuration passes [`PancakeConfig::check`].
pub type PancakePlant = ScenePlant<PancakeScene>;

/// One world and the handles into it.
pub struct PancakeScene {
    world: PhysicsWorld,
    arm: RapierArm,
    pancake: (RigidBodyHandle, ColliderHandle),
}

impl Scene for PancakeScene {
    type Config = PancakeConfig;

    fn new(model: &ArmModel, q0: &JointVector, config: &PancakeConfig) -> PancakeScene {
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
        PancakeScene { world, arm, pancake }
    }

    fn period_s(config: &PancakeConfig) -> f64 {
        config.period_s
    }

    fn arm(&self) -> (&PhysicsWorld, &RapierArm) {
        (&self.world, &self.arm)
    }

    fn object(&self) -> ObjectState {
        object_state(&self.world, self.pancake)
    }

    fn advance(&mut self, _: &ArmModel, tau: &JointVector, _: &PancakeConfig) {
        // Now and not when they are commanded: Rapier holds torques in world axes, and the axes have moved.
        self.arm.set_torques(&mut self.world, tau);
        self.world.step();
    }
}
