//! The hot path: measurement in, torque out.
//!
//! Nothing in here allocates, locks, logs, calls the transport or the plant, or panics: the
//! [`Controller`] holds plain copies and one shared reference, and [`Controller::tick`] sees
//! neither ports nor plants. A fault is a code in the record and a damped gravity hold, for the
//! rest of the rollout.

use nalgebra::Vector6;
use physics::arm::{ArmModel, JointVector, dynamics};
use physics::outcome::{Outcome, OutcomeConfig};
use physics::plant::Measurement;
use shm_types::episode::{
    FLAG_IN_CONTACT, FLAG_NEAR_JOINT_LIMIT, FLAG_NEAR_SPEED_LIMIT, FLAG_RATE_LIMITED,
    FLAG_TORQUE_CLIPPED, TickRecord,
};

use crate::config::ControllerConfig;
pub use crate::fault::Fault;
use crate::limits;
use crate::policy::Policy;
use crate::rollout::{Phase, Rollout};
use crate::task::{TaskState, to_world};
use crate::wrench::{ArmState, computed_torque, operational_space_torque};

/// A joint this far beyond its limit, rad, or this many times too fast, is out of control.
const POSITION_TOLERANCE: f64 = 0.2;
const SPEED_TOLERANCE: f64 = 2.0;

/// Everything the hot path keeps between two ticks.
#[derive(Clone, Copy)]
pub struct Controller<'a> {
    model: &'a ArmModel,
    settings: Settings,
    rollout: Rollout,
    tick: u64,
    fault: Fault,
    /// Ticks of Execute and Settle in this rollout, and those with a clipped torque.
    n_executed: u32,
    n_clipped: u32,
    last_tau: JointVector,
    last_q: JointVector,
}

#[derive(Clone, Copy)]
struct Settings {
    posture_stiffness: f64,
    posture_damping: f64,
    torque_step: f64,
    speed_taper: f64,
    joint_margin_rad: f64,
    hold_damping: f64,
}

// The hot state owns nothing whose drop could call the allocator or the transport.
const _: () = assert!(!std::mem::needs_drop::<Controller>());

impl<'a> Controller<'a> {
    /// `q0` is the start posture: where rollouts begin and what the null space is drawn to.
    pub fn new(
        model: &'a ArmModel,
        q0: &JointVector,
        config: &ControllerConfig,
        outcome: &OutcomeConfig,
    ) -> Controller<'a> {
        Controller {
            model,
            settings: Settings {
                posture_stiffness: config.posture_stiffness,
                posture_damping: config.posture_damping,
                torque_step: config.torque_rate * config.period_s(),
                speed_taper: config.speed_taper,
                joint_margin_rad: config.joint_margin_rad,
                hold_damping: config.hold_damping,
            },
            rollout: Rollout::new(q0, config, outcome),
            tick: 0,
            fault: Fault::None,
            n_executed: 0,
            n_clipped: 0,
            last_tau: dynamics::gravity_torque(model, q0),
            last_q: *q0,
        }
    }

    /// Begins a rollout: Approach, then Execute and Settle under `policy`.
    pub fn start(&mut self, policy: &Policy, q: &JointVector) {
        self.fault = Fault::None;
        (self.n_executed, self.n_clipped) = (0, 0);
        self.last_tau = dynamics::gravity_torque(self.model, q);
        self.rollout.start(policy, q);
    }

    /// Exchanges the policy from the next tick on, see [`Rollout::swap`].
    pub fn swap(&mut self, policy: &Policy) {
        self.rollout.swap(policy);
    }

    /// The policy of the rollout, or the last one.
    pub fn policy(&self) -> &Policy {
        self.rollout.policy()
    }

    /// From the next tick on the arm is held: the loop around found a reason.
    pub fn trip(&mut self, fault: Fault) {
        if self.fault == Fault::None {
            self.fault = fault;
        }
    }

    pub fn phase(&self) -> Phase {
        self.rollout.phase()
    }

    pub fn fault(&self) -> Fault {
        self.fault
    }

    /// The tick to come.
    pub fn tick_number(&self) -> u64 {
        self.tick
    }

    /// What the rollout that just ended achieved.
    pub fn outcome(&self) -> Outcome {
        self.rollout.outcome()
    }

    /// Share of that rollout's ticks, from Execute on, in which a torque was clipped at its limit.
    pub fn clipped_share(&self) -> f64 {
        f64::from(self.n_clipped) / f64::from(self.n_executed.max(1))
    }

    /// One tick: fills `record` and returns the torque to apply, N·m, finite and within limits.
    pub fn tick(&mut self, measured: &Measurement, record: &mut TickRecord) -> JointVector {
        *record = TickRecord { tick: self.tick, ..TickRecord::ZERO };
        record.phase = self.rollout.phase() as u32;
        record.t_s = self.rollout.t_s();

        let tau = match self.torque(measured, record) {
            Ok(tau) if self.fault == Fault::None => tau,
            Ok(_) => self.hold(measured),
            Err(fault) => {
                self.fault = fault;
                self.hold(measured)
            }
        };
        if matches!(self.rollout.phase(), Phase::Execute | Phase::Settle) {
            self.n_executed += 1;
            self.n_clipped += u32::from(record.flags & FLAG_TORQUE_CLIPPED != 0);
        }
        self.rollout.advance(self.fault != Fault::None);
        if self.rollout.timed_out() && self.fault == Fault::None {
            self.fault = Fault::ApproachTimeout;
        }

        write_measurement(measured, record);
        record.tau.copy_from_slice(tau.as_slice());
        record.fault = self.fault as u32;
        self.last_tau = tau;
        self.tick += 1;
        tau
    }

    fn torque(
        &mut self,
        measured: &Measurement,
        record: &mut TickRecord,
    ) -> Result<JointVector, Fault> {
        self.check(measured)?;
        let (q, qd) = (&measured.q, &measured.qd);
        self.last_q = *q;
        self.rollout.locate(q);
        let state = ArmState::new(self.model, q, qd);
        let task = TaskState::new(&state.tip);
        record.x.copy_from_slice(task.x.as_slice());
        record.xd.copy_from_slice(task.xd.as_slice());
        self.rollout.observe(&state.tip.X_WP, &measured.object);

        let posture = |q_d: &JointVector| {
            (q_d - q) * self.settings.posture_stiffness - qd * self.settings.posture_damping
        };
        let raw = match self.rollout.phase() {
            Phase::Idle | Phase::Approach => {
                record.attractor = record.x;
                computed_torque(&state, &posture(&self.rollout.posture_reference()))
            }
            Phase::Execute | Phase::Settle => {
                let command = self.rollout.command(&task);
                record.attractor.copy_from_slice(command.attractor.as_slice());
                let xdd_world: Vector6<f64> = to_world(&command.xdd);
                operational_space_torque(&state, &xdd_world, &posture(self.rollout.q0()))
                    .ok_or(Fault::Singular)?
            }
        };
        self.limit(measured, &raw, record)
    }

    fn check(&self, measured: &Measurement) -> Result<(), Fault> {
        let object = &measured.object;
        let object_is_finite =
            object.p_WO.iter().chain(object.R_WO.coords.iter()).all(|x| x.is_finite());
        if !limits::is_finite(&measured.q) || !limits::is_finite(&measured.qd) || !object_is_finite
        {
            return Err(Fault::MeasurementNotFinite);
        }
        let bounds = self.model.limits();
        for i in 0..self.model.n_joints() {
            let q = measured.q[i];
            if q < bounds.q_min[i] - POSITION_TOLERANCE || q > bounds.q_max[i] + POSITION_TOLERANCE
            {
                return Err(Fault::JointOutOfRange);
            }
            if measured.qd[i].abs() > SPEED_TOLERANCE * bounds.qd_max[i] {
                return Err(Fault::Overspeed);
            }
        }
        Ok(())
    }

    /// Joint limits, speed limits, torque clamp, torque rate, finite check: in this order, so that
    /// the last two hold whatever came before.
    fn limit(
        &self,
        measured: &Measurement,
        raw: &JointVector,
        record: &mut TickRecord,
    ) -> Result<JointVector, Fault> {
        let bounds = self.model.limits();
        let settings = &self.settings;
        let (push, near_joint_limit) =
            limits::joint_limit_torque(bounds, &measured.q, settings.joint_margin_rad);
        let (tau, near_speed_limit) =
            limits::taper_speed(bounds, &measured.qd, &(raw + push), settings.speed_taper);
        let (tau, clipped) = limits::clamp_torque(bounds, &tau);
        let (tau, rate_limited) =
            limits::limit_torque_rate(bounds, &self.last_tau, &tau, settings.torque_step);
        for (acted, flag) in [
            (near_joint_limit, FLAG_NEAR_JOINT_LIMIT),
            (near_speed_limit, FLAG_NEAR_SPEED_LIMIT),
            (clipped, FLAG_TORQUE_CLIPPED),
            (rate_limited, FLAG_RATE_LIMITED),
        ] {
            if acted {
                record.flags |= flag;
            }
        }
        if limits::is_finite(&tau) { Ok(tau) } else { Err(Fault::TorqueNotFinite) }
    }

    /// Damped gravity hold: τ = g(q) − D q̇, with what is still known of q and q̇. It obeys clamp
    /// and rate like any other torque.
    fn hold(&self, measured: &Measurement) -> JointVector {
        let bounds = self.model.limits();
        let known = limits::is_finite(&measured.qd) && limits::is_finite(&measured.q);
        let qd = if known { measured.qd } else { JointVector::zeros() };
        let damping = bounds.tau_max * self.settings.hold_damping;
        let tau = dynamics::gravity_torque(self.model, &self.last_q) - damping.component_mul(&qd);
        let (tau, _) = limits::clamp_torque(bounds, &tau);
        limits::limit_torque_rate(bounds, &self.last_tau, &tau, self.settings.torque_step).0
    }
}

fn write_measurement(measured: &Measurement, record: &mut TickRecord) {
    // The record must stay finite: receivers refuse the whole episode otherwise.
    let finite = |x: f64| if x.is_finite() { x } else { 0.0 };
    for i in 0..record.q.len() {
        record.q[i] = finite(measured.q[i]);
        record.qd[i] = finite(measured.qd[i]);
    }
    let object = &measured.object;
    let rotation = object.R_WO.coords; // i, j, k, w
    for i in 0..3 {
        record.object_position[i] = finite(object.p_WO[i]);
        record.object_quaternion[i + 1] = finite(rotation[i]);
    }
    record.object_quaternion[0] = finite(rotation[3]);
    if object.in_contact {
        record.flags |= FLAG_IN_CONTACT;
    }
}
