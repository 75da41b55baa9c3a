//! An [`ArmModel`] as a Rapier multibody: exact inertials, torques in, joint state out.

use std::f64::consts::FRAC_PI_2;

use rapier3d::prelude::{
    GenericJointBuilder, JointAxesMask, JointAxis, MassProperties, Multibody, MultibodyJointHandle,
    PhysicsWorld, Pose, RigidBodyBuilder, RigidBodyHandle, Rotation, Vector,
};

use super::convert::{to_glam_matrix, to_glam_pose, to_glam_vector};
use crate::arm::{ArmModel, Body, JointVector, MAX_JOINTS};

/// Index of the revolute coordinate among the six of a Rapier joint: rotation about local x.
const ANGLE_COORDINATE: usize = 3;

/// A stop further away than this (rad), beyond twice what the joint's speed covers in a step, is
/// not given to the solver. Only an acceleration could bring it within reach: 0.1 rad in a
/// millisecond takes 2e5 rad/s².
const STOP_MARGIN: f64 = 0.1;

/// Handles of an arm that lives in a [`PhysicsWorld`].
#[derive(Debug, Clone, Copy)]
pub struct RapierArm {
    n_joints: usize,
    /// The fixed base, then one body per joint.
    bodies: [RigidBodyHandle; MAX_JOINTS + 1],
    last_joint: MultibodyJointHandle,
}

impl RapierArm {
    /// Builds the arm in `world` at `q` (rad), at rest, without any collider.
    ///
    /// Joint limits are rigid. Rapier's default joint damping of 0.1 N·m·s/rad is removed: it
    /// would cost centimetres of tracking.
    pub fn insert(world: &mut PhysicsWorld, model: &ArmModel, q: &JointVector) -> RapierArm {
        let base = world.bodies.insert(RigidBodyBuilder::fixed().build());
        let mut bodies = [base; MAX_JOINTS + 1];
        let mut last_joint = None;
        for (i, body) in model.bodies().iter().enumerate() {
            let link = RigidBodyBuilder::dynamic()
                .additional_mass_properties(mass_properties(body))
                .can_sleep(false);
            bodies[i + 1] = world.bodies.insert(link.build());
            let limits = [model.limits().q_min[i], model.limits().q_max[i]];
            let joint = GenericJointBuilder::new(JointAxesMask::LOCKED_REVOLUTE_AXES)
                .local_frame1(to_glam_pose(&body.X_AB0()) * Pose::from_rotation(x_to_z()))
                .local_frame2(Pose::from_rotation(x_to_z()))
                .limits(JointAxis::AngX, limits)
                .contacts_enabled(false)
                .build();
            last_joint = world.multibody_joints.insert(bodies[i], bodies[i + 1], joint, true);
        }
        let last_joint = last_joint.expect("a model has at least one joint, each on a new body");
        let arm = RapierArm { n_joints: model.n_joints(), bodies, last_joint };

        // Until the first pass Rapier treats the fixed base as six free coordinates.
        let (multibody, _) = world.multibody_joints.get_mut(last_joint).expect("just inserted");
        multibody.forward_kinematics(&world.bodies, true);
        multibody.damping_mut().fill(0.0);
        arm.set_state(world, q, &JointVector::zeros());
        arm
    }

    /// The body that carries the tip.
    pub fn last_body(&self) -> RigidBodyHandle {
        self.bodies[self.n_joints]
    }

    /// Moves the arm to `q` (rad) and `qd` (rad/s). Only for a world that has not been stepped:
    /// contacts and warm starts would remember the old place.
    pub fn set_state(&self, world: &mut PhysicsWorld, q: &JointVector, qd: &JointVector) {
        let q_now = self.q(world);
        let bodies = &mut world.bodies;
        let (multibody, _) =
            world.multibody_joints.get_mut(self.last_joint).expect("the arm stays in its world");
        multibody.apply_displacements(&(q - q_now).as_slice()[..self.n_joints]);
        multibody.generalized_velocity_mut().copy_from_slice(&qd.as_slice()[..self.n_joints]);
        multibody.forward_kinematics(bodies, false);
        multibody.update_rigid_bodies(bodies, true);
    }

    /// Joint positions, rad.
    pub fn q(&self, world: &PhysicsWorld) -> JointVector {
        let multibody = self.multibody(world);
        let mut q = JointVector::zeros();
        for i in 0..self.n_joints {
            let link = multibody.link(i + 1).expect("one link per joint after the base");
            q[i] = link.joint().coords()[ANGLE_COORDINATE];
        }
        q
    }

    /// Joint speeds, rad/s.
    pub fn qd(&self, world: &PhysicsWorld) -> JointVector {
        let mut qd = JointVector::zeros();
        qd.as_mut_slice()[..self.n_joints]
            .copy_from_slice(self.multibody(world).generalized_velocity().as_slice());
        qd
    }

    /// Sets the joint torques (N·m) of the next step, replacing those of the last one. Call it
    /// before every step: the limits within reach of that step are engaged here too.
    ///
    /// Rapier has no generalized forces. A torque τ about the joint axis on the body and −τ on
    /// its parent has exactly that generalized force. The axis stays as it is during the step.
    pub fn set_torques(&self, world: &mut PhysicsWorld, tau: &JointVector) {
        self.engage_stops(world);
        for &body in &self.bodies[1..=self.n_joints] {
            world.bodies[body].reset_torques(false);
        }
        for i in 0..self.n_joints {
            let child = &mut world.bodies[self.bodies[i + 1]];
            let torque = child.position().rotation * Vector::Z * tau[i];
            child.add_torque(torque, true);
            world.bodies[self.bodies[i]].add_torque(-torque, true);
        }
    }

    /// Switches on the limits within reach of the next step, and off the others.
    ///
    /// Rapier builds and solves a constraint per limited joint in every sub-step and lets it push
    /// only beyond the limit. One that cannot push costs time and changes no bit.
    fn engage_stops(&self, world: &mut PhysicsWorld) {
        let dt = world.integration_parameters.dt;
        let (multibody, _) =
            world.multibody_joints.get_mut(self.last_joint).expect("the arm stays in its world");
        for i in 0..self.n_joints {
            let margin = STOP_MARGIN + 2.0 * dt * multibody.generalized_velocity()[i].abs();
            let link = multibody.link_mut(i + 1).expect("one link per joint after the base");
            let q = link.joint.coords()[ANGLE_COORDINATE];
            let joint = &mut link.joint.data;
            let limits = joint.limits[ANGLE_COORDINATE];
            let is_near = q - margin < limits.min || q + margin > limits.max;
            joint.limit_axes.set(JointAxesMask::ANG_X, is_near);
        }
    }

    fn multibody<'w>(&self, world: &'w PhysicsWorld) -> &'w Multibody {
        world.multibody_joints.get(self.last_joint).expect("the arm stays in its world").0
    }
}

/// A Rapier revolute joint turns about its local x axis, our joints about z.
fn x_to_z() -> Rotation {
    Rotation::from_rotation_y(-FRAC_PI_2)
}

fn mass_properties(body: &Body) -> MassProperties {
    MassProperties::with_inertia_matrix(
        to_glam_vector(&body.p_BBcm),
        body.mass,
        to_glam_matrix(&body.I_BBcm),
    )
}
