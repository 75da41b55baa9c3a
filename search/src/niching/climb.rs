//! One climb of the niching search: Eqs. (1) and (6) from a start to the top of its hill.

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::steps::Steps;
use crate::batch::FactorGaussian;
use crate::power::by_reward;
use crate::range::{Range, range};
use crate::trial::Trial;

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ClimbConfig {
    /// Whether a surrogate fitted to the climb's trials chooses its steps instead of Eqs. (1) and (6); for smooth hills
    /// in few dimensions.
    pub surrogate: bool,
    /// Number of elites M: the best trials Eqs. (1) and (6) are computed from.
    pub n_elites: usize,
    /// Trials around the start before the first update.
    pub n_initial: u64,
    /// Variance of the exploration floor Σ₀ at the first trial, in variances of the start.
    pub floor_variance: f64,
    /// Factor on the variance of the floor per trial.
    pub floor_decay: f64,
    /// A climb ends when no standard deviation is above this, in widths of the box.
    pub end_std: f64,
    /// A climb ends after this many trials.
    pub n_max: u64,
    /// A climb ends after this many trials without a better one; 0 for never.
    pub patience: u64,
    /// Whether a climb ends at its first success.
    pub until_success: bool,
}

impl Default for ClimbConfig {
    fn default() -> Self {
        ClimbConfig {
            surrogate: false,
            n_elites: 8,
            n_initial: 8,
            floor_variance: 0.2,
            floor_decay: 0.94,
            end_std: 1e-6,
            n_max: 400,
            patience: 0,
            until_success: false,
        }
    }
}

impl ClimbConfig {
    /// Settings and their ranges, as fields of the table `climb`.
    pub fn ranges(&self) -> Vec<Range> {
        vec![
            range("climb.n_elites", self.n_elites as f64, 2.0, 1e4, "1"),
            range("climb.n_initial", self.n_initial as f64, 1.0, 1e4, "1"),
            range("climb.floor_variance", self.floor_variance, 0.0, 100.0, "1"),
            range("climb.floor_decay", self.floor_decay, 0.1, 0.9999, "1"),
            range("climb.end_std", self.end_std, 1e-12, 1.0, "1"),
            range("climb.n_max", self.n_max as f64, 1.0, 1e6, "1"),
            range("climb.patience", self.patience as f64, 0.0, 1e6, "1"),
        ]
    }
}

/// A climb in progress. Its start is its first elite.
pub struct Climb {
    config: ClimbConfig,
    start: DVector<f64>,
    std: f64,
    gaussian: FactorGaussian,
    elites: Vec<Trial>,
    steps: Steps,
    n_told: u64,
    /// Trials since the best one.
    n_since: u64,
}

impl Climb {
    pub fn new(config: ClimbConfig, start: Trial, std: f64) -> Climb {
        let gaussian = FactorGaussian::isotropic(start.theta.clone(), std);
        let from = start.theta.clone();
        let mut steps = Steps::default();
        steps.push(&start.theta, start.reward);
        let (elites, n_told, n_since) = (vec![start], 0, 0);
        Climb { config, start: from, std, gaussian, elites, steps, n_told, n_since }
    }

    /// Eqs. (1) and (6) with weights by rank, wₘ = ln(M + ½) − ln m as in CMA-ES.
    ///
    /// Departure: the paper weighs with rewards, which near a top are all the same, and its Σ₀ is
    /// constant, which ends the climb at a distance from the top.
    pub fn tell(&mut self, trial: Trial) {
        self.n_told += 1;
        if self.config.surrogate {
            self.steps.push(&trial.theta, trial.reward);
        }
        let place = self.elites.partition_point(|elite| by_reward(elite, &trial).is_lt());
        self.n_since = if place == 0 { 0 } else { self.n_since + 1 };
        self.elites.insert(place, trial);
        self.elites.truncate(self.config.n_elites);
        if self.n_told < self.config.n_initial {
            return;
        }
        let n = self.elites.len() as f64;
        let weight = |m: usize| (n + 0.5).ln() - (m as f64).ln();
        let weights: Vec<f64> = (1..=self.elites.len()).map(weight).collect();
        let variance =
            self.config.floor_variance * self.config.floor_decay.powf(self.n_told as f64);
        let floor = self.std * variance.sqrt();
        self.gaussian =
            FactorGaussian::fit(&self.elites, &weights, Some(&self.gaussian.mean), floor);
    }

    /// The next trial beside the pending ones, as a place in fractions of the box that may lie outside of it.
    pub fn place(&self, seed: u64, rollout: u64, pending: &[DVector<f64>]) -> DVector<f64> {
        if self.config.surrogate {
            return self.steps.next(&self.best().theta, self.std, [seed, rollout], pending);
        }
        self.gaussian.sample(seed, rollout)
    }

    pub fn gaussian(&self) -> &FactorGaussian {
        &self.gaussian
    }

    pub fn best(&self) -> &Trial {
        &self.elites[0]
    }

    /// Distance from the start to the best place.
    pub fn way(&self) -> f64 {
        (&self.best().theta - &self.start).norm()
    }

    pub fn n_told(&self) -> u64 {
        self.n_told
    }

    /// It was to end at a success, and has one.
    pub fn has_succeeded(&self) -> bool {
        self.config.until_success && self.best().success
    }

    pub fn is_over(&self) -> bool {
        let ClimbConfig { n_max, patience, .. } = self.config;
        self.n_told >= n_max
            || self.has_succeeded()
            || patience > 0 && self.n_since >= patience
            || self.gaussian.marginal_std().max() <= self.config.end_std
    }
}
