//! Admission: what a policy must satisfy before it may drive the arm.

use nalgebra::DMatrix;
use physics::arm::ArmModel;
use shm_types::MAX_ACTIONS;
use shm_types::episode::MAX_RECORDS;
use shm_types::policy::{PolicyMsg, PolicyMsgError};
use thiserror::Error;

use crate::config::ControllerConfig;
use crate::hot::policy::Policy;

/// Bounds of the eigenvalues of Kᵢ, s⁻². Above, 1 kHz no longer samples the oscillation well:
/// ω = √K = 224 rad/s at the upper bound.
pub const STIFFNESS_MIN: f64 = 1e-3;
pub const STIFFNESS_MAX: f64 = 5e4;
/// Strongest damper of a spring, s⁻¹: what a policy's κᵛ may be too.
const DAMPER_MAX: f64 = 1e3;

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
        "duration_s is {duration_s}: with settle_s = {settle_s} it needs {records} records of {MAX_RECORDS}; shorten it or lengthen controller.period_us"
    )]
    Duration { duration_s: f64, settle_s: f64, records: usize },
    #[error(
        "dry run: {fault} at t = {t_s:.3} s; the policy would not get through a rollout, make it \
         softer or slower"
    )]
    DryRunFault { fault: &'static str, t_s: f64 },
    #[error(
        "dry run: joint {joint} reaches its torque limit of {limit} N·m at t = {t_s:.3} s, and \
         {percent:.1} % of the ticks are clipped; controller.dry_run_clipped allows {allowed:.1} %"
    )]
    DryRunTorque { joint: String, limit: f64, t_s: f64, percent: f64, allowed: f64 },
    #[error(
        "n_actions is {found}: this cell's world takes {expected} (0: an arm's springs); run the \
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
    let shoulder = model.bodies()[0].X_AB0().translation.vector;
    // An attractor is no place to reach: it may lie beyond the arm, but not absurdly so.
    let limit = 2.0 * reach(model);
    for (i, component) in message.components().iter().enumerate() {
        let d = message.task_dim as usize;
        let K = DMatrix::from_fn(d, d, |r, c| component.stiffness_at(r, c));
        for &eigenvalue in K.symmetric_eigenvalues().iter() {
            if !(STIFFNESS_MIN..=STIFFNESS_MAX).contains(&eigenvalue) {
                return Err(AdmissionError::Stiffness { component: i, eigenvalue });
            }
            let (ratio, damper) =
                (message.damping_ratio, 2.0 * message.damping_ratio * eigenvalue.sqrt());
            if damper > DAMPER_MAX {
                return Err(AdmissionError::Damper { component: i, ratio, damper });
            }
        }
        let [x, y, z, ..] = component.attractor;
        let distance = (nalgebra::Vector3::new(x, y, z) - shoulder).norm();
        if distance > limit {
            return Err(AdmissionError::Attractor { component: i, x, y, z, distance, limit });
        }
    }
    Ok(Policy::new(message))
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
