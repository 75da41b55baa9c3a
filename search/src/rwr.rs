//! Episodic reward-weighted regression (Dayan and Hinton, Neural Computation 1997; Peters and
//! Schaal, ICML 2007).
//!
//! wₘ = u(rₘ)/Σ u(r) over the batch, μ' = Σₘ wₘ θₘ and Σ' = Σₘ wₘ (θₘ − μ')(θₘ − μ')ᵀ + floor²·I.
//! The transformation u(r) = r^τ is their exp(−τ·cost) for the cost −ln r.

use serde::{Deserialize, Serialize};

use super::batch::{BatchConfig, FactorGaussian, Update};
use super::{RewardError, rewards};
use crate::range::{Range, range};
use crate::trial::Trial;

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct RwrConfig {
    /// Exponent τ of the weights: a trial weighs (r/best)^τ; 1 weighs by the reward itself.
    pub tau: f64,
    /// Batches of trials, and the exploration floor.
    pub batch: BatchConfig,
}

impl Default for RwrConfig {
    fn default() -> Self {
        RwrConfig { tau: 20.0, batch: BatchConfig::default() }
    }
}

impl RwrConfig {
    /// Settings and their ranges.
    pub fn ranges(&self) -> Vec<Range> {
        [vec![range("tau", self.tau, 1e-3, 1e3, "1")], self.batch.ranges()].concat()
    }
}

impl Update for RwrConfig {
    fn batch(&self) -> &BatchConfig {
        &self.batch
    }

    fn check_reward(&self, reward: f64) -> Result<(), RewardError> {
        rewards::not_negative(reward, "rwr weights trials by powers of their rewards")
    }

    fn update(&self, _gaussian: &FactorGaussian, trials: &[Trial], floor: f64) -> FactorGaussian {
        // Relative to the best, which is above zero as the rewards differ.
        let weight = |t: &Trial| (t.reward / trials[0].reward).powf(self.tau);
        let weights: Vec<f64> = trials.iter().map(weight).collect();
        FactorGaussian::fit(trials, &weights, None, floor)
    }
}
