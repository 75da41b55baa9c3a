//! The arm's tip in a Rapier world: a body of the arm's mobility that follows the arm, and tells what
//! it met.

use std::ops::{Add, Mul};

use nalgebra::{Isometry3, Matrix3, Quaternion, UnitQuaternion, Vector3, Vector6};
use rapier3d::prelude::{
    MassProperties, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle, Rotation, Vector,
};

use super::{EquivalentBody, FreeMotion, Push};
use crate::rapier::convert::{from_glam_rotation, from_glam_vector, to_glam_pose, to_glam_vector};

/// The body that stands for the tip. Its colliders have no mass of their own.
///
/// Rapier's sub-steps of dt are those of a leapfrog: x' = x + v'·dt is exact to second order if v' is
/// the speed half a sub-step before x'. So the body is given the speed the tip had half a sub-step ago;
/// else what lies on it would slide by Δv·dt/2 as it speeds up. And Rapier keeps the levers of a contact
/// as they were when a step begins: v + ω × r with an r that does not turn. So the body is accelerated as
/// the origin of P is, where things are met, without ω × (ω × r) of its centre of mass; else what it throws
/// would be slower by ω²·r·T, with T the whole period.
pub struct TipBody {
    body: RigidBodyHandle,
    /// Impulses of the last two periods [N·s; N·m·s], world axes, about the tip's origin.
    met: [Vector6<f64>; 2],
}

/// What the body does if it meets nothing.
struct Expected {
    /// Inertia about the centre of mass, world axes, at the beginning as Rapier takes it.
    I: Matrix3<f64>,
    /// Speed of the centre of mass and turn at the end, of half a sub-step before.
    v: Motion,
    /// Centre of mass and rotation at the end.
    p_WBcm: Vector3<f64>,
    R_WP: UnitQuaternion<f64>,
}

/// Speeds or accelerations of a point and about it, world axes.
#[derive(Clone, Copy)]
struct Motion {
    linear: Vector3<f64>,
    angular: Vector3<f64>,
}

impl TipBody {
    pub fn insert(world: &mut PhysicsWorld, X_WP: &Isometry3<f64>) -> TipBody {
        let body = RigidBodyBuilder::dynamic()
            .pose(to_glam_pose(X_WP))
            // What moves it is the arm.
            .gravity_scale(0.0)
            .gyroscopic_forces_enabled(false)
            .can_sleep(false);
        TipBody { body: world.bodies.insert(body.build()), met: [Vector6::zeros(); 2] }
    }

    /// The body to which colliders are fixed; its frame is P.
    pub fn handle(&self) -> RigidBodyHandle {
        self.body
    }

    /// Lets the world pass a period in which the tip moves as `free` unless it meets something.
    pub fn step(&mut self, world: &mut PhysicsWorld, free: &FreeMotion) -> Push {
        let expected = self.set_out(world, free);
        world.step();
        let push = self.meet(world, free, &expected);
        self.met = [push.impulse, self.met[0]];
        push
    }

    /// Puts the body where the tip is, with its speed, and the force that gives it the tip's
    /// acceleration.
    ///
    /// Under a load that lasts the body would not give way as the arm does where it only resembles it
    /// ([`EquivalentBody`]): the difference is given to it.
    fn set_out(&self, world: &mut PhysicsWorld, free: &FreeMotion) -> Expected {
        let (body, X_WP) = (&free.body, &free.start.X_WP);
        let R_WP = X_WP.rotation.to_rotation_matrix().into_inner();
        let I = R_WP * body.inertia_P() * R_WP.transpose();
        let I_inv = R_WP * body.inverse_inertia_P() * R_WP.transpose();
        let r = R_WP * body.p_PBcm;
        let v = Motion::of(&free.start.v).at(&r);

        let load = self.lasting() / free.dt;
        let arms = Motion::of(&(free.a + free.response(&load))).at(&r);
        let push = Motion::of(&load);
        let bodys = Motion {
            linear: push.linear / body.mass,
            angular: I_inv * (push.angular - r.cross(&push.linear)),
        };
        let a = arms + bodys * -1.0;

        let n_substeps = world.integration_parameters.num_solver_iterations;
        let dt = free.dt / n_substeps as f64;
        let before = v + arms * (-dt / 2.0);

        let rapier = &mut world.bodies[self.body];
        rapier.set_additional_mass_properties(mass_properties(body), false);
        rapier.set_position(to_glam_pose(X_WP), false);
        rapier.set_linvel(to_glam_vector(&before.linear), false);
        rapier.set_angvel(to_glam_vector(&before.angular), false);
        rapier.reset_forces(false);
        rapier.reset_torques(false);
        rapier.add_force(to_glam_vector(&(a.linear * body.mass)), false);
        rapier.add_torque(to_glam_vector(&(I * a.angular)), false);

        let (mut p_WBcm, mut R_end) = (X_WP.translation.vector + r, X_WP.rotation);
        for k in 0..n_substeps {
            let v = v + a * ((k as f64 + 0.5) * dt);
            p_WBcm += v.linear * dt;
            R_end = turned(&R_end, &(v.angular * dt));
        }
        Expected { I, v: before + a * free.dt, p_WBcm, R_WP: R_end }
    }

    /// What went on in both of the last two periods, as the weight of what lies on the tip does and a
    /// blow does not.
    fn lasting(&self) -> Vector6<f64> {
        let [last, before] = self.met;
        let force = |impulse: &Vector6<f64>| impulse.fixed_rows::<3>(0).norm();
        if force(&last) < force(&before) { last } else { before }
    }

    /// The difference between what the body did and was expected to do, as a push.
    fn meet(&self, world: &PhysicsWorld, free: &FreeMotion, expected: &Expected) -> Push {
        let rapier = &world.bodies[self.body];
        let R_WP = from_glam_rotation(rapier.position().rotation);
        let r = free.middle.X_WP.rotation * free.body.p_PBcm;
        let push = |linear: Vector3<f64>, angular: Vector3<f64>| {
            let (f, n) = (linear * free.body.mass, expected.I * angular);
            let n = n + r.cross(&f);
            Vector6::new(f.x, f.y, f.z, n.x, n.y, n.z)
        };
        let v = from_glam_vector(rapier.linvel()) - expected.v.linear;
        let omega = from_glam_vector(rapier.angvel()) - expected.v.angular;
        let moved = from_glam_vector(rapier.center_of_mass()) - expected.p_WBcm;
        let impulse = push(v, omega);
        Push { impulse, reach: push(moved, small_turn(&expected.R_WP, &R_WP)) }
    }
}

impl Motion {
    fn of(v: &Vector6<f64>) -> Motion {
        Motion { linear: v.fixed_rows::<3>(0).into(), angular: v.fixed_rows::<3>(3).into() }
    }

    /// The motion of the point at the offset `r`.
    fn at(self, r: &Vector3<f64>) -> Motion {
        Motion { linear: self.linear + self.angular.cross(r), ..self }
    }
}

impl Add for Motion {
    type Output = Motion;

    fn add(self, other: Motion) -> Motion {
        Motion { linear: self.linear + other.linear, angular: self.angular + other.angular }
    }
}

impl Mul<f64> for Motion {
    type Output = Motion;

    fn mul(self, factor: f64) -> Motion {
        Motion { linear: self.linear * factor, angular: self.angular * factor }
    }
}

fn mass_properties(body: &EquivalentBody) -> MassProperties {
    MassProperties {
        local_com: to_glam_vector(&body.p_PBcm),
        inv_mass: 1.0 / body.mass,
        inv_principal_inertia: to_glam_vector(&body.inertia.map(|inertia| 1.0 / inertia)),
        principal_inertia_local_frame: Rotation::from_axis_angle(Vector::Z, body.angle),
    }
}

/// `R` turned by the small rotation vector `by`, to first order as Rapier does it.
fn turned(R: &UnitQuaternion<f64>, by: &Vector3<f64>) -> UnitQuaternion<f64> {
    let by = Quaternion::from_parts(1.0, by / 2.0);
    UnitQuaternion::new_normalize(by * R.into_inner())
}

/// The small rotation vector from `from` to `to`, world axes, rad.
fn small_turn(from: &UnitQuaternion<f64>, to: &UnitQuaternion<f64>) -> Vector3<f64> {
    (to * from.inverse()).imag() * 2.0
}
