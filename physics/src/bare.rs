//! An arm in empty space: nothing to touch, nothing to lose.

use nalgebra::{UnitQuaternion, Vector3};

use crate::arm::{ArmModel, JointVector};
use crate::plant::{Measurement, ObjectState, Plant};
use crate::split::{Arm, Push};

/// The arm alone, by the equations of motion of [`crate::split`].
pub struct BareArm {
    model: ArmModel,
    q0: JointVector,
    period_s: f64,
    arm: Arm,
    tau: JointVector,
    sample: u64,
}

impl BareArm {
    /// At rest at `q0`, rad.
    pub fn new(model: &ArmModel, q0: &JointVector, period_s: f64) -> BareArm {
        let (arm, tau) = (Arm::at(q0), JointVector::zeros());
        BareArm { model: model.clone(), q0: *q0, period_s, arm, tau, sample: 0 }
    }
}

impl Plant for BareArm {
    fn is_simulated(&self) -> bool {
        true
    }

    fn begin_reset(&mut self) {
        (self.arm, self.tau) = (Arm::at(&self.q0), JointVector::zeros());
    }

    fn is_ready(&self) -> bool {
        true
    }

    /// There is no object: its pose is the world's frame.
    fn measure(&self) -> Measurement {
        let object = ObjectState {
            p_WO: Vector3::zeros(),
            R_WO: UnitQuaternion::identity(),
            in_contact: false,
        };
        let t_ns = self.sample * (self.period_s * 1e9).round() as u64;
        Measurement { q: self.arm.q, qd: self.arm.qd, object, sample: self.sample, t_ns }
    }

    fn apply(&mut self, tau: &JointVector) {
        self.tau = *tau;
    }

    fn advance(&mut self) {
        let free = self.arm.free(&self.model, &self.tau, self.period_s);
        self.arm.finish(&self.model, &free, &Push::none());
        self.sample += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::dynamics;
    use crate::pancake::WAM7_START_POSTURE;

    #[test]
    fn rests_under_the_torque_that_holds_it_and_falls_without() {
        let urdf = include_str!("../../robots/wam7/wam7_pan.urdf");
        let model = ArmModel::from_urdf(urdf, "pan").unwrap();
        let mut plant = BareArm::new(&model, &WAM7_START_POSTURE, 1e-3);
        let moved = |plant: &BareArm| (plant.measure().q - WAM7_START_POSTURE).amax();
        for _ in 0..100 {
            plant.apply(&dynamics::gravity_torque(&model, &plant.measure().q));
            plant.advance();
        }
        assert!(moved(&plant) < 1e-9, "{}", moved(&plant));
        plant.apply(&JointVector::zeros());
        (0..100).for_each(|_| plant.advance());
        assert!(moved(&plant) > 0.01);
        plant.begin_reset();
        assert_eq!(moved(&plant), 0.0);
        assert_eq!(plant.measure().sample, 200, "samples go on through a reset");
    }
}
