//! PoWER with covariance adaptation: Eqs. (1) and (6).
//!
//! Rollout 1 is θ₀; the `n_initial` rollouts after it are drawn around θ₀. When all of these are
//! told, the first update takes place with θ⁽ⁿ⁻¹⁾ = θ₀, and one more after each further trial.

use std::cmp::Ordering;

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::normals::{standard_normal, stream};
use super::{Search, SearchSnapshot, Space};
use crate::range::{Range, range};
use crate::trial::{Proposal, Trial};

/// Settings; standard deviations in scaled units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PowerConfig {
    /// M, the best trials Eqs. (1) and (6) are computed from.
    pub n_elites: usize,
    /// Rollouts drawn around θ₀ before the first update (after rollout 1, which is θ₀).
    pub n_initial: u64,
    pub initial_std: f64,
    /// Exploration floor: Σ₀ = floor_std²·I.
    pub floor_std: f64,
    /// Factor on the floor per rollout after the first adapted one; 1 keeps it.
    pub floor_decay: f64,
    /// Where the decay of the floor ends.
    pub floor_min: f64,
}

impl Default for PowerConfig {
    fn default() -> Self {
        PowerConfig {
            n_elites: 5,
            n_initial: 20,
            initial_std: 0.7,
            floor_std: 0.2,
            floor_decay: 0.99,
            floor_min: 0.05,
        }
    }
}

impl PowerConfig {
    /// Settings and their ranges.
    pub fn ranges(&self) -> Vec<Range> {
        vec![
            range("n_elites", self.n_elites as f64, 1.0, 1e4),
            range("n_initial", self.n_initial as f64, 0.0, 1e4),
            range("initial_std", self.initial_std, 0.0, 100.0),
            range("floor_std", self.floor_std, 0.0, 100.0),
            range("floor_decay", self.floor_decay, 0.5, 1.0),
            range("floor_min", self.floor_min, 0.0, self.floor_std),
        ]
    }
}

/// Best first; equal rewards in the order of their rollouts.
pub(super) fn by_reward(a: &Trial, b: &Trial) -> Ordering {
    b.reward.total_cmp(&a.reward).then(a.rollout.cmp(&b.rollout))
}

/// w_m = r_m / Σ r, or `None` when nothing was rewarded. Scaled by the best reward first, so that
/// rewards near the ends of the number range neither overflow nor vanish.
fn reward_weights(elites: &[Trial]) -> Option<Vec<f64>> {
    let best = elites.iter().map(|trial| trial.reward).fold(0.0, f64::max);
    if best <= 0.0 {
        return None;
    }
    let relative: Vec<f64> = elites.iter().map(|trial| trial.reward / best).collect();
    let sum: f64 = relative.iter().sum();
    Some(relative.into_iter().map(|weight| weight / sum).collect())
}

/// Eq. (1): Θ⁽ⁿ⁾ = Θ⁽ⁿ⁻¹⁾ + Σₘ r(Θₘ)[Θₘ − Θ⁽ⁿ⁻¹⁾] / Σₘ r(Θₘ) over the `elites`.
///
/// Without any reward the mean stays.
pub fn power_mean(theta_old: &DVector<f64>, elites: &[Trial]) -> DVector<f64> {
    let Some(weights) = reward_weights(elites) else { return theta_old.clone() };
    let mut mean = theta_old.clone();
    for (trial, weight) in elites.iter().zip(weights) {
        mean += (&trial.theta - theta_old) * weight;
    }
    mean
}

/// Eq. (6) without Σ₀, as factors: fₘ = √wₘ [Θₘ − Θ⁽ⁿ⁻¹⁾] with Σₘ fₘfₘᵀ = Σ⁽ⁿ⁾ − Σ₀ and
/// wₘ = r(Θₘ)/Σ r; `None` without any reward. About the *old* mean, as printed.
fn scatter_factors(theta_old: &DVector<f64>, elites: &[Trial]) -> Option<Vec<DVector<f64>>> {
    let weights = reward_weights(elites)?;
    let factor = |(trial, w): (&Trial, f64)| (&trial.theta - theta_old) * w.sqrt();
    Some(elites.iter().zip(weights).map(factor).collect())
}

/// Eq. (6): Σ⁽ⁿ⁾ = Σₘ r(Θₘ)[Θₘ − Θ⁽ⁿ⁻¹⁾][Θₘ − Θ⁽ⁿ⁻¹⁾]ᵀ / Σₘ r(Θₘ) + Σ₀, dense (D×D).
///
/// `None` without any reward: the covariance stays.
pub fn power_covariance(
    theta_old: &DVector<f64>,
    elites: &[Trial],
    sigma_0: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let weights = reward_weights(elites)?;
    let mut covariance = sigma_0.clone();
    for (trial, weight) in elites.iter().zip(weights) {
        let deviation = &trial.theta - theta_old;
        covariance += &deviation * deviation.transpose() * weight;
    }
    Some(covariance)
}

/// The search. Only the elites are kept: no other trial can influence an update again.
pub struct Power {
    config: PowerConfig,
    seed: u64,
    mean: DVector<f64>,
    elites: Vec<Trial>,
    n_told: u64,
    /// Factors of Eq. (6); `None` before the first update: N(θ₀, initial_std²·I).
    factors: Option<Vec<DVector<f64>>>,
}

impl Power {
    pub fn new(config: PowerConfig, seed: u64, space: Space) -> Self {
        let mean = space.theta_0;
        Power { config, seed, mean, elites: Vec::new(), n_told: 0, factors: None }
    }

    /// Standard deviation of the isotropic part of the distribution of `rollout`.
    ///
    /// Departure: the paper's Σ₀ is constant. With `floor_decay` < 1 it shrinks to `floor_min`,
    /// which raises the share of successes late in a session.
    fn floor(&self, rollout: u64) -> f64 {
        if self.factors.is_none() {
            return self.config.initial_std;
        }
        let n_adapted = rollout.saturating_sub(self.config.n_initial + 2) as f64;
        let floor = self.config.floor_std * self.config.floor_decay.powf(n_adapted);
        floor.max(self.config.floor_min)
    }
}

impl Search for Power {
    /// Eq. (6), sampling: θ = Θ⁽ⁿ⁾ + Σₘ fₘ zₘ + σ₀ z with zₘ, z ~ 𝒩(0, 1).
    ///
    /// Its covariance is Σₘ fₘfₘᵀ + σ₀²I = Σ⁽ⁿ⁾ exactly; a Cholesky factor of the D×D matrix would
    /// give the same distribution for more work and another rounding on every linear algebra
    /// library.
    fn ask(&self, rollout: u64) -> Proposal {
        let mut theta = self.mean.clone();
        if rollout > 1 {
            let mut rng = stream(self.seed, rollout);
            for factor in self.factors.iter().flatten() {
                theta += factor * standard_normal(&mut rng);
            }
            let floor = self.floor(rollout);
            theta.iter_mut().for_each(|x| *x += floor * standard_normal(&mut rng));
        }
        Proposal { rollout, theta }
    }

    fn tell(&mut self, trial: &Trial) {
        assert!(trial.reward.is_finite() && trial.reward >= 0.0, "reward {}", trial.reward);
        self.n_told += 1;
        let place = self.elites.partition_point(|elite| by_reward(elite, trial) == Ordering::Less);
        self.elites.insert(place, trial.clone());
        self.elites.truncate(self.config.n_elites);
        if self.n_told <= self.config.n_initial {
            return;
        }
        // Eqs. (1) and (6) share Θ⁽ⁿ⁻¹⁾: the covariance first, then the mean moves.
        if let Some(factors) = scatter_factors(&self.mean, &self.elites) {
            self.factors = Some(factors);
            self.mean = power_mean(&self.mean, &self.elites);
        }
    }

    fn mean(&self) -> &DVector<f64> {
        &self.mean
    }

    fn snapshot(&self, rollout: u64) -> SearchSnapshot {
        let floor = self.floor(rollout);
        let mut variance = DVector::from_element(self.mean.len(), floor * floor);
        for factor in self.factors.iter().flatten() {
            variance += factor.component_mul(factor);
        }
        SearchSnapshot { mean: self.mean.clone(), std: variance.map(f64::sqrt), floor }
    }
}

#[cfg(test)]
mod tests;
