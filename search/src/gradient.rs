//! What the policy gradients share: a Gaussian with a standard deviation of its own per parameter,
//! and a step on its mean and on the logarithm of its standard deviations.

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::batch::FactorGaussian;
use crate::range::{Range, range};
use crate::trial::Trial;

/// A standard deviation changes by this factor at most in one update.
const MAX_STD_FACTOR: f64 = 2.0;
/// Standard deviations grow to this at most, in units of θ.
const MAX_STD: f64 = 1e6;

/// Sizes of the steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct StepConfig {
    /// Factor on the step of the mean, in standard deviations.
    pub mean: f64,
    /// Factor on the step of the logarithms of the standard deviations.
    pub log_std: f64,
}

impl Default for StepConfig {
    fn default() -> Self {
        StepConfig { mean: 1.0, log_std: 0.1 }
    }
}

impl StepConfig {
    /// Settings and their ranges, as fields of the table `step`.
    pub fn ranges(&self) -> Vec<Range> {
        vec![
            range("step.mean", self.mean, 0.0, 1e3, "1"),
            range("step.log_std", self.log_std, 0.0, 1e3, "1"),
        ]
    }

    /// μ + step·s∘`mean` and ln s + step·`log_std`, with s kept above `floor`.
    pub fn take(
        &self,
        gaussian: &FactorGaussian,
        mean: &DVector<f64>,
        log_std: &DVector<f64>,
        floor: f64,
    ) -> FactorGaussian {
        let limit = MAX_STD_FACTOR.ln();
        let factor = log_std.map(|g| (self.log_std * g).clamp(-limit, limit).exp());
        FactorGaussian {
            mean: &gaussian.mean + gaussian.std.component_mul(mean) * self.mean,
            factors: Vec::new(),
            std: gaussian.std.component_mul(&factor).map(|s| s.max(floor).min(MAX_STD.max(floor))),
        }
    }
}

/// z = (θ − μ)/s of each trial.
pub fn white(gaussian: &FactorGaussian, trials: &[Trial]) -> Vec<DVector<f64>> {
    let z = |trial: &Trial| (&trial.theta - &gaussian.mean).component_div(&gaussian.std);
    trials.iter().map(z).collect()
}

/// (r − baseline)/deviation with the mean and the standard deviation of the batch: what a step is
/// made of does not depend on the units of the reward.
pub fn advantages(trials: &[Trial]) -> Vec<f64> {
    // Scaled by the largest first: squares of rewards need not be finite.
    let largest = trials.iter().map(|trial| trial.reward.abs()).fold(0.0, f64::max);
    let rewards = DVector::from_iterator(trials.len(), trials.iter().map(|t| t.reward / largest));
    let deviations = rewards.add_scalar(-rewards.mean());
    let scale = deviations.norm() / (trials.len() as f64).sqrt();
    deviations.iter().map(|deviation| deviation / scale.max(f64::MIN_POSITIVE)).collect()
}
