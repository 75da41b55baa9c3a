//! An ideal arm of which something goes wrong when it is told to.

use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::time::Duration;

use physics::arm::{ArmModel, JointVector, dynamics};
use physics::ideal::IdealArm;
use physics::pancake::WAM7_START_POSTURE;
use physics::plant::{Measurement, Plant};
use rt_controller::ControllerConfig;

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(u32)]
pub enum Wrong {
    Nothing,
    /// A speed is not a number.
    NotANumber,
    /// No new samples come.
    Stale,
    /// The samples are counted, but hold the same values.
    FrozenSensor,
    /// The positions stand still, the speeds are live.
    FrozenPosition,
    /// The elbow does not move whatever torque acts.
    Stuck,
    /// Something presses against the arm, with the whole torque of its second joint.
    Pushed,
    /// The same with three times as much: the arm is carried away.
    CarriedAway,
    /// The driver takes longer than two periods.
    Late,
}

const ELBOW: usize = 3;
const PRESSED: usize = 1;
/// The object lies on the pan of the start posture at this height, m.
pub const START_HEIGHT_M: f64 = 0.725;

/// The test's hand on the arm.
pub struct Switch {
    wrong: AtomicU32,
    /// It goes wrong while the object is above this height, m, as bits.
    above_m: AtomicU64,
    /// A torque was beyond the limits or stepped beyond the rate.
    is_broken: AtomicBool,
}

impl Switch {
    pub const fn new() -> Switch {
        let (wrong, is_broken) = (AtomicU32::new(0), AtomicBool::new(false));
        Switch { wrong, above_m: AtomicU64::new(0), is_broken }
    }

    pub fn set(&self, wrong: Wrong) {
        self.wrong.store(wrong as u32, Ordering::Relaxed);
    }

    pub fn only_above(&self, height_m: f64) {
        self.above_m.store(height_m.to_bits(), Ordering::Relaxed);
    }

    fn is(&self, wrong: Wrong) -> bool {
        self.wrong.load(Ordering::Relaxed) == wrong as u32
    }

    pub fn expect_torques_in_bounds(&self) {
        assert!(!self.is_broken.load(Ordering::Relaxed), "a torque left its bounds");
    }
}

pub struct Faulty<'a> {
    model: &'a ArmModel,
    arm: IdealArm<'a>,
    switch: &'a Switch,
    shown: Measurement,
    tau: JointVector,
    /// Largest step of a torque, N·m.
    step: JointVector,
    period_s: f64,
}

impl<'a> Faulty<'a> {
    pub fn new(model: &'a ArmModel, config: &ControllerConfig, switch: &'a Switch) -> Faulty<'a> {
        let period_s = config.period_s();
        let arm = IdealArm::new(model, &WAM7_START_POSTURE, period_s, 0.01);
        let step = model.limits().tau_max * (config.torque_rate * period_s * (1.0 + 1e-12));
        let shown = arm.measure();
        // It rests in what holds it.
        let tau = dynamics::gravity_torque(model, &WAM7_START_POSTURE);
        Faulty { model, arm, switch, shown, tau, step, period_s }
    }

    /// Lets `n` further periods pass under the last torque, unseen: the host stood still.
    pub fn stall(&mut self, n: u32) {
        (0..n).for_each(|_| self.arm.advance());
        self.show();
    }

    /// The arm as it is, whatever it shows.
    pub fn truth(&self) -> Measurement {
        self.arm.measure()
    }

    /// What acts on the joints besides the motors, N·m.
    fn disturbance(&self) -> JointVector {
        let Measurement { q, qd, object, .. } = self.arm.measure();
        let mut force = JointVector::zeros();
        if object.p_WO.z < f64::from_bits(self.switch.above_m.load(Ordering::Relaxed)) {
            return force;
        }
        for (wrong, factor) in [(Wrong::Pushed, 1.0), (Wrong::CarriedAway, 3.0)] {
            if self.switch.is(wrong) {
                force[PRESSED] = factor * self.model.limits().tau_max[PRESSED];
            }
        }
        if self.switch.is(Wrong::Stuck) {
            // The force that stops the joint within this period.
            let M = dynamics::mass_matrix(self.model, &q).cholesky().unwrap();
            let qdd = M.solve(&(self.tau - dynamics::bias(self.model, &q, &qd)));
            let mut unit = JointVector::zeros();
            unit[ELBOW] = 1.0;
            let mobility = M.solve(&unit)[ELBOW];
            force[ELBOW] = -(qd[ELBOW] / self.period_s + qdd[ELBOW]) / mobility;
        }
        force
    }

    fn show(&mut self) {
        let truth = self.arm.measure();
        let old = self.shown;
        self.shown = truth;
        if self.switch.is(Wrong::NotANumber) {
            self.shown.qd[2] = f64::NAN;
        } else if self.switch.is(Wrong::Stale) {
            self.shown = old;
        } else if self.switch.is(Wrong::FrozenSensor) {
            self.shown = Measurement { sample: truth.sample, t_ns: truth.t_ns, ..old };
        } else if self.switch.is(Wrong::FrozenPosition) {
            self.shown.q = old.q;
        }
    }
}

impl Plant for Faulty<'_> {
    fn is_simulated(&self) -> bool {
        true
    }

    fn begin_reset(&mut self) {
        self.arm.begin_reset();
        self.tau = dynamics::gravity_torque(self.model, &WAM7_START_POSTURE);
        self.show();
    }

    fn is_ready(&self) -> bool {
        true
    }

    fn measure(&self) -> Measurement {
        self.shown
    }

    fn apply(&mut self, tau: &JointVector) {
        for i in 0..self.model.n_joints() {
            let is_within = tau[i].abs() <= self.model.limits().tau_max[i]
                && (tau[i] - self.tau[i]).abs() <= self.step[i];
            if !is_within {
                self.switch.is_broken.store(true, Ordering::Relaxed);
            }
        }
        self.tau = *tau;
    }

    fn advance(&mut self) {
        self.arm.apply(&(self.tau + self.disturbance()));
        self.arm.advance();
        self.show();
        if self.switch.is(Wrong::Late) {
            std::thread::sleep(Duration::from_micros(4500));
        }
    }
}
