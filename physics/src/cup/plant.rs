//! The world of ball and cup: an arm that holds a cup from which a ball hangs.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use rapier3d::prelude::PhysicsWorld;

use super::{Ball, CupConfig, CupMotion, Reaction};
use crate::arm::{ArmModel, JointVector, kinematics};
use crate::plant::ObjectState;
use crate::rapier::convert::to_glam_vector;
use crate::rapier::{ContactSoftness, RapierArm, Scene, ScenePlant, new_world};

/// Sub-steps of the arm within a period, as in the pancake's world.
const ARM_SUBSTEPS: usize = 4;
/// Nothing touches anything in Rapier's part of the world; a world wants one all the same.
const NO_CONTACTS: ContactSoftness = ContactSoftness { frequency_hz: 30.0, damping_ratio: 1.0 };

/// The model's tip is the cup frame.
pub type CupPlant = ScenePlant<CupScene>;

/// One world, and what is in it.
pub struct CupScene {
    world: PhysicsWorld,
    arm: RapierArm,
    X_WP: Isometry3<f64>,
    ball: Ball,
    /// Of the last period: it acts on the arm during the next.
    reaction: Reaction,
}

impl Scene for CupScene {
    type Config = CupConfig;

    fn new(model: &ArmModel, q0: &JointVector, config: &CupConfig) -> CupScene {
        let mut world = new_world(&model.gravity(), config.period_s, ARM_SUBSTEPS, NO_CONTACTS);
        let arm = RapierArm::insert(&mut world, model, q0);
        let X_WP = kinematics::tip_pose(model, q0);
        let ball = Ball::hanging(&X_WP, config);
        CupScene { world, arm, X_WP, ball, reaction: Reaction::NONE }
    }

    fn period_s(config: &CupConfig) -> f64 {
        config.period_s
    }

    fn arm(&self) -> (&PhysicsWorld, &RapierArm) {
        (&self.world, &self.arm)
    }

    fn object(&self) -> ObjectState {
        ObjectState {
            p_WO: self.ball.p_WO,
            R_WO: UnitQuaternion::identity(),
            in_contact: self.ball.is_touching,
        }
    }

    /// The arm moves first, the ball follows where the cup went.
    fn advance(&mut self, model: &ArmModel, tau: &JointVector, config: &CupConfig) {
        self.arm.set_torques(&mut self.world, tau);
        self.push_cup(config.period_s);
        self.world.step();

        let (from, to) = (self.X_WP, kinematics::tip_pose(model, &self.arm.q(&self.world)));
        let moved = to.translation.vector - from.translation.vector;
        let turned = (to.rotation * from.rotation.inverse()).scaled_axis();
        let motion =
            CupMotion { X_WP: from, v_WP: moved / config.period_s, w_WP: turned / config.period_s };
        let dt = config.period_s / config.n_substeps as f64;
        self.reaction = Reaction::NONE;
        for substep in 1..=config.n_substeps {
            let share = substep as f64 / config.n_substeps as f64;
            let p = from.translation.vector + moved * share;
            let R = UnitQuaternion::new(turned * share) * from.rotation;
            let cup = CupMotion { X_WP: Isometry3::from_parts(p.into(), R), ..motion };
            self.ball.step(&cup, &model.gravity(), dt, config, &mut self.reaction);
        }
        self.X_WP = to;
    }
}

impl CupScene {
    /// The mean force of what the ball did to the cup during the last period.
    fn push_cup(&mut self, period_s: f64) {
        let [force, moment] = [self.reaction.impulse, self.reaction.moment]
            .map(|x: Vector3<f64>| to_glam_vector(&(x / period_s)));
        let link = &mut self.world.bodies[self.arm.last_body()];
        link.reset_forces(false);
        link.add_force_at_point(force, to_glam_vector(&self.X_WP.translation.vector), true);
        link.add_torque(moment, true);
    }
}
