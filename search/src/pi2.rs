//! PI² with covariance matrix adaptation (Theodorou, Buchli, Schaal, JMLR 2010; Stulp and Sigaud,
//! ICML 2012), in its episodic form.
//!
//! Pₘ ∝ exp(h (rₘ − r_min)/(r_max − r_min)) over the batch; μ' = Σₘ Pₘ θₘ and
//! Σ' = Σₘ Pₘ (θₘ − μ)(θₘ − μ)ᵀ + floor²·I about the mean μ the batch was drawn around.

use serde::{Deserialize, Serialize};

use super::batch::{BatchConfig, FactorGaussian, Update};
use crate::range::{Range, range};
use crate::trial::Trial;

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct Pi2Config {
    /// Greediness h: the best trial of a batch weighs exp(h) times as much as the worst.
    pub greediness: f64,
    /// Batches of trials, and the exploration floor.
    pub batch: BatchConfig,
}

impl Default for Pi2Config {
    fn default() -> Self {
        Pi2Config { greediness: 10.0, batch: BatchConfig::default() }
    }
}

impl Pi2Config {
    /// Settings and their ranges.
    pub fn ranges(&self) -> Vec<Range> {
        [vec![range("greediness", self.greediness, 0.0, 700.0, "1")], self.batch.ranges()].concat()
    }
}

impl Update for Pi2Config {
    fn batch(&self) -> &BatchConfig {
        &self.batch
    }

    fn update(&self, gaussian: &FactorGaussian, trials: &[Trial], floor: f64) -> FactorGaussian {
        // Halves: a difference of two rewards need not be finite.
        let half = |t: &Trial| 0.5 * t.reward;
        let (best, worst) = (half(&trials[0]), half(&trials[trials.len() - 1]));
        let weight = |t: &Trial| (self.greediness * ((half(t) - best) / (best - worst))).exp();
        let weights: Vec<f64> = trials.iter().map(weight).collect();
        FactorGaussian::fit(trials, &weights, Some(&gaussian.mean), floor)
    }
}
