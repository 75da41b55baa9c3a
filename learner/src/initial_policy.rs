//! The policy a session starts from: Eq. (5) fitted to one demonstration by least squares.
//!
//! Other stiffnesses than κᴾ, several demonstrations and orientations on the sphere: `placed`, `variability`.

pub(crate) mod placed;
pub(crate) mod variability;

use nalgebra::{DMatrix, DVector};
use shm_types::policy::{PolicyMsg, packed_index};
use shm_types::{MAX_COMPONENTS, TASK_DIM};

use crate::activation::{Activation, activations};
use crate::demonstration::Demonstration;
use crate::orientation::Orientation;
pub use variability::InitialStiffness;

/// Weight of the ridge relative to the mean diagonal of HᵀH: far below the fit's resolution, it
/// only keeps the normal equations solvable when components outnumber what the data shows.
const RIDGE: f64 = 1e-9;

/// Shape and gains of the initial policy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InitialPolicyConfig {
    /// Learnt coordinates: 3, 4 or 6.
    pub task_dim: usize,
    pub n_components: usize,
    /// κᴾ, s⁻²; κᵛ = 2√κᴾ (critically damped).
    pub kappa_p: f64,
    pub initial_stiffness: InitialStiffness,
    /// Stiffness from variability is at most so many times κᴾ, and at least so small a part of it.
    pub stiffness_range: f64,
    pub orientation: Orientation,
    /// ζ of dampers that follow the stiffness; 0 for κᵛ whatever the stiffness.
    pub damping_ratio: f64,
    pub activation: Activation,
    /// α of the decay activation, s⁻¹.
    pub decay_rate: f64,
    /// σ of an activation relative to the spacing of the centres.
    pub width_ratio: f64,
    /// Gains of the coordinates that are not learnt, s⁻² and s⁻¹.
    pub orientation_stiffness: f64,
    pub orientation_damping: f64,
}

impl Default for InitialPolicyConfig {
    fn default() -> Self {
        InitialPolicyConfig {
            task_dim: 4,
            n_components: 8,
            kappa_p: 200.0,
            initial_stiffness: InitialStiffness::default(),
            stiffness_range: 4.0,
            orientation: Orientation::default(),
            damping_ratio: 0.0,
            activation: Activation::Time,
            decay_rate: 2.0,
            width_ratio: 0.5,
            orientation_stiffness: 400.0,
            orientation_damping: 40.0,
        }
    }
}

/// Sec. 3.1, initial policy: Eq. (5) solved for its attractor along the demonstration,
///
/// y(t) = x + (ẍ + κᵛẋ)/κᴾ ≈ Σᵢ hᵢ(t) μᵢ,  Kᵢ = κᴾ I,  κᵛ = 2√κᴾ,
///
/// with 2ζ√κᴾ for κᵛ where dampers follow the stiffness, μ by least squares over all samples. Coordinates
/// from `task_dim` on are fitted in the same way with the gains of the orientation controller that follows
/// them. The message is sealed, without
/// session and rollout. Source: the paper refers to its reference 36 for the method.
pub fn initial_policy(demonstration: &Demonstration, config: &InitialPolicyConfig) -> PolicyMsg {
    let mut policy = frame(config, demonstration.duration_s());
    let (decay_rate, critical) = (policy.decay_rate, policy.damping);
    let damping = match config.damping_ratio {
        0.0 => critical,
        ratio => ratio * critical,
    };
    let layout = component_layout(config, demonstration.duration_s());
    let n_samples = demonstration.poses().len();
    let rows: Vec<Vec<f64>> = (0..n_samples)
        .map(|k| {
            let t_s = k as f64 * demonstration.period_s();
            activations(&layout, config.activation.drive(t_s, decay_rate))
        })
        .collect();
    let h = DMatrix::from_fn(n_samples, config.n_components, |k, i| rows[k][i]);
    let (velocity, acceleration) = demonstration.derivatives();
    for coordinate in 0..TASK_DIM {
        let (kp, kv) = if coordinate < config.task_dim {
            (config.kappa_p, damping)
        } else {
            (config.orientation_stiffness, config.orientation_damping)
        };
        let y = DVector::from_fn(n_samples, |k, _| {
            let (xd, xdd) = (velocity[k][coordinate], acceleration[k][coordinate]);
            demonstration.poses()[k][coordinate] + (xdd + kv * xd) / kp
        });
        let mu = least_squares(&h, &y);
        for (component, value) in policy.components.iter_mut().zip(mu.iter()) {
            component.attractor[coordinate] = *value;
        }
    }
    policy.sealed()
}

/// The policy without its attractors: shape, gains, activations and Kᵢ = κᴾ I, over `duration_s` (s). Not sealed.
pub(crate) fn frame(config: &InitialPolicyConfig, duration_s: f64) -> PolicyMsg {
    assert!((1..=MAX_COMPONENTS).contains(&config.n_components), "validate the configuration");
    let decays = config.activation == Activation::Decay;
    let mut policy = PolicyMsg {
        task_dim: config.task_dim as u32,
        n_components: config.n_components as u32,
        activation: config.activation.code(),
        duration_s,
        decay_rate: if decays { config.decay_rate } else { 0.0 },
        damping: 2.0 * config.kappa_p.sqrt(),
        damping_ratio: config.damping_ratio,
        orientation: config.orientation.code(),
        orientation_stiffness: config.orientation_stiffness,
        orientation_damping: config.orientation_damping,
        ..PolicyMsg::EMPTY
    };
    let layout = component_layout(config, duration_s);
    for (component, (center, width)) in policy.components.iter_mut().zip(layout) {
        (component.center, component.width) = (center, width);
        for row in 0..config.task_dim {
            component.stiffness[packed_index(row, row)] = config.kappa_p;
        }
    }
    policy
}

/// Centre and width of each activation, in the unit of its driving variable.
///
/// Sec. 3, Fig. 1 (time): centres evenly over [0, T], cᵢ = iT/(n−1), σ = width_ratio × spacing.
/// Driven by decay the centres are the values of s at those times, cᵢ = exp(−α iT/(n−1)), and each
/// width follows the mean spacing to its neighbours.
fn component_layout(config: &InitialPolicyConfig, duration_s: f64) -> Vec<(f64, f64)> {
    let n = config.n_components;
    if n == 1 {
        // Always fully active; the width only has to be admissible.
        return vec![(config.activation.drive(0.0, config.decay_rate), 1.0)];
    }
    let center = |i: usize| {
        let t_s = duration_s * i as f64 / (n - 1) as f64;
        config.activation.drive(t_s, config.decay_rate)
    };
    (0..n)
        .map(|i| {
            let (before, after) = (i.saturating_sub(1), (i + 1).min(n - 1));
            let spacing = (center(after) - center(before)).abs() / (after - before) as f64;
            (center(i), config.width_ratio * spacing)
        })
        .collect()
}

/// min over μ of ‖Hμ − y‖² + small ridge, through the normal equations.
///
/// Rows of H sum to 1, so subtracting the mean of y shifts μ by the same constant; the ridge then
/// pulls towards the mean of the data instead of the world's origin.
fn least_squares(h: &DMatrix<f64>, y: &DVector<f64>) -> DVector<f64> {
    let mean = y.mean();
    let mut normal = h.tr_mul(h);
    let ridge = RIDGE * normal.trace() / normal.nrows() as f64;
    (0..normal.nrows()).for_each(|i| normal[(i, i)] += ridge);
    let right = h.tr_mul(&y.add_scalar(-mean));
    let factor = normal.cholesky().expect("HᵀH plus a ridge is positive definite");
    factor.solve(&right).add_scalar(mean)
}

#[cfg(test)]
mod tests;
