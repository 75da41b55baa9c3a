//! The pancake world: an arm with a frying pan, and a pancake lying in it.

use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use rapier3d::prelude::{ColliderHandle, PhysicsWorld, RigidBodyHandle};

use super::{PancakeConfig, insert_pan, insert_pan_in_two, insert_pancake, object_state};
use crate::arm::{ArmModel, JointVector, kinematics};
use crate::plant::{Dynamics, ObjectState};
use crate::rapier::{ContactSoftness, RapierArm, Scene, ScenePlant, new_world};
use crate::split::{Arm, TipBody};

/// The model's tip is the pan frame; the configuration passes [`PancakeConfig::check`].
pub type PancakePlant = ScenePlant<PancakeScene>;

/// One world and the handles into it.
pub struct PancakeScene {
    world: PhysicsWorld,
    arm: PanArm,
    pancake: (RigidBodyHandle, ColliderHandle),
}

/// What holds the pan.
enum PanArm {
    Multibody(RapierArm),
    Split { arm: Arm, pan: TipBody },
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
        let X_WP = kinematics::tip_pose(model, q0);
        let arm = match config.dynamics {
            Dynamics::Multibody => {
                let arm = RapierArm::insert(&mut world, model, q0);
                insert_pan(&mut world, arm.last_body(), &model.tip_offset(), config);
                PanArm::Multibody(arm)
            }
            Dynamics::Split => {
                let pan = TipBody::insert(&mut world, &X_WP);
                insert_pan_in_two(&mut world, pan.handle(), config);
                PanArm::Split { arm: Arm::at(q0), pan }
            }
        };
        let [x, y] = config.pancake_offset;
        let z = config.start_gap + config.pancake_thickness / 2.0;
        let X_PO = Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::identity());
        let pancake = insert_pancake(&mut world, &(X_WP * X_PO), config);
        PancakeScene { world, arm, pancake }
    }

    fn period_s(config: &PancakeConfig) -> f64 {
        config.period_s
    }

    fn joints(&self) -> (JointVector, JointVector) {
        match &self.arm {
            PanArm::Multibody(arm) => (arm.q(&self.world), arm.qd(&self.world)),
            PanArm::Split { arm, .. } => (arm.q, arm.qd),
        }
    }

    fn object(&self) -> ObjectState {
        object_state(&self.world, self.pancake)
    }

    fn advance(&mut self, model: &ArmModel, tau: &JointVector, config: &PancakeConfig) {
        match &mut self.arm {
            PanArm::Multibody(arm) => {
                // Now and not when they are commanded: Rapier holds torques in world axes, and the
                // axes have moved.
                arm.set_torques(&mut self.world, tau);
                self.world.step();
            }
            PanArm::Split { arm, pan } => {
                let free = arm.free(model, tau, config.period_s);
                let push = pan.step(&mut self.world, &free);
                arm.finish(model, &free, &push);
            }
        }
    }
}
