//! Cross-entropy method (Rubinstein 1999; de Boer, Kroese, Mannor, Rubinstein, Annals of
//! Operations Research 2005), with the added noise of Szita and Lőrincz (Neural Computation 2006).
//!
//! From the E best of a batch: μ = Σₑ θₑ/E and Σ = Σₑ (θₑ − μ)(θₑ − μ)ᵀ/E + floor²·I.

use serde::{Deserialize, Serialize};

use super::batch::{BatchConfig, FactorGaussian, Update};
use crate::range::{Range, range};
use crate::trial::Trial;

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct CemConfig {
    /// Number of elites: the best trials of a batch, at most `batch.size`.
    pub n_elites: usize,
    /// Batches of trials, and the exploration floor.
    pub batch: BatchConfig,
}

impl Default for CemConfig {
    fn default() -> Self {
        let batch = BatchConfig { size: 20, ..BatchConfig::default() };
        CemConfig { n_elites: 5, batch }
    }
}

impl CemConfig {
    /// Settings and their ranges.
    pub fn ranges(&self) -> Vec<Range> {
        let n_elites = range("n_elites", self.n_elites as f64, 1.0, 1e4, "1");
        // The batch first: its size limits the elites.
        [self.batch.ranges(), vec![n_elites.up_to(self.batch.size as f64)]].concat()
    }
}

impl Update for CemConfig {
    fn batch(&self) -> &BatchConfig {
        &self.batch
    }

    fn update(&self, _gaussian: &FactorGaussian, trials: &[Trial], floor: f64) -> FactorGaussian {
        let elites = &trials[..self.n_elites];
        FactorGaussian::fit(elites, &vec![1.0; self.n_elites], None, floor)
    }
}
