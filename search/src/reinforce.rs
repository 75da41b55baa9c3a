//! Episodic REINFORCE with a baseline (Williams, Machine Learning 1992), exploring in the parameters
//! (Sehnke, Osendorfer, Rückstieß, Graves, Peters, Schmidhuber, Neural Networks 2010).
//!
//! With z = (θ − μ)/s and the advantage A of a trial: Δμ = α s·⟨A z⟩ and Δ ln s = α' ⟨A (z² − 1)⟩,
//! which is the gradient of the expected reward with Williams's step sizes α s².

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::batch::{BatchConfig, FactorGaussian, Update};
use super::gradient::{StepConfig, advantages, white};
use crate::range::Range;
use crate::trial::Trial;

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ReinforceConfig {
    /// Sizes of the steps.
    pub step: StepConfig,
    /// Batches of trials, and the exploration floor.
    pub batch: BatchConfig,
}

impl ReinforceConfig {
    /// Settings and their ranges.
    pub fn ranges(&self) -> Vec<Range> {
        [self.step.ranges(), self.batch.ranges()].concat()
    }
}

impl Update for ReinforceConfig {
    fn batch(&self) -> &BatchConfig {
        &self.batch
    }

    fn update(&self, gaussian: &FactorGaussian, trials: &[Trial], floor: f64) -> FactorGaussian {
        let mut mean = DVector::zeros(gaussian.mean.len());
        let mut log_std = mean.clone();
        for (z, advantage) in white(gaussian, trials).iter().zip(advantages(trials)) {
            let share = advantage / trials.len() as f64;
            mean += z * share;
            log_std += z.map(|z| share * (z * z - 1.0));
        }
        self.step.take(gaussian, &mean, &log_std, floor)
    }
}
