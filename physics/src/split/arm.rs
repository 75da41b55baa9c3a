//! An arm that is integrated to second order: first as if nothing touched it, then with what did.

use nalgebra::{Cholesky, Vector6};

use super::stops::Stops;
use super::{EquivalentBody, MassFactor};
use crate::arm::dynamics;
use crate::arm::{ArmModel, BodyFrames, Jacobian, JointMatrix, JointVector, TipKinematics};

/// Where the joints are and how fast they move, rad and rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arm {
    pub q: JointVector,
    pub qd: JointVector,
}

/// What an arm does within a period that nothing touches.
pub struct FreeMotion {
    /// Length of the period, s.
    pub dt: f64,
    /// The tip when it begins, and half-way.
    pub start: TipKinematics,
    pub middle: TipKinematics,
    /// The tip's mean acceleration [m/s²; rad/s²], world axes, stops considered.
    pub a: Vector6<f64>,
    /// What gives way to a push on the tip: the arm, but for joints that rest on a stop.
    pub body: EquivalentBody,
    /// Jacobian and mass matrix of what gives way.
    giving: (Jacobian, MassFactor),
    /// Speeds at the end and mass matrix, as if there were no stops.
    qd: JointVector,
    M: MassFactor,
}

impl FreeMotion {
    /// Acceleration [m/s²; rad/s²] that `force` [N; N·m] on the tip gives it: J·M⁻¹·Jᵀ·F.
    pub fn response(&self, force: &Vector6<f64>) -> Vector6<f64> {
        let (J, M) = &self.giving;
        J * M.solve(&J.tr_mul(force))
    }
}

/// What was done to the tip within a period, world axes, moments about the tip's origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Push {
    /// Impulse [N·s; N·m·s].
    pub impulse: Vector6<f64>,
    /// ∫ (T − t) dP [N·s²; N·m·s²]: an early impulse moves further.
    pub reach: Vector6<f64>,
}

impl Push {
    pub fn none() -> Push {
        Push { impulse: Vector6::zeros(), reach: Vector6::zeros() }
    }
}

impl Arm {
    /// At rest.
    pub fn at(q: &JointVector) -> Arm {
        Arm { q: *q, qd: JointVector::zeros() }
    }

    /// The next `dt` s under the joint torques `tau` (N·m), by the midpoint rule:
    /// q̈ = M(q_m)⁻¹ (τ − C(q_m, q̇_m)q̇_m − g(q_m)) with q_m, q̇_m half a period on.
    pub fn free(&self, model: &ArmModel, tau: &JointVector, dt: f64) -> FreeMotion {
        let frames = BodyFrames::new(model, &self.q);
        let start = TipKinematics::at(model, &frames, &self.qd);
        let qdd = acceleration(model, &frames, &self.qd, tau).0;

        let (q_m, qd_m) = (self.q + self.qd * (dt / 2.0), self.qd + qdd * (dt / 2.0));
        let frames = BodyFrames::new(model, &q_m);
        let middle = TipKinematics::at(model, &frames, &qd_m);
        let (qdd, M) = acceleration(model, &frames, &qd_m, tau);
        let qd = self.qd + qdd * dt;

        let (giving, qdd) = match Stops::of(&self.q, model.limits(), dt).stop(&qd, &M) {
            None => ((middle.J, M), qdd),
            Some(stopped) => {
                let (J, M) = stopped.held(&middle.J, &dynamics::mass_matrix_at(model, &frames));
                ((J, factor(&M)), (stopped.qd - self.qd) / dt)
            }
        };
        let body = EquivalentBody::of(&middle.X_WP.rotation, &giving.0, &giving.1);
        let a = middle.J * qdd + middle.Jdot_qd;
        FreeMotion { dt, start, middle, a, body, giving, qd, M }
    }

    /// Ends the period of `free`, in which the tip was pushed.
    pub fn finish(&mut self, model: &ArmModel, free: &FreeMotion, push: &Push) {
        let respond = |push: &Vector6<f64>| free.M.solve(&free.middle.J.tr_mul(push));
        let (jump, shift) = (respond(&push.impulse), respond(&push.reach));
        let qd = free.qd + jump;
        let stops = Stops::of(&self.q, model.limits(), free.dt);
        let qd = stops.stop(&qd, &free.M).map_or(qd, |stopped| stopped.qd);
        // The jump is not spread over the period but came when it came.
        let moved = (self.qd + qd - jump) * (free.dt / 2.0) + shift;
        let limits = model.limits();
        for i in 0..model.n_joints() {
            self.q[i] = (self.q[i] + moved[i]).clamp(limits.q_min[i], limits.q_max[i]);
        }
        self.qd = qd;
    }
}

/// q̈ and the factorised M.
fn acceleration(
    model: &ArmModel,
    frames: &BodyFrames,
    qd: &JointVector,
    tau: &JointVector,
) -> (JointVector, MassFactor) {
    let M = factor(&dynamics::mass_matrix_at(model, frames));
    (M.solve(&(tau - dynamics::bias_at(model, frames, qd))), M)
}

/// M is positive definite. Where a state is no number any more, neither is what comes of this.
fn factor(M: &JointMatrix) -> MassFactor {
    M.cholesky().unwrap_or_else(|| Cholesky::pack_dirty(JointMatrix::repeat(f64::NAN)))
}
