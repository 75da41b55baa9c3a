//! `[learner.search.regions]`: settings of the search for regions, with defaults and ranges.

use serde::{Deserialize, Serialize};

use crate::range::{Range, range};

/// What counts the peaks among the first trials.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Estimator {
    /// Peaks that stand out, on a graph of the trials.
    Persistence,
    /// A Dirichlet process of Gaussians on the good trials.
    Dirichlet,
    /// Spectral clustering of the good trials.
    Spectral,
}

/// Settings; lengths in widths of the box, rewards in shares of the best one so far.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct RegionsConfig {
    /// Trials that fill the box before regions are counted.
    pub n_fill: usize,
    /// Method that counts the peaks among these trials.
    pub estimator: Estimator,
    /// A peak counts if no way to a higher one stays above this share of it.
    pub persistence: f64,
    /// Regions joined by a way of at least this reward, as a share of the best, are one.
    pub connected: f64,
    /// Standard deviations added to the expected reward where a way could lead along.
    pub optimism: f64,
    /// Standard deviations subtracted from the expected reward before a way is taken as given.
    pub caution: f64,
    /// Trials that may be spent between regions; 0 keeps the count as estimated.
    pub n_bridges: usize,
    /// Trials within which a region must climb to `answer_share`, or is given up.
    pub patience: u32,
    /// Regions with this share of the best reward are solutions.
    pub answer_share: f64,
    /// Largest standard deviation of a climb's steps, in widths of the box.
    pub climb_std: f64,
    /// Half the width of the box around θ₀, where no box is known.
    pub half_width: f64,
}

impl Default for RegionsConfig {
    fn default() -> Self {
        RegionsConfig {
            n_fill: 90,
            estimator: Estimator::Persistence,
            persistence: 0.85,
            connected: 0.6,
            optimism: 2.0,
            caution: 0.5,
            n_bridges: 60,
            patience: 12,
            answer_share: 0.9,
            climb_std: 0.05,
            half_width: 3.0,
        }
    }
}

impl RegionsConfig {
    /// Settings and their ranges.
    pub fn ranges(&self) -> Vec<Range> {
        vec![
            range("n_fill", self.n_fill as f64, 2.0, 1e3, "1"),
            range("persistence", self.persistence, 0.0, 1.0, "1"),
            range("connected", self.connected, 0.05, 1.0, "1"),
            range("optimism", self.optimism, 0.0, 10.0, "1"),
            range("caution", self.caution, 0.0, 10.0, "1"),
            range("n_bridges", self.n_bridges as f64, 0.0, 1e4, "1"),
            range("patience", f64::from(self.patience), 1.0, 1e4, "1"),
            range("answer_share", self.answer_share, 0.0, 1.0, "1"),
            range("climb_std", self.climb_std, 1e-6, 1.0, "1"),
            range("half_width", self.half_width, 1e-6, 1e6, "1"),
        ]
    }
}
