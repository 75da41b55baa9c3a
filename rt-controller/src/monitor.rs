//! What may be wrong with the machine, judged by what the tick knows anyway.
//!
//! Three checks between a sample k and the one before it:
//!
//! - a sample that does not come: the counter of the plant stands still;
//! - positions against speeds: d ← (1 − dt/T) d + (qₖ − qₖ₋₁) − (q̇ₖ + q̇ₖ₋₁) dt/2, which only
//!   rounding and the integrator of the plant keep from zero;
//! - motion against torques: r ← r + (M(qₖ₋₁)(q̇ₖ − q̇ₖ₋₁)/dt − (τₖ₋₁ − hₖ₋₁) − r) dt/T, the residual
//!   of the generalized momentum (De Luca & Mattone, ICRA 2005) to first order: what no torque of
//!   the motors explains.
//!
//! A joint at its stop is stopped within a tick, by a force that is none of the motors': neither its
//! own d nor its own r counts there.

use physics::arm::{ArmModel, JointMatrix, JointVector};
use physics::plant::Measurement;

use crate::config::ControllerConfig;
use crate::fault::Fault;
use crate::wrench::ArmState;

/// Time constants of d and r, s.
const DRIFT_WINDOW_S: f64 = 0.1;
const FORCE_WINDOW_S: f64 = 0.02;
/// Largest |d|, rad: a slack, and what the joint covers at its largest speed in this time, s. The
/// integrator of the plant errs by a share of a period.
const DRIFT_SLACK: f64 = 0.01;
const DRIFT_SLACK_S: f64 = 0.002;
/// Residual that no joint is too weak for, N·m: a wrist's are small, a pancake's impact is not.
const FORCE_FLOOR: f64 = 5.0;
/// A joint closer than this to its limit may touch its stop, rad.
const STOP_MARGIN: f64 = 0.02;
/// Ticks in a row with a residual beyond its limit before it is a fault.
const FORCE_TICKS: u32 = 5;
/// Ticks without any finding after which a cause is gone: longer than the windows.
const CLEAR_TICKS: u32 = 200;

#[derive(Clone, Copy)]
pub(crate) struct Monitor {
    period_s: f64,
    stale_ticks: u32,
    /// Largest d, rad, and r, N·m, of each joint.
    drift_max: JointVector,
    force_max: JointVector,
    last: Option<Step>,
    sample: Option<u64>,
    n_stale: u32,
    drift: JointVector,
    force: JointVector,
    n_forced: u32,
    n_clear: u32,
}

/// A tick and what was commanded in it.
#[derive(Clone, Copy)]
struct Step {
    q: JointVector,
    qd: JointVector,
    mass_matrix: JointMatrix,
    bias: JointVector,
    tau: JointVector,
}

impl Monitor {
    pub fn new(model: &ArmModel, config: &ControllerConfig) -> Monitor {
        let of_limit = model.limits().tau_max * config.disturbance_max;
        Monitor {
            period_s: config.period_s(),
            stale_ticks: config.stale_ticks,
            drift_max: model.limits().qd_max.map(|speed| DRIFT_SLACK + DRIFT_SLACK_S * speed),
            force_max: of_limit.map(|limit| limit.max(FORCE_FLOOR)),
            last: None,
            sample: None,
            n_stale: 0,
            drift: JointVector::zeros(),
            force: JointVector::zeros(),
            n_forced: 0,
            n_clear: 0,
        }
    }

    /// Forgets what was seen: the world may be another one.
    pub fn restart(&mut self) {
        self.blind();
        (self.sample, self.n_stale) = (None, 0);
    }

    /// A sample that is not a number: there is nothing to compare the next one with.
    pub fn blind(&mut self) {
        self.last = None;
        (self.drift, self.force) = (JointVector::zeros(), JointVector::zeros());
        (self.n_forced, self.n_clear) = (0, 0);
    }

    /// Takes in a sample, which must be finite, and the arm's `state` by it.
    pub fn observe(
        &mut self,
        model: &ArmModel,
        measured: &Measurement,
        state: &ArmState,
    ) -> Result<(), Fault> {
        let is_new = self.sample.replace(measured.sample) != Some(measured.sample);
        self.n_stale = if is_new { 0 } else { self.n_stale.saturating_add(1) };
        self.filter(model, measured);
        self.last = Some(Step {
            q: measured.q,
            qd: measured.qd,
            mass_matrix: state.mass_matrix,
            bias: state.bias,
            tau: JointVector::zeros(),
        });
        let found = self.find();
        self.n_clear = if found.is_ok() { self.n_clear.saturating_add(1) } else { 0 };
        found
    }

    /// The torque of this tick, N·m, which acts until the next one.
    pub fn commanded(&mut self, tau: &JointVector) {
        if let Some(last) = &mut self.last {
            last.tau = *tau;
        }
    }

    /// What no torque of the motors explains, N·m.
    pub fn force(&self) -> &JointVector {
        &self.force
    }

    /// The last sample was the one before it again.
    pub fn is_stale(&self) -> bool {
        self.n_stale > 0
    }

    /// Nothing was found for a while.
    pub fn is_clear(&self) -> bool {
        self.n_clear >= CLEAR_TICKS
    }

    fn filter(&mut self, model: &ArmModel, measured: &Measurement) {
        let Some(last) = &self.last else { return };
        let (q, qd, dt) = (&measured.q, &measured.qd, self.period_s);
        let drift = q - last.q - (qd + last.qd) * (dt / 2.0);
        self.drift = self.drift * (1.0 - dt / DRIFT_WINDOW_S) + drift;
        let explained = last.tau - last.bias;
        let force = last.mass_matrix * (qd - last.qd) / dt - explained;
        self.force += (force - self.force) * (dt / FORCE_WINDOW_S);
        let limits = model.limits();
        for i in 0..model.n_joints() {
            let room = (q[i] - limits.q_min[i]).min(limits.q_max[i] - q[i]);
            // What was remembered of a stop goes with it, and so does what is no number.
            if room < STOP_MARGIN || !self.force[i].is_finite() {
                (self.drift[i], self.force[i]) = (0.0, 0.0);
            }
        }
    }

    fn find(&mut self) -> Result<(), Fault> {
        if self.n_stale > self.stale_ticks {
            return Err(Fault::MeasurementStale);
        }
        if is_beyond(&self.drift, &self.drift_max) {
            return Err(Fault::MeasurementInconsistent);
        }
        let is_forced = is_beyond(&self.force, &self.force_max);
        self.n_forced = if is_forced { self.n_forced.saturating_add(1) } else { 0 };
        if self.n_forced > FORCE_TICKS { Err(Fault::UnexpectedForce) } else { Ok(()) }
    }
}

fn is_beyond(v: &JointVector, max: &JointVector) -> bool {
    v.iter().zip(max.iter()).any(|(x, max)| x.abs() > *max)
}
