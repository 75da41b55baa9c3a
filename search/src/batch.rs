//! What the batch searches share: a Gaussian that stays as it is until its batch of trials is told.
//!
//! With several rollouts in flight draws are independent, and a batch may hold trials drawn from an older Gaussian. Such
//! a trial counts as the same draw from the present one: its deviation from the mean it was drawn around, in
//! units of the noise, added to the present mean. Taking it where it lies pulls the mean back to where it was,
//! and leaving it out wastes it (docs/adr/0034).

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::normals::{standard_normal, stream};
use super::power::by_reward;
use super::{RewardError, Search, SearchSnapshot, Space, rewards};
use crate::range::{Range, range};
use crate::trial::{Proposal, Trial};

/// Batches of trials, and the exploration floor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct BatchConfig {
    /// Trials per update.
    pub size: usize,
    /// Standard deviation before the first update, in units of θ.
    pub initial_std: f64,
    /// Exploration floor at the first update, in units of θ.
    pub floor_std: f64,
    /// Factor on the floor per update; 1 keeps it.
    pub floor_decay: f64,
    /// Lowest exploration floor, at most `floor_std`.
    pub floor_min: f64,
}

impl Default for BatchConfig {
    fn default() -> Self {
        BatchConfig {
            size: 10,
            initial_std: 0.7,
            floor_std: 0.2,
            floor_decay: 0.9,
            floor_min: 0.05,
        }
    }
}

impl BatchConfig {
    /// Settings and their ranges, as fields of the table `batch`.
    pub fn ranges(&self) -> Vec<Range> {
        vec![
            range("batch.size", self.size as f64, 2.0, 1e4, "1"),
            range("batch.initial_std", self.initial_std, 1e-9, 1e6, "1"),
            range("batch.floor_std", self.floor_std, 1e-9, 1e6, "1"),
            range("batch.floor_decay", self.floor_decay, 0.1, 1.0, "1"),
            range("batch.floor_min", self.floor_min, 1e-9, 1e6, "1").up_to(self.floor_std),
        ]
    }

    /// The floor of update `n_updates` (from 0).
    fn floor(&self, n_updates: i32) -> f64 {
        (self.floor_std * self.floor_decay.powi(n_updates)).max(self.floor_min)
    }
}

/// 𝒩(μ, Σₘ fₘfₘᵀ + diag(s)²): what few trials say, and independent noise. It is sampled without
/// a matrix decomposition, so no covariance is too flat for it.
#[derive(Clone, Debug)]
pub struct FactorGaussian {
    pub mean: DVector<f64>,
    pub factors: Vec<DVector<f64>>,
    /// s > 0, D numbers.
    pub std: DVector<f64>,
}

impl FactorGaussian {
    pub fn isotropic(mean: DVector<f64>, std: f64) -> FactorGaussian {
        let std = DVector::from_element(mean.len(), std);
        FactorGaussian { mean, factors: Vec::new(), std }
    }

    /// Weighted maximum likelihood: μ = Σₘ wₘ θₘ / Σ w and
    /// Σ = Σₘ wₘ (θₘ − c)(θₘ − c)ᵀ / Σ w + floor²·I with the centre c = μ, or the one given.
    pub fn fit(
        trials: &[Trial],
        weights: &[f64],
        centre: Option<&DVector<f64>>,
        floor: f64,
    ) -> FactorGaussian {
        let sum: f64 = weights.iter().sum();
        let mut mean = DVector::zeros(trials[0].theta.len());
        for (trial, weight) in trials.iter().zip(weights) {
            mean += &trial.theta * (weight / sum);
        }
        let centre = centre.unwrap_or(&mean);
        let factor = |(trial, w): (&Trial, &f64)| (&trial.theta - centre) * (w / sum).sqrt();
        let factors = trials.iter().zip(weights).map(factor).collect();
        FactorGaussian { factors, ..FactorGaussian::isotropic(mean, floor) }
    }

    pub fn sample(&self, seed: u64, rollout: u64) -> DVector<f64> {
        let mut rng = stream(seed, rollout);
        let mut theta = self.mean.clone();
        for factor in &self.factors {
            theta += factor * standard_normal(&mut rng);
        }
        theta.zip_apply(&self.std, |x, s| *x += s * standard_normal(&mut rng));
        theta
    }

    /// Where `theta`, a draw from `old`, lies when the old mean is moved onto this one, in units of s: a draw keeps
    /// what it says about a step from the mean, though the mean has moved.
    fn moved(self: &Arc<Self>, old: &Arc<Self>, theta: &DVector<f64>) -> DVector<f64> {
        if Arc::ptr_eq(self, old) {
            return theta.clone();
        }
        let scale = self.std.component_div(&old.std);
        &self.mean + (theta - &old.mean).component_mul(&scale)
    }

    pub fn marginal_std(&self) -> DVector<f64> {
        let mut variance = self.std.component_mul(&self.std);
        for factor in &self.factors {
            variance += factor.component_mul(factor);
        }
        variance.map(f64::sqrt)
    }
}

/// What distinguishes one batch search from another.
pub trait Update: Send {
    fn batch(&self) -> &BatchConfig;

    /// As [`Search::check_reward`].
    fn check_reward(&self, reward: f64) -> Result<(), RewardError> {
        rewards::finite(reward)
    }

    /// The distribution after `gaussian`, from a batch with unequal rewards, best trial first.
    fn update(&self, gaussian: &FactorGaussian, trials: &[Trial], floor: f64) -> FactorGaussian;
}

/// A search that updates its Gaussian after each batch. Rollout 1 is θ₀, as in every method.
pub struct BatchSearch<U> {
    method: U,
    seed: u64,
    space: Space,
    gaussian: Arc<FactorGaussian>,
    /// Trials told since the last update.
    batch: Vec<Trial>,
    n_updates: i32,
    /// What the rollouts in flight were drawn from.
    noted: BTreeMap<u64, Arc<FactorGaussian>>,
}

impl<U: Update> BatchSearch<U> {
    pub fn new(method: U, seed: u64, space: Space) -> Self {
        let initial_std = method.batch().initial_std;
        let gaussian = Arc::new(FactorGaussian::isotropic(space.theta_0.clone(), initial_std));
        BatchSearch {
            method,
            seed,
            space,
            gaussian,
            batch: Vec::new(),
            n_updates: 0,
            noted: BTreeMap::new(),
        }
    }
}

impl<U: Update> Search for BatchSearch<U> {
    fn ask(&self, rollout: u64, _pending: &[Proposal]) -> Proposal {
        let theta = match rollout {
            1 => self.gaussian.mean.clone(),
            _ => self.gaussian.sample(self.seed, rollout),
        };
        Proposal { rollout, theta: self.space.inside(theta) }
    }

    fn note(&mut self, proposal: &Proposal, _pending: &[Proposal]) {
        self.noted.insert(proposal.rollout, self.gaussian.clone());
    }

    fn check_reward(&self, reward: f64) -> Result<(), RewardError> {
        self.method.check_reward(reward)
    }

    fn tell(&mut self, trial: &Trial) {
        self.check_reward(trial.reward).expect("the reward was checked");
        let drawn_from = self.noted.remove(&trial.rollout);
        let drawn_from = drawn_from.unwrap_or_else(|| self.gaussian.clone());
        let theta = self.gaussian.moved(&drawn_from, &trial.theta);
        self.batch.push(Trial { theta, ..trial.clone() });
        if self.batch.len() < self.method.batch().size {
            return;
        }
        let mut trials = std::mem::take(&mut self.batch);
        trials.sort_by(by_reward);
        // Equal rewards say nothing: a step would be a random one.
        if trials[0].reward > trials[trials.len() - 1].reward {
            let floor = self.method.batch().floor(self.n_updates);
            let gaussian = self.method.update(&self.gaussian, &trials, floor);
            let mean = self.space.inside(gaussian.mean);
            self.gaussian = Arc::new(FactorGaussian { mean, ..gaussian });
            self.n_updates += 1;
        }
    }

    fn mean(&self) -> &DVector<f64> {
        &self.gaussian.mean
    }

    fn snapshot(&self, _rollout: u64) -> SearchSnapshot {
        SearchSnapshot {
            mean: self.gaussian.mean.clone(),
            std: self.gaussian.marginal_std(),
            floor: self.gaussian.std.min(),
        }
    }
}
