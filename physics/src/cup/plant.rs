//! The world of ball and cup behind [`Plant`].

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use rapier3d::prelude::PhysicsWorld;

use super::{Ball, CupConfig, CupMotion, Reaction};
use crate::arm::{ArmModel, JointVector, kinematics};
use crate::plant::{Measurement, ObjectState, Plant};
use crate::rapier::convert::to_glam_vector;
use crate::rapier::{ContactSoftness, RapierArm, new_world};

/// Sub-steps of the arm within a period, as in the pancake's world.
const ARM_SUBSTEPS: usize = 4;
/// Nothing touches anything in Rapier's part of the world; a world wants one all the same.
const NO_CONTACTS: ContactSoftness = ContactSoftness { frequency_hz: 30.0, damping_ratio: 1.0 };

/// An arm that holds a cup from which a ball hangs.
pub struct CupPlant {
    model: ArmModel,
    q0: JointVector,
    config: CupConfig,
    tau: JointVector,
    sample: u64,
    scene: Scene,
}

/// One world, and what is in it.
struct Scene {
    world: PhysicsWorld,
    arm: RapierArm,
    X_WP: Isometry3<f64>,
    ball: Ball,
    /// Of the last period: it acts on the arm during the next.
    reaction: Reaction,
}

impl CupPlant {
    /// Builds the world at rest at `q0` (rad), the ball hanging below the cup.
    ///
    /// The model's tip is the cup frame and its last body carries the cup's mass.
    /// Precondition: `q0` lies within the limits.
    pub fn new(model: &ArmModel, q0: &JointVector, config: &CupConfig) -> CupPlant {
        let scene = Scene::new(model, q0, config);
        let tau = JointVector::zeros();
        CupPlant { model: model.clone(), q0: *q0, config: *config, tau, sample: 0, scene }
    }
}

impl Plant for CupPlant {
    fn is_simulated(&self) -> bool {
        true
    }

    fn begin_reset(&mut self) {
        self.tau = JointVector::zeros();
        self.scene = Scene::new(&self.model, &self.q0, &self.config);
    }

    fn is_ready(&self) -> bool {
        true
    }

    fn measure(&self) -> Measurement {
        let Scene { world, arm, ball, .. } = &self.scene;
        let object = ObjectState {
            p_WO: ball.p_WO,
            R_WO: UnitQuaternion::identity(),
            in_contact: ball.is_touching,
        };
        let t_ns = self.sample * (self.config.period_s * 1e9).round() as u64;
        Measurement { q: arm.q(world), qd: arm.qd(world), object, sample: self.sample, t_ns }
    }

    fn apply(&mut self, tau: &JointVector) {
        self.tau = *tau;
    }

    fn advance(&mut self) {
        self.scene.advance(&self.model, &self.tau, &self.config);
        self.sample += 1;
    }
}

impl Scene {
    fn new(model: &ArmModel, q0: &JointVector, config: &CupConfig) -> Scene {
        let mut world = new_world(&model.gravity(), config.period_s, ARM_SUBSTEPS, NO_CONTACTS);
        let arm = RapierArm::insert(&mut world, model, q0);
        let X_WP = kinematics::tip_pose(model, q0);
        let ball = Ball::hanging(&X_WP, config);
        Scene { world, arm, X_WP, ball, reaction: Reaction::NONE }
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
