//! Admission: what a policy must satisfy before it may drive the arm.

mod springs;
mod systems;

use nalgebra::Vector3;
use physics::arm::ArmModel;
use shm_types::episode::MAX_RECORDS;
use shm_types::policy::{PolicyMsg, PolicyMsgError};
use shm_types::{MAX_ACTIONS, TASK_DIM};
use thiserror::Error;

use crate::config::ControllerConfig;
use crate::hot::policy::Policy;

/// Bounds of the eigenvalues of Kᵢ, s⁻². Above, 1 kHz no longer samples the oscillation well:
/// ω = √K = 224 rad/s at the upper bound.
pub const STIFFNESS_MIN: f64 = 1e-3;
pub const STIFFNESS_MAX: f64 = 5e4;
/// Strongest damper of a spring, s⁻¹: what a policy's κᵛ may be too.
pub const DAMPER_MAX: f64 = 1e3;
/// Bounds of the eigenvalues of Σᵢ, in units of ξʷ squared: 10⁻⁴ to 100 of standard deviation.
pub const COVARIANCE_MIN: f64 = 1e-8;
pub const COVARIANCE_MAX: f64 = 1e4;
/// Bounds of the eigenvalues of P, whose scale means nothing: at most 10⁶ apart, the checks keep their
/// digits.
pub const CERTIFICATE_MIN: f64 = 1e-3;
pub const CERTIFICATE_MAX: f64 = 1e3;
/// Every system of a field of the state must contract at least so fast in the norm of P, s⁻¹:
/// ½ (P Aᵢ + Aᵢᵀ P) ≼ −c P.
pub const CONTRACTION_MIN: f64 = 1e-3;
/// What a system may leave at the target, m/s or rad/s: rounding.
pub const REST_MAX: f64 = 1e-6;

/// Why a policy was not admitted.
#[derive(Debug, Error, PartialEq)]
pub enum AdmissionError {
    #[error(transparent)]
    Message(#[from] PolicyMsgError),
    #[error(
        "component {component}: stiffness has the eigenvalue {eigenvalue:.3e} s⁻²: it must lie within {STIFFNESS_MIN:e}..={STIFFNESS_MAX:e}, so that the spring attracts and can be sampled"
    )]
    Stiffness { component: usize, eigenvalue: f64 },
    #[error(
        "component {component}: with damping_ratio = {ratio} its damper is {damper:.3e} s⁻¹: at most {DAMPER_MAX:e} can be sampled; lower the ratio or the stiffness"
    )]
    Damper { component: usize, ratio: f64, damper: f64 },
    #[error(
        "component {component}: attractor ({x:.2}, {y:.2}, {z:.2}) m is {distance:.2} m from the shoulder; attractors farther than {limit:.2} m are refused"
    )]
    Attractor { component: usize, x: f64, y: f64, z: f64, distance: f64, limit: f64 },
    #[error(
        "target ({x:.2}, {y:.2}, {z:.2}) m is {distance:.2} m from the shoulder; targets farther than {limit:.2} m are refused"
    )]
    Target { x: f64, y: f64, z: f64, distance: f64, limit: f64 },
    #[error(
        "system {system}: covariance has the eigenvalue {eigenvalue:.3e}: it must lie within {COVARIANCE_MIN:e}..={COVARIANCE_MAX:e}; fit with a larger regularization"
    )]
    Covariance { system: usize, eigenvalue: f64 },
    #[error(
        "system {system}: {field} has the norm {norm:.3e}: at most {max:.3e} can be sampled; make the movement slower or lower following"
    )]
    Gain { system: usize, field: &'static str, norm: f64, max: f64 },
    #[error(
        "system {system}: {field} is not zero, but {why}: set it to zero, or choose another output or activation"
    )]
    Unused { system: usize, field: &'static str, why: &'static str },
    #[error(
        "activation = state with output = acceleration has no certificate here: use output = velocity, or let time or decay drive the activations"
    )]
    StateOfAcceleration,
    #[error(
        "certificate has the eigenvalue {eigenvalue:.3e}: it must lie within {CERTIFICATE_MIN:e}..={CERTIFICATE_MAX:e}; use the P the systems were fitted with, scaled to that"
    )]
    Certificate { eigenvalue: f64 },
    #[error(
        "system {system}: ½ (PA + AᵀP) has the eigenvalue {eigenvalue:.3e} s⁻¹ relative to P: it must be at most -{CONTRACTION_MIN:e}, so that the field comes to rest at the target; fit the systems under PA + AᵀP ≺ 0"
    )]
    Contraction { system: usize, eigenvalue: f64 },
    #[error(
        "system {system}: at the target its speed is {speed:.3e} m/s or rad/s; at most \
         {REST_MAX:e} is allowed: set offset = −of_position · target, on the sphere with zeros \
         for the target's rotation"
    )]
    Rest { system: usize, speed: f64 },
    #[error(
        "system {system}: following = {following} s⁻¹ is too slow for this field: the arm lags behind it and may not come to rest; use more than {needed:.1} s⁻¹, or systems that are slower or turn less"
    )]
    Following { system: usize, following: f64, needed: f64 },
    #[error(
        "duration_s is {duration_s}: with settle_s = {settle_s} it needs {records} records of {MAX_RECORDS}; shorten it or lengthen controller.period_us"
    )]
    Duration { duration_s: f64, settle_s: f64, records: usize },
    #[error(
        "dry run: {fault} at t = {t_s:.3} s; the policy would not complete a rollout; make it \
         softer or slower"
    )]
    DryRunFault { fault: &'static str, t_s: f64 },
    #[error(
        "dry run: joint {joint} reaches its torque limit of {limit} N·m at t = {t_s:.3} s, and \
         {percent:.1} % of the ticks are clipped; controller.dry_run_clipped allows {allowed:.1} %"
    )]
    DryRunTorque { joint: String, limit: f64, t_s: f64, percent: f64, allowed: f64 },
    #[error(
        "n_actions is {found}: this cell's world takes {expected} (0: a policy of an arm); run the \
         learner with the task of the controller"
    )]
    Actions { found: u32, expected: usize },
}

/// Records that a rollout of a policy of this duration can fill.
pub fn records_needed(duration_s: f64, config: &ControllerConfig) -> usize {
    let record_s = config.period_s() * config.record_stride() as f64;
    ((duration_s + config.settle_s) / record_s).ceil() as usize + 2
}

/// Checks everything that can be checked without moving, and converts.
pub fn admit(
    message: &PolicyMsg,
    model: &ArmModel,
    config: &ControllerConfig,
) -> Result<Policy, AdmissionError> {
    message.validate()?;
    if message.n_actions > 0 {
        return Err(AdmissionError::Actions { found: message.n_actions, expected: 0 });
    }
    let records = records_needed(message.duration_s, config);
    if records > MAX_RECORDS {
        let (duration_s, settle_s) = (message.duration_s, config.settle_s);
        return Err(AdmissionError::Duration { duration_s, settle_s, records });
    }
    let room = Room::of(model);
    match message.n_systems {
        0 => springs::check(message, &room)?,
        _ => systems::check(message, &room)?,
    }
    Ok(Policy::new(message))
}

/// Where attractors and targets may lie. They are no places to reach: they may be beyond the arm, but
/// not absurdly so.
struct Room {
    shoulder: Vector3<f64>,
    /// Largest distance from the shoulder, m.
    limit: f64,
}

impl Room {
    fn of(model: &ArmModel) -> Room {
        let shoulder = model.bodies()[0].X_AB0().translation.vector;
        Room { shoulder, limit: 2.0 * reach(model) }
    }

    /// From the shoulder to the position of `x`, m, if that is too far.
    fn excess(&self, x: &[f64; TASK_DIM]) -> Option<f64> {
        let distance = (Vector3::new(x[0], x[1], x[2]) - self.shoulder).norm();
        (distance > self.limit).then_some(distance)
    }
}

/// Checks an action for a world that takes `dim` numbers.
pub fn admit_action(message: &PolicyMsg, dim: usize) -> Result<Action, AdmissionError> {
    message.validate()?;
    if message.n_actions as usize != dim {
        return Err(AdmissionError::Actions { found: message.n_actions, expected: dim });
    }
    Ok(Action(message.action))
}

/// An admitted action; entries beyond the world's dimension are not used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Action(pub [f64; MAX_ACTIONS]);

/// An upper bound of the arm's reach from its first joint, m.
fn reach(model: &ArmModel) -> f64 {
    let links = model.bodies().iter().skip(1).map(|body| body.X_AB0().translation.vector.norm());
    links.sum::<f64>() + model.tip_offset().translation.vector.norm()
}
