//! The world of ball and cup: an arm that holds a cup from which a ball hangs.

use nalgebra::{Isometry3, UnitQuaternion, Vector3, Vector6};
use rapier3d::prelude::PhysicsWorld;

use super::{Ball, CupConfig, CupMotion, Reaction};
use crate::arm::{ArmModel, JointVector, kinematics};
use crate::plant::{Dynamics, ObjectState};
use crate::rapier::convert::to_glam_vector;
use crate::rapier::{ContactSoftness, RapierArm, Scene, ScenePlant, new_world};
use crate::split::{Arm, Push};

/// Sub-steps of the arm within a period, as in the pancake's world.
const ARM_SUBSTEPS: usize = 4;
/// Nothing touches anything in Rapier's part of the world; a world wants one all the same.
const NO_CONTACTS: ContactSoftness = ContactSoftness { frequency_hz: 30.0, damping_ratio: 1.0 };

/// The model's tip is the cup frame.
pub type CupPlant = ScenePlant<CupScene>;

/// One world, and what is in it.
pub struct CupScene {
    arm: CupArm,
    X_WP: Isometry3<f64>,
    ball: Ball,
}

/// What holds the cup.
enum CupArm {
    Multibody {
        world: Box<PhysicsWorld>,
        arm: RapierArm,
        /// The reaction of the last period; it acts on the arm during the next one.
        reaction: Reaction,
    },
    Split(Arm),
}

impl Scene for CupScene {
    type Config = CupConfig;

    fn new(model: &ArmModel, q0: &JointVector, config: &CupConfig) -> CupScene {
        let X_WP = kinematics::tip_pose(model, q0);
        let ball = Ball::hanging(&X_WP, config);
        let arm = match config.dynamics {
            Dynamics::Multibody => {
                let mut world =
                    new_world(&model.gravity(), config.period_s, ARM_SUBSTEPS, NO_CONTACTS);
                let arm = RapierArm::insert(&mut world, model, q0);
                CupArm::Multibody { world: Box::new(world), arm, reaction: Reaction::NONE }
            }
            Dynamics::Split => CupArm::Split(Arm::at(q0)),
        };
        CupScene { arm, X_WP, ball }
    }

    fn period_s(config: &CupConfig) -> f64 {
        config.period_s
    }

    fn joints(&self) -> (JointVector, JointVector) {
        match &self.arm {
            CupArm::Multibody { world, arm, .. } => (arm.q(world), arm.qd(world)),
            CupArm::Split(arm) => (arm.q, arm.qd),
        }
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
        let (from, gravity) = (self.X_WP, model.gravity());
        match &mut self.arm {
            CupArm::Multibody { world, arm, reaction } => {
                arm.set_torques(world, tau);
                push_cup(world, arm, &from, reaction, config.period_s);
                world.step();
                self.X_WP = kinematics::tip_pose(model, &arm.q(world));
                *reaction = follow(&mut self.ball, &from, &self.X_WP, &gravity, config);
            }
            CupArm::Split(arm) => {
                let free = arm.free(model, tau, config.period_s);
                let mut untouched = *arm;
                untouched.finish(model, &free, &Push::none());
                let to = kinematics::tip_pose(model, &untouched.q);
                let reaction = follow(&mut self.ball, &from, &to, &gravity, config);
                let [f, n] = [reaction.impulse, reaction.moment];
                let impulse = Vector6::new(f.x, f.y, f.z, n.x, n.y, n.z);
                // In the mean it comes half-way through the period.
                let reach = impulse * (config.period_s / 2.0);
                arm.finish(model, &free, &Push { impulse, reach });
                self.X_WP = kinematics::tip_pose(model, &arm.q);
            }
        }
    }
}

/// Lets the ball pass a period in which the cup moves evenly from one pose to the other.
fn follow(
    ball: &mut Ball,
    from: &Isometry3<f64>,
    to: &Isometry3<f64>,
    gravity: &Vector3<f64>,
    config: &CupConfig,
) -> Reaction {
    let moved = to.translation.vector - from.translation.vector;
    let turned = (to.rotation * from.rotation.inverse()).scaled_axis();
    let motion =
        CupMotion { X_WP: *from, v_WP: moved / config.period_s, w_WP: turned / config.period_s };
    let dt = config.period_s / config.n_substeps as f64;
    let mut reaction = Reaction::NONE;
    for substep in 1..=config.n_substeps {
        let share = substep as f64 / config.n_substeps as f64;
        let p = from.translation.vector + moved * share;
        let R = UnitQuaternion::new(turned * share) * from.rotation;
        let cup = CupMotion { X_WP: Isometry3::from_parts(p.into(), R), ..motion };
        ball.step(&cup, gravity, dt, config, &mut reaction);
    }
    reaction
}

/// The mean force of what the ball did to the cup at `X_WP` during the last period.
fn push_cup(
    world: &mut PhysicsWorld,
    arm: &RapierArm,
    X_WP: &Isometry3<f64>,
    reaction: &Reaction,
    period_s: f64,
) {
    let [force, moment] =
        [reaction.impulse, reaction.moment].map(|x: Vector3<f64>| to_glam_vector(&(x / period_s)));
    let link = &mut world.bodies[arm.last_body()];
    link.reset_forces(false);
    link.add_force_at_point(force, to_glam_vector(&X_WP.translation.vector), true);
    link.add_torque(moment, true);
}
