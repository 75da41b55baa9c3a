//! An arm without a simulator: exact rigid-body dynamics, the object fixed to the pan.
//!
//! For dry runs of policies and for tests of the loop: it allocates nothing, and what it does
//! follows from the model alone.

use nalgebra::{Isometry3, Translation3};

use crate::arm::{ArmModel, JointVector, dynamics, kinematics};
use crate::plant::{Measurement, ObjectState, Plant};

/// q̈ = M(q)⁻¹ (τ − C(q,q̇)q̇ − g(q)), integrated semi-implicitly once a period.
pub struct IdealArm<'a> {
    model: &'a ArmModel,
    q0: JointVector,
    period_s: f64,
    /// The object's place on the pan, m above its surface.
    height_m: f64,
    q: JointVector,
    qd: JointVector,
    tau: JointVector,
    sample: u64,
}

impl<'a> IdealArm<'a> {
    /// At rest at `q0` (rad), an object of `height_m` lying in the middle of the pan.
    pub fn new(model: &'a ArmModel, q0: &JointVector, period_s: f64, height_m: f64) -> Self {
        let still = JointVector::zeros();
        IdealArm { model, q0: *q0, period_s, height_m, q: *q0, qd: still, tau: still, sample: 0 }
    }
}

impl Plant for IdealArm<'_> {
    fn is_simulated(&self) -> bool {
        true
    }

    fn begin_reset(&mut self) {
        (self.q, self.qd, self.tau) = (self.q0, JointVector::zeros(), JointVector::zeros());
    }

    fn is_ready(&self) -> bool {
        true
    }

    fn measure(&self) -> Measurement {
        let X_PO = Translation3::new(0.0, 0.0, self.height_m / 2.0);
        let X_WO: Isometry3<f64> = kinematics::tip_pose(self.model, &self.q) * X_PO;
        let object =
            ObjectState { p_WO: X_WO.translation.vector, R_WO: X_WO.rotation, in_contact: true };
        let t_ns = self.sample * (self.period_s * 1e9).round() as u64;
        Measurement { q: self.q, qd: self.qd, object, sample: self.sample, t_ns }
    }

    fn apply(&mut self, tau: &JointVector) {
        self.tau = *tau;
    }

    fn advance(&mut self) {
        let torque = self.tau - dynamics::bias(self.model, &self.q, &self.qd);
        // The mass matrix of a physical arm in a finite state is positive definite.
        if let Some(M) = dynamics::mass_matrix(self.model, &self.q).cholesky() {
            self.qd += M.solve(&torque) * self.period_s;
            self.q += self.qd * self.period_s;
        }
        self.sample += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pancake::WAM7_START_POSTURE;

    #[test]
    fn rests_under_gravity_torque_and_falls_without() {
        let urdf = include_str!("../../robots/wam7/wam7_pan.urdf");
        let model = ArmModel::from_urdf(urdf, "pan").unwrap();
        let mut arm = IdealArm::new(&model, &WAM7_START_POSTURE, 1e-3, 0.01);
        let hold = dynamics::gravity_torque(&model, &WAM7_START_POSTURE);
        for _ in 0..1000 {
            arm.apply(&hold);
            arm.advance();
        }
        assert!((arm.measure().q - WAM7_START_POSTURE).abs().max() < 1e-6);
        let height = arm.measure().object.p_WO.z;
        arm.apply(&JointVector::zeros());
        (0..100).for_each(|_| arm.advance());
        assert!(arm.measure().object.p_WO.z < height - 0.02);
        arm.begin_reset();
        assert_eq!(arm.measure().q, WAM7_START_POSTURE);
    }
}
