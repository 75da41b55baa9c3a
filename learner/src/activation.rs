//! Normalised Gaussian activations hᵢ of Eqs. (2) and (5).

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use shm_types::policy::{ACTIVATION_DECAY, ACTIVATION_TIME, PolicyMsg};

/// What drives the activations of a policy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Activation {
    /// Time since the start of the rollout, s.
    Time,
    /// s = exp(−α t), the canonical system below Eq. (3).
    Decay,
}

impl Activation {
    /// The code of this activation in a policy message.
    pub fn code(self) -> u32 {
        match self {
            Activation::Time => ACTIVATION_TIME,
            Activation::Decay => ACTIVATION_DECAY,
        }
    }

    /// τ ṡ = −α s with s(0) = 1 and τ = 1: the driving variable at `t_s` (s), for α in s⁻¹.
    pub fn drive(self, t_s: f64, decay_rate: f64) -> f64 {
        match self {
            Activation::Time => t_s,
            Activation::Decay => (-decay_rate * t_s).exp(),
        }
    }
}

/// Eq. (2), weights: hᵢ(s) = 𝒩(s | cᵢ, σᵢ²) / Σₖ 𝒩(s | cₖ, σₖ²), with equal priors.
///
/// `centers_widths` holds (cᵢ, σᵢ) in the unit of `drive`; the result sums to 1. Computed in log
/// space: far from all centres the nearest component gets all the weight, never 0/0.
pub fn activations(centers_widths: &[(f64, f64)], drive: f64) -> Vec<f64> {
    let log_density: Vec<f64> = centers_widths
        .iter()
        .map(|&(center, width)| -0.5 * ((drive - center) / width).powi(2) - width.ln())
        .collect();
    let max = log_density.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut h: Vec<f64> = log_density.iter().map(|log| (log - max).exp()).collect();
    let sum: f64 = h.iter().sum();
    h.iter_mut().for_each(|value| *value /= sum);
    h
}

/// hᵢ of a validated policy of springs at time `t_s` (s) after the start of Execute; of another one, which has
/// no springs, none.
pub fn policy_activations(policy: &PolicyMsg, t_s: f64) -> Vec<f64> {
    let activation =
        if policy.activation == ACTIVATION_DECAY { Activation::Decay } else { Activation::Time };
    let centers_widths: Vec<_> = policy.components().iter().map(|c| (c.center, c.width)).collect();
    activations(&centers_widths, activation.drive(t_s, policy.decay_rate))
}

/// Σ hᵢ(t) Kᵢ of a validated policy at `t_s` (s), of the learnt coordinates: d×d, s⁻²; zero without springs.
pub fn stiffness(policy: &PolicyMsg, t_s: f64) -> DMatrix<f64> {
    let (h, d) = (policy_activations(policy, t_s), policy.task_dim as usize);
    h.iter().zip(policy.components()).fold(DMatrix::zeros(d, d), |sum, (h, component)| {
        sum + DMatrix::from_fn(d, d, |row, column| h * component.stiffness_at(row, column))
    })
}

/// Means of the hᵢ of a validated policy over its movement, at the middles of `N_SAMPLES` equal parts.
pub fn mean_activations(policy: &PolicyMsg) -> Vec<f64> {
    let mut mean = vec![0.0; policy.components().len()];
    for part in 0..N_SAMPLES {
        let t_s = policy.duration_s * (part as f64 + 0.5) / N_SAMPLES as f64;
        for (mean, h) in mean.iter_mut().zip(policy_activations(policy, t_s)) {
            *mean += h / N_SAMPLES as f64;
        }
    }
    mean
}

/// Fine enough for activations a sixteenth of the movement wide.
const N_SAMPLES: usize = 200;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_to_one_and_gives_the_nearest_component_when_far() {
        let components = [(0.0, 0.1), (0.2, 0.1), (0.4, 0.1)];
        for drive in [-1e6, -3.0, 0.1, 0.25, 5.0, 1e6] {
            let h = activations(&components, drive);
            assert!((h.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
        assert_eq!(activations(&components, 1e6), [0.0, 0.0, 1.0]);
        assert_eq!(activations(&components, -1e6), [1.0, 0.0, 0.0]);
    }

    #[test]
    fn agrees_with_the_ratio_of_densities_where_it_is_defined() {
        let components = [(0.2, 0.1), (0.5, 0.3)];
        let density = |s: f64, (c, w): (f64, f64)| (-0.5 * ((s - c) / w).powi(2)).exp() / w;
        let (a, b) = (density(0.3, components[0]), density(0.3, components[1]));
        let h = activations(&components, 0.3);
        assert!((h[0] - a / (a + b)).abs() < 1e-15 && (h[1] - b / (a + b)).abs() < 1e-15);
    }
}
