//! Detects hardware faults from values that the tick computes anyway.
//!
//! Three checks between a sample k and the one before it, dt apart by the plant's own stamps: a loop
//! that was late, or missed deadlines, sees a longer dt and no force.
//!
//! - a sample that does not come: the plant's counter or its clock stands still;
//! - positions against speeds: d ← (1 − dt/T) d + (qₖ − qₖ₋₁) − (q̇ₖ + q̇ₖ₋₁) dt/2, which only
//!   rounding and the integrator of the plant keep from zero;
//! - motion against torques: r ← r + (M(qₖ₋₁)(q̇ₖ − q̇ₖ₋₁)/dt − (τₖ₋₁ − hₖ₋₁) − r) dt/T, the residual
//!   of the generalized momentum (De Luca & Mattone, ICRA 2005) to first order: what no torque of
//!   the motors explains.
//!
//! Over a long gap nothing can be compared: the sums start anew.
//!
//! A joint at its stop is stopped within a tick, by a force that is none of the motors': neither its
//! own d nor its own r counts there.

use physics::arm::{ArmModel, JointMatrix, JointVector};
use physics::plant::Measurement;

use crate::config::ControllerConfig;
use crate::fault::Fault;
use crate::hot::limits;
use crate::hot::trust::Trust;
use crate::hot::wrench::ArmState;

/// Time constants of d and r, s.
const DRIFT_WINDOW_S: f64 = 0.1;
const FORCE_WINDOW_S: f64 = 0.02;
/// Largest |d|, rad: a slack, and what the joint covers at its largest speed in this time, s. The
/// integrator of the plant errs by a share of a period.
const DRIFT_SLACK: f64 = 0.01;
const DRIFT_SLACK_S: f64 = 0.002;
/// Residual that no joint is too weak for, N·m: a wrist's are small, the impact of a light object is not.
const FORCE_FLOOR: f64 = 5.0;
/// A joint closer than this to its limit may touch its stop, rad.
const STOP_MARGIN: f64 = 0.02;
/// Longest time between two samples that are compared, s: beyond, torques and speeds in between say
/// too little of each other.
const GAP_MAX_S: f64 = 0.01;
/// The sums are kept within this multiple of what is a fault, so that one absurd sample is forgotten
/// as soon as any other.
const SATURATION: f64 = 3.0;
/// A sample agrees with the one before it as long as no joint's position lags behind its speed by
/// more than this share of the way, and this slack, rad; and d by more than this share of its
/// largest, of which normal operation stays below a quarter (ADR 13).
const AGREEMENT_SLACK: f64 = 2e-4;
const AGREEMENT_OF_WAY: f64 = 0.5;
const AGREEMENT_OF_DRIFT: f64 = 1.0 / 3.0;
/// Ticks in a row with a residual beyond its limit before it is a fault.
const FORCE_TICKS: u32 = 5;
/// Ticks without any finding after which a cause is gone: longer than the windows.
pub(crate) const CLEAR_TICKS: u32 = 200;

#[derive(Clone, Copy)]
pub(crate) struct Monitor {
    stale_ticks: u32,
    /// Largest d, rad, and r, N·m, of each joint.
    drift_max: JointVector,
    force_max: JointVector,
    last: Option<Step>,
    stamp: Option<Stamp>,
    n_stale: u32,
    /// Samples in a row that came too long after the one before.
    n_gaps: u32,
    drift: JointVector,
    force: JointVector,
    /// Positions and speeds of the last two samples tell the same story.
    agrees: bool,
    n_forced: u32,
    n_clear: u32,
    trust: Trust,
}

/// Number and time of a sample.
#[derive(Clone, Copy)]
struct Stamp {
    sample: u64,
    t_ns: u64,
}

/// A sample and what was commanded since.
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
            stale_ticks: config.stale_ticks,
            drift_max: model.limits().qd_max.map(|speed| DRIFT_SLACK + DRIFT_SLACK_S * speed),
            force_max: of_limit.map(|limit| limit.max(FORCE_FLOOR)),
            last: None,
            stamp: None,
            n_stale: 0,
            n_gaps: 0,
            drift: JointVector::zeros(),
            force: JointVector::zeros(),
            agrees: true,
            n_forced: 0,
            n_clear: 0,
            trust: Trust::FULL,
        }
    }

    /// Forgets what was seen: the world may be another one.
    pub fn restart(&mut self) {
        self.blind();
        (self.stamp, self.n_stale, self.n_gaps) = (None, 0, 0);
        self.trust = Trust::FULL;
    }

    /// A sample that is not a number: there is nothing to compare the next one with.
    pub fn blind(&mut self) {
        self.forget();
        self.n_clear = 0;
    }

    fn forget(&mut self) {
        self.last = None;
        (self.drift, self.force) = (JointVector::zeros(), JointVector::zeros());
        (self.agrees, self.n_forced) = (true, 0);
    }

    /// Takes in a sample, which must be finite, and the arm's `state` by it.
    pub fn observe(
        &mut self,
        model: &ArmModel,
        measured: &Measurement,
        state: &ArmState,
    ) -> Result<(), Fault> {
        let stamp = Stamp { sample: measured.sample, t_ns: measured.t_ns };
        let last = self.stamp.replace(stamp);
        let is_new = last.is_none_or(|last| last.sample != stamp.sample && last.t_ns < stamp.t_ns);
        self.n_stale = if is_new { 0 } else { self.n_stale.saturating_add(1) };
        let found = match is_new {
            true => {
                let dt_s = last.map_or(0.0, |last| (stamp.t_ns - last.t_ns) as f64 / 1e9);
                self.compare(model, measured, state, dt_s)
            }
            false => Ok(()),
        };
        // A clock that only leaps shows as little as one that stands still.
        if found == Err(Fault::MeasurementInconsistent) {
            self.trust.doubt();
        }
        let found = match self.n_stale.max(self.n_gaps) > self.stale_ticks {
            true => Err(Fault::MeasurementStale),
            false => found,
        };
        self.n_clear = if found.is_ok() { self.n_clear.saturating_add(1) } else { 0 };
        found
    }

    /// Takes in a new sample, `dt_s` after the last one.
    fn compare(
        &mut self,
        model: &ArmModel,
        measured: &Measurement,
        state: &ArmState,
        dt_s: f64,
    ) -> Result<(), Fault> {
        if dt_s > GAP_MAX_S {
            self.n_gaps = self.n_gaps.saturating_add(1);
            self.forget();
        } else {
            self.n_gaps = 0;
        }
        let found = match self.last {
            Some(last) => self.filter(model, measured, &last, dt_s),
            None => Ok(()),
        };
        self.last = Some(Step {
            q: measured.q,
            qd: measured.qd,
            mass_matrix: state.mass_matrix,
            bias: state.bias,
            tau: JointVector::zeros(),
        });
        found.and(self.find())
    }

    /// The torque of this tick, N·m, which acts until another is commanded.
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

    /// The last sample can be believed, as far as the one before it says.
    pub fn agrees(&self) -> bool {
        self.agrees
    }

    /// Which joints can be, after a contradiction.
    pub fn trust(&self) -> &Trust {
        &self.trust
    }

    /// A person says that the sensors are well again.
    pub fn trust_again(&mut self) {
        self.trust = Trust::FULL;
    }

    /// Nothing was found for a while.
    pub fn is_clear(&self) -> bool {
        self.n_clear >= CLEAR_TICKS
    }

    /// # Errors
    /// [`Fault::MeasurementInconsistent`] when the numbers are too large to compare.
    fn filter(
        &mut self,
        model: &ArmModel,
        measured: &Measurement,
        last: &Step,
        dt: f64,
    ) -> Result<(), Fault> {
        let (q, qd) = (&measured.q, &measured.qd);
        let way = (qd + last.qd) * (dt / 2.0);
        let drift = q - last.q - way;
        self.drift = self.drift * (1.0 - dt / DRIFT_WINDOW_S) + drift;
        self.trust.follow(&way, &drift);
        let lag_max = way.map(|way| AGREEMENT_SLACK + AGREEMENT_OF_WAY * way.abs());
        self.agrees = !is_beyond(&drift, &lag_max)
            && !is_beyond(&self.drift, &(self.drift_max * AGREEMENT_OF_DRIFT));
        let explained = last.tau - last.bias;
        let force = last.mass_matrix * (qd - last.qd) / dt - explained;
        self.force += (force - self.force) * (dt / FORCE_WINDOW_S).min(1.0);
        if !limits::is_finite(&self.drift) || !limits::is_finite(&self.force) {
            self.forget();
            return Err(Fault::MeasurementInconsistent);
        }
        let limits = model.limits();
        for i in 0..model.n_joints() {
            let saturate = |x: f64, max: f64| x.clamp(-SATURATION * max, SATURATION * max);
            self.drift[i] = saturate(self.drift[i], self.drift_max[i]);
            self.force[i] = saturate(self.force[i], self.force_max[i]);
            let room = (q[i] - limits.q_min[i]).min(limits.q_max[i] - q[i]);
            // What was remembered of a stop goes with it.
            if room < STOP_MARGIN {
                (self.drift[i], self.force[i]) = (0.0, 0.0);
            }
        }
        Ok(())
    }

    fn find(&mut self) -> Result<(), Fault> {
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
