//! The hot path: measurement in, torque out.
//!
//! Nothing in here allocates, locks, logs, calls the transport or the plant, or panics: the
//! [`Controller`] holds plain copies and one shared reference, and [`Controller::tick`] sees
//! neither ports nor plants. A fault is a code in the record and a damped gravity hold: a policy's for
//! the rest of the rollout, the machine's until it is re-armed.

use nalgebra::{Vector3, Vector6};
use physics::arm::{ArmModel, JointVector, dynamics};
use physics::plant::Measurement;
use physics::referee::Referee;
use shm_types::episode::{
    FLAG_NEAR_JOINT_LIMIT, FLAG_NEAR_SPEED_LIMIT, FLAG_RATE_LIMITED, FLAG_TORQUE_CLIPPED,
    TickRecord,
};

use crate::config::ControllerConfig;
pub use crate::fault::Fault;
use crate::hot::estimate::Estimate;
use crate::hot::limits;
use crate::hot::monitor::Monitor;
use crate::hot::policy::Policy;
use crate::hot::posture::{Offset, PostureMove};
use crate::hot::rollout::{Phase, Rollout};
use crate::hot::task_space::{TaskState, to_world};
use crate::hot::wrench::{ArmState, TaskInertia, computed_torque};

/// A joint this far beyond its limit, rad, or this many times too fast, is out of control.
const POSITION_TOLERANCE: f64 = 0.2;
const SPEED_TOLERANCE: f64 = 2.0;

/// Everything the hot path keeps between two ticks.
#[derive(Clone, Copy)]
pub struct Controller<'a> {
    model: &'a ArmModel,
    settings: Settings,
    rollout: Rollout,
    monitor: Monitor,
    tick: u64,
    fault: Fault,
    /// The torque last commanded, N·m: every next one is within a step of it. Always finite.
    /// `None` before the first command, in which the arm rests in what holds it: brakes, its driver.
    last_tau: Option<JointVector>,
    /// `None` while the arm has not shown a posture.
    estimate: Option<Estimate>,
}

#[derive(Clone, Copy)]
struct Settings {
    posture_stiffness: f64,
    posture_damping: f64,
    period_s: f64,
    torque_step: f64,
    speed_taper: f64,
    joint_margin_rad: f64,
    hold_damping: f64,
    /// Where the pan may be: within the radius of the first joint, m, and above the floor, m.
    shoulder: Vector3<f64>,
    workspace_radius_m: f64,
    workspace_floor_m: f64,
}

// The hot state owns nothing whose drop could call the allocator or the transport.
const _: () = assert!(!std::mem::needs_drop::<Controller>());

impl<'a> Controller<'a> {
    /// `q0` is the start posture: where rollouts begin, and what the null space is pulled to until an
    /// operator moves it. `referee` is one that has seen nothing yet.
    pub fn new(
        model: &'a ArmModel,
        q0: &JointVector,
        config: &ControllerConfig,
        referee: &Referee,
    ) -> Controller<'a> {
        Controller {
            model,
            settings: Settings {
                posture_stiffness: config.posture_stiffness,
                posture_damping: config.posture_damping,
                period_s: config.period_s(),
                torque_step: config.torque_rate * config.period_s(),
                speed_taper: config.speed_taper,
                joint_margin_rad: config.joint_margin_rad,
                hold_damping: config.hold_damping,
                shoulder: model.bodies()[0].X_AB0().translation.vector,
                workspace_radius_m: config.workspace_radius_m,
                workspace_floor_m: config.workspace_floor_m,
            },
            rollout: Rollout::new(q0, config, referee),
            monitor: Monitor::new(model, config),
            tick: 0,
            fault: Fault::None,
            last_tau: None,
            estimate: None,
        }
    }

    /// A simulator has made a fresh world, in which the arm rests at the start posture as if held
    /// there. Never on a real arm, which is where it was and feels the torque of before.
    pub fn enter_fresh_world(&mut self) {
        self.monitor.restart();
        let start = Estimate { q: *self.rollout.q0(), qd: JointVector::zeros() };
        self.last_tau = Some(rest_torque(self.model, &start));
        self.estimate = Some(start);
        self.rollout.stay();
    }

    /// Begins a rollout from where the arm is: Approach, then Execute and Settle under `policy`. Not
    /// after a latched fault.
    pub fn start(&mut self, policy: &Policy) {
        if self.fault.latches() {
            return;
        }
        self.fault = Fault::None;
        self.rollout.start(policy);
    }

    /// Exchanges the policy from the next tick on, see [`Rollout::swap`].
    pub fn swap(&mut self, policy: &Policy) {
        self.rollout.swap(policy);
    }

    /// Moves the posture that the null space is drawn to, see [`Rollout::move_posture`].
    pub fn move_posture(&mut self, to: &PostureMove) {
        self.rollout.move_posture(to);
    }

    /// The policy of the rollout, or the last one.
    pub fn policy(&self) -> &Policy {
        self.rollout.policy()
    }

    /// From the next tick on the arm is held: the loop around found a reason. The first fault is the
    /// one that is told, but the machine's comes before all others.
    pub fn trip(&mut self, fault: Fault) {
        if self.fault == Fault::None || (fault.latches() && !self.fault.latches()) {
            self.fault = fault;
        }
    }

    /// The plant is gone: the arm is held until its next one has been watched for a while.
    pub fn lose_plant(&mut self) {
        self.trip(Fault::MeasurementStale);
        self.monitor.blind();
    }

    /// The fault that holds the arm until [`Controller::rearm`].
    pub fn latched(&self) -> Option<Fault> {
        Some(self.fault).filter(|fault| fault.latches())
    }

    /// What latched was seen not long ago.
    pub fn is_cause_present(&self) -> bool {
        !self.monitor.is_clear()
    }

    /// Ends the hold after a latched fault, unless its cause is present: the arm stays where it is.
    pub fn rearm(&mut self) {
        if self.fault.latches() && !self.is_cause_present() {
            self.fault = Fault::None;
            self.monitor.trust_again();
            self.rollout.stay();
        }
    }

    /// What no torque of the motors explains, N·m, low-passed; see `crate::hot::monitor`.
    pub fn unexplained_force(&self) -> &JointVector {
        self.monitor.force()
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

    /// One tick: fills `record` and returns the torque to apply, N·m, finite and within limits.
    pub fn tick(&mut self, measured: &Measurement, record: &mut TickRecord) -> JointVector {
        self.rollout.clock(measured.t_ns);
        *record = TickRecord { tick: self.tick, t_s: self.rollout.t_s(), ..TickRecord::ZERO };
        (record.phase, record.flags) = (self.rollout.phase() as u32, self.rollout.flags());

        let last_tau = *self
            .last_tau
            .get_or_insert_with(|| rest_torque(self.model, &Estimate::shown(measured)));
        let torque = self.torque(measured, &last_tau, record);
        self.locate(measured, &last_tau);
        if let Err(fault) = torque {
            self.trip(fault);
        }
        let tau = match torque {
            Ok(tau) if self.fault == Fault::None => tau,
            _ => self.hold(&last_tau),
        };
        self.rollout.advance(self.fault != Fault::None);
        if self.rollout.timed_out() && self.fault == Fault::None {
            self.fault = Fault::ApproachTimeout;
        }

        crate::hot::measured::write(measured, record);
        record.tau.copy_from_slice(tau.as_slice());
        record.fault = self.fault as u32;
        self.last_tau = Some(tau);
        self.monitor.commanded(&tau);
        self.tick += 1;
        tau
    }

    fn torque(
        &mut self,
        measured: &Measurement,
        last_tau: &JointVector,
        record: &mut TickRecord,
    ) -> Result<JointVector, Fault> {
        if !crate::hot::measured::is_finite(measured) {
            self.monitor.blind();
            return Err(Fault::MeasurementNotFinite);
        }
        let (q, qd) = (&measured.q, &measured.qd);
        let state = ArmState::new(self.model, q, qd);
        self.monitor.observe(self.model, measured, &state)?;
        self.check(measured)?;
        self.rollout.locate(q, qd);
        let task = TaskState::new(&state.tip);
        record.x.copy_from_slice(task.x.as_slice());
        record.xd.copy_from_slice(task.xd.as_slice());
        self.rollout.observe(&state.tip.X_WP, measured);

        let posture = |q_d: &JointVector| {
            (q_d - q) * self.settings.posture_stiffness - qd * self.settings.posture_damping
        };
        let raw = match self.rollout.phase() {
            Phase::Idle | Phase::Approach => {
                record.attractor = record.x;
                computed_torque(&state, &posture(&self.rollout.posture_reference(q)))
            }
            Phase::Execute | Phase::Settle => {
                self.check_workspace(&state)?;
                let command = self.rollout.command(&task);
                record.attractor.copy_from_slice(command.attractor.as_slice());
                let xdd_world: Vector6<f64> = to_world(&command.xdd);
                let inertia = TaskInertia::new(&state).ok_or(Fault::Singular)?;
                let tau = inertia.torque(&state, &xdd_world, &posture(self.rollout.q0()));
                match self.rollout.posture_offset() {
                    Some(offset) => tau + inertia.null_torque(&state, &self.pull(&offset)),
                    None => tau,
                }
            }
        };
        self.limit(measured, last_tau, &raw, record)
    }

    /// What an offset δ from the start posture adds to the null-space acceleration, rad/s²: the reference
    /// q₀ + δ moves, q̈ = k (q₀ + δ − q) − d (q̇ − δ̇) + δ̈.
    fn pull(&self, offset: &Offset) -> JointVector {
        let settings = &self.settings;
        offset.q * settings.posture_stiffness + offset.qd * settings.posture_damping + offset.qdd
    }

    fn check(&self, measured: &Measurement) -> Result<(), Fault> {
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

    /// Only under a policy: an Approach may come back from anywhere.
    fn check_workspace(&self, state: &ArmState) -> Result<(), Fault> {
        let (p, settings) = (&state.tip.X_WP.translation.vector, &self.settings);
        let is_inside = (p - settings.shoulder).norm() <= settings.workspace_radius_m
            && p.z >= settings.workspace_floor_m;
        if is_inside { Ok(()) } else { Err(Fault::OutOfWorkspace) }
    }

    /// Joint limits, speed limits, torque clamp, torque rate, finite check: in this order, so that
    /// the last two hold whatever came before.
    fn limit(
        &self,
        measured: &Measurement,
        last_tau: &JointVector,
        raw: &JointVector,
        record: &mut TickRecord,
    ) -> Result<JointVector, Fault> {
        let bounds = self.model.limits();
        let settings = &self.settings;
        let (tau, near_joint_limit) =
            limits::push_from_joint_limits(bounds, &measured.q, raw, settings.joint_margin_rad);
        let (tau, near_speed_limit) =
            limits::taper_speed(bounds, &measured.qd, &tau, settings.speed_taper);
        let (tau, clipped) = limits::clamp_torque(bounds, &tau);
        let (tau, rate_limited) =
            limits::limit_torque_rate(bounds, last_tau, &tau, settings.torque_step);
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

    /// Where the arm is: as measured or, joint by joint where its sensors are in doubt, as it must
    /// have gone on under `last_tau`.
    fn locate(&mut self, measured: &Measurement, last_tau: &JointVector) {
        let shown = Estimate::shown(measured);
        let is_plausible = shown.is_plausible(self.model);
        let is_new = is_plausible && self.monitor.agrees() && !self.monitor.is_stale();
        let trust = self.monitor.trust();
        match &mut self.estimate {
            None if is_plausible => self.estimate = Some(shown),
            None => {}
            Some(estimate) if is_new && trust.is_full() => *estimate = shown,
            Some(estimate) => {
                estimate.reckon(self.model, last_tau, self.settings.period_s);
                for i in (0..self.model.n_joints()).filter(|i| is_new && trust.believes(*i)) {
                    (estimate.q[i], estimate.qd[i]) = (shown.q[i], shown.qd[i]);
                }
            }
        }
    }

    /// Damped gravity hold: τ = g(q) − D q̇. It obeys clamp and rate like any other torque, and is
    /// finite whatever was measured. An arm that has not shown a posture is left to its brakes.
    fn hold(&self, last_tau: &JointVector) -> JointVector {
        let bounds = self.model.limits();
        let wanted = self.estimate.map_or(JointVector::zeros(), |Estimate { q, qd }| {
            let damping = bounds.tau_max * self.settings.hold_damping;
            dynamics::gravity_torque(self.model, &q) - damping.component_mul(&qd)
        });
        let (tau, _) = limits::clamp_torque(bounds, &wanted);
        let (tau, _) = limits::limit_torque_rate(bounds, last_tau, &tau, self.settings.torque_step);
        if limits::is_finite(&tau) { tau } else { *last_tau }
    }
}

/// What holds a resting arm before the first command, N·m: gravity's torque where the arm can be
/// there, else nothing is known of it.
fn rest_torque(model: &ArmModel, shown: &Estimate) -> JointVector {
    if !shown.is_plausible(model) {
        return JointVector::zeros();
    }
    limits::clamp_torque(model.limits(), &dynamics::gravity_torque(model, &shown.q)).0
}
