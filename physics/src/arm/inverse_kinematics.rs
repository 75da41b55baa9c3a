//! Is a pose within reach? Damped least squares within the joint limits.
//!
//! Meant for checking a demonstration before it is played, not for the control loop.

use nalgebra::{Isometry3, SMatrix, Vector6};

use super::kinematics::TipKinematics;
use super::model::ArmModel;
use super::{Jacobian, JointVector};

/// The search ends here, far below what a recording resolves.
const CONVERGED_M: f64 = 1e-8;
const CONVERGED_RAD: f64 = 1e-8;
/// It also ends where no joint moves any more, rad.
const STATIONARY_RAD: f64 = 1e-11;
/// What may remain in the directions in which the joints can still move the tip.
const CONTROLLED_TOLERANCE_M: f64 = 1e-6;
const CONTROLLED_TOLERANCE_RAD: f64 = 1e-6;
/// What may remain in the other directions. An arm with fewer than six joints has such directions
/// everywhere; a recorded, rounded and resampled pose of its own lies this near to what it can do.
const TOLERANCE_M: f64 = 1e-3;
const TOLERANCE_RAD: f64 = 5e-3;
const MAX_ITERATIONS: usize = 300;

/// Why no joint position was found.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum IkError {
    /// The search ended away from the target.
    #[error(
        "the pose is not within reach: {} m and {} rad remain{}",
        significant(*position_error_m), significant(*orientation_error_rad), advice(*n_joints)
    )]
    OutOfReach { position_error_m: f64, orientation_error_rad: f64, n_joints: usize },
    /// The target or the start is not finite.
    #[error("the target pose or the start posture is not finite; check where it comes from")]
    NotFinite,
}

/// Three significant digits, without an exponent.
fn significant(x: f64) -> String {
    let digits = 2.0 - x.abs().max(1e-12).log10().floor();
    format!("{x:.*}", digits.clamp(0.0, 12.0) as usize)
}

fn advice(n_joints: usize) -> String {
    if n_joints >= 6 {
        return "; move the target closer or start from a nearer posture".into();
    }
    format!(
        "; an arm with {n_joints} joints controls only {n_joints} of the six coordinates of a pose: \
         record a movement of this arm, or move the target closer"
    )
}

/// Finds joint positions (rad) within the limits that put the tip at `X_WP_target`.
///
/// Levenberg-Marquardt: Δq = Jᵀ(JJᵀ + λ²I)⁻¹e on the joints that are free to move, λ² shrinking
/// with success and growing with failure. The result depends on `q_start` (a redundant arm has
/// many solutions; the nearby one is found) and on nothing else. The start is first clamped into
/// the limits.
///
/// The tip gets exactly there along the directions that the joints control, the range of J; across
/// them, it may end up to 1 mm and 5 mrad away, at the least-squares compromise.
///
/// # Errors
/// [`IkError`]; "out of reach" also covers a local minimum, try another start.
pub fn solve(
    model: &ArmModel,
    X_WP_target: &Isometry3<f64>,
    q_start: &JointVector,
) -> Result<JointVector, IkError> {
    let target_is_finite = X_WP_target.to_homogeneous().iter().all(|x| x.is_finite());
    if !target_is_finite || !q_start.iter().all(|x| x.is_finite()) {
        return Err(IkError::NotFinite);
    }
    let mut q = clamp(model, q_start);
    let mut error = tip_error(model, X_WP_target, &q);
    let mut lambda_squared = 1e-3;
    for _ in 0..MAX_ITERATIONS {
        if is_within(&error, CONVERGED_M, CONVERGED_RAD) {
            return Ok(q);
        }
        let dq = step(model, &q, &error, lambda_squared);
        if dq.amax() < STATIONARY_RAD {
            break;
        }
        let q_next = clamp(model, &(q + dq));
        let error_next = tip_error(model, X_WP_target, &q_next);
        if error_next.norm_squared() < error.norm_squared() {
            (q, error) = (q_next, error_next);
            lambda_squared = (lambda_squared * 0.2).max(1e-12);
        } else {
            lambda_squared *= 5.0;
        }
    }
    let controlled = controlled_part(model, &q, &error);
    if is_within(&error, TOLERANCE_M, TOLERANCE_RAD)
        && is_within(&controlled, CONTROLLED_TOLERANCE_M, CONTROLLED_TOLERANCE_RAD)
    {
        return Ok(q);
    }
    Err(IkError::OutOfReach {
        position_error_m: error.fixed_rows::<3>(0).norm(),
        orientation_error_rad: error.fixed_rows::<3>(3).norm(),
        n_joints: model.n_joints(),
    })
}

/// What the joints could still take out of `error`: J J⁺ e, its projection on the range of J.
fn controlled_part(model: &ArmModel, q: &JointVector, error: &Vector6<f64>) -> Vector6<f64> {
    let J = TipKinematics::new(model, q, &JointVector::zeros()).J;
    J * step(model, q, error, 1e-9)
}

/// The damped least-squares step, without the joints that a limit holds back.
fn step(
    model: &ArmModel,
    q: &JointVector,
    error: &Vector6<f64>,
    lambda_squared: f64,
) -> JointVector {
    let mut J: Jacobian = TipKinematics::new(model, q, &JointVector::zeros()).J;
    let limits = model.limits();
    // Each joint can be taken out at most once.
    for _ in 0..=model.n_joints() {
        let damped = J * J.transpose() + SMatrix::<f64, 6, 6>::identity() * lambda_squared;
        let Some(cholesky) = damped.cholesky() else { return JointVector::zeros() };
        let dq = J.transpose() * cholesky.solve(error);
        let is_held = |i: &usize| {
            (q[*i] <= limits.q_min[*i] && dq[*i] < 0.0)
                || (q[*i] >= limits.q_max[*i] && dq[*i] > 0.0)
        };
        match (0..model.n_joints()).find(is_held) {
            Some(held) => J.column_mut(held).fill(0.0),
            None => return dq,
        }
    }
    JointVector::zeros()
}

/// Position error (m) and rotation vector (rad) from the tip to the target, world axes.
fn tip_error(model: &ArmModel, X_WP_target: &Isometry3<f64>, q: &JointVector) -> Vector6<f64> {
    let X_WP = super::kinematics::tip_pose(model, q);
    let p = X_WP_target.translation.vector - X_WP.translation.vector;
    let r = (X_WP_target.rotation * X_WP.rotation.inverse()).scaled_axis();
    Vector6::new(p.x, p.y, p.z, r.x, r.y, r.z)
}

fn is_within(error: &Vector6<f64>, position_m: f64, orientation_rad: f64) -> bool {
    error.fixed_rows::<3>(0).norm() < position_m
        && error.fixed_rows::<3>(3).norm() < orientation_rad
}

fn clamp(model: &ArmModel, q: &JointVector) -> JointVector {
    let limits = model.limits();
    let mut clamped = *q;
    for i in 0..model.n_joints() {
        clamped[i] = q[i].clamp(limits.q_min[i], limits.q_max[i]);
    }
    clamped
}
