//! What encodings driven by time share: activations, and outputs fitted to demonstrations by least squares.

use nalgebra::DMatrix;
use shm_types::TASK_DIM;
use shm_types::policy::{ACTIVATION_TIME, LinearSystem, PolicyMsg};

use crate::demonstration::Demonstration;
use crate::parameters::{ParameterError, PolicyIds};

/// Largest entry of a matrix or an offset that a message may carry, in its unit.
const ENTRY_MAX: f64 = 1e6;

/// Activation i, hᵢ(t) ∝ πᵢ 𝒩(t | tᵢ, σᵢ²).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bump {
    pub log_prior: f64,
    /// tᵢ, s.
    pub center: f64,
    /// σᵢ, s.
    pub width: f64,
}

impl Bump {
    /// Those of a policy of systems that is driven by time.
    pub fn of(policy: &PolicyMsg) -> Vec<Bump> {
        let bump = |system: &LinearSystem| Bump {
            log_prior: system.log_prior,
            center: system.center[0],
            width: system.covariance[0].sqrt(),
        };
        policy.systems().iter().map(bump).collect()
    }

    /// A system that does nothing yet, with this activation.
    pub fn system(&self) -> LinearSystem {
        let mut system = LinearSystem { log_prior: self.log_prior, ..LinearSystem::ZERO };
        (system.center[0], system.covariance[0]) = (self.center, self.width * self.width);
        system
    }

    /// (t − tᵢ)/σᵢ.
    pub fn within(&self, t_s: f64) -> f64 {
        (t_s - self.center) / self.width
    }
}

/// Eq. (2), weights: hᵢ(t) at `t_s` (s), which sum to 1. In log space: far from all centres never 0/0.
pub(super) fn weights(bumps: &[Bump], t_s: f64) -> Vec<f64> {
    let log = |bump: &Bump| bump.log_prior - 0.5 * bump.within(t_s).powi(2) - bump.width.ln();
    let logs: Vec<f64> = bumps.iter().map(log).collect();
    let max = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let h: Vec<f64> = logs.iter().map(|log| (log - max).exp()).collect();
    let sum: f64 = h.iter().sum();
    h.into_iter().map(|h| h / sum).collect()
}

/// What was shown at one moment: t, s, and x, ẋ, ẍ in m, rad and s.
pub(super) struct Moment {
    pub t_s: f64,
    pub x: [f64; TASK_DIM],
    pub xd: [f64; TASK_DIM],
    pub xdd: [f64; TASK_DIM],
}

/// All moments of all demonstrations.
pub(super) fn moments(demonstrations: &[Demonstration]) -> Vec<Moment> {
    let of = |demonstration: &Demonstration| {
        let (velocity, acceleration) = demonstration.derivatives();
        let moment = |(k, x): (usize, &[f64; TASK_DIM])| Moment {
            t_s: k as f64 * demonstration.period_s(),
            x: *x,
            xd: velocity[k],
            xdd: acceleration[k],
        };
        demonstration.poses().iter().enumerate().map(moment).collect::<Vec<_>>()
    };
    demonstrations.iter().flat_map(of).collect()
}

/// min over W of ‖Φ W − Y‖² + `ridge`·m̄ ‖W‖² with m̄ the mean of the diagonal of ΦᵀΦ: one column of W (m×p) for
/// each of Y (N×p), of Φ (N×m).
///
/// # Panics
/// Unless `ridge` is positive.
pub(super) fn least_squares(phi: &DMatrix<f64>, y: &DMatrix<f64>, ridge: f64) -> DMatrix<f64> {
    let mut normal = phi.tr_mul(phi);
    let added = ridge * normal.trace() / normal.nrows() as f64;
    (0..normal.nrows()).for_each(|i| normal[(i, i)] += added);
    let factor = normal.cholesky().expect("ΦᵀΦ plus a ridge is positive definite");
    factor.solve(&phi.tr_mul(y))
}

/// A policy of systems with these activations, whose systems do nothing yet.
///
/// Departure from springs: coordinates that are not learnt have no reference that moves; they are held where
/// they begin, so that nothing jumps when the rollout does.
pub(super) fn driven_by_time(
    bumps: &[Bump],
    task_dim: usize,
    demonstrations: &[Demonstration],
) -> PolicyMsg {
    let mut policy = PolicyMsg {
        task_dim: task_dim as u32,
        n_systems: bumps.len() as u32,
        activation: ACTIVATION_TIME,
        duration_s: demonstrations[0].duration_s(),
        ..PolicyMsg::EMPTY
    };
    for (system, bump) in policy.systems.iter_mut().zip(bumps) {
        *system = bump.system();
    }
    // Driven by time nothing is drawn to it, but admission looks whether it is near the arm.
    policy.target = *demonstrations[0].poses().last().expect("a demonstration has poses");
    hold_the_rest(&mut policy, demonstrations);
    policy
}

/// The target of the coordinates that are not learnt: where the first demonstration begins.
pub(super) fn hold_the_rest(policy: &mut PolicyMsg, demonstrations: &[Demonstration]) {
    let d = policy.task_dim as usize;
    policy.target[d..].copy_from_slice(&demonstrations[0].poses()[0][d..]);
}

/// That `policy` is valid and a policy of systems of the shape of `base`.
pub(super) fn check_shape(base: &PolicyMsg, policy: &PolicyMsg) -> Result<(), ParameterError> {
    policy.validate()?;
    let shape =
        |policy: &PolicyMsg| (policy.task_dim, policy.n_systems, policy.activation, policy.output);
    if shape(policy) != shape(base) {
        return Err(ParameterError::Shape {
            found_dim: policy.task_dim,
            found: policy.n_systems,
            task_dim: base.task_dim,
            components: base.n_systems,
        });
    }
    Ok(())
}

/// `policy` under its names, with every entry of its systems within what a message may carry, sealed.
pub(super) fn sealed(mut policy: PolicyMsg, ids: PolicyIds) -> PolicyMsg {
    for system in &mut policy.systems[..policy.n_systems as usize] {
        let matrices = system.of_position.iter_mut().chain(&mut system.of_velocity);
        for value in matrices.chain(&mut system.of_drive).chain(&mut system.offset) {
            *value = value.clamp(-ENTRY_MAX, ENTRY_MAX);
        }
    }
    ids.name(&policy).sealed()
}
