//! Settings of the niching search.

use serde::{Deserialize, Serialize};

use super::climb::ClimbConfig;
use crate::range::{Range, range};

/// Settings; lengths in widths of the box.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct NichingConfig {
    /// Evenly spread places of which the best becomes a start.
    pub n_candidates: usize,
    /// Above 0, starts are drawn around θ₀ with this standard deviation instead, in widths of the box: the first is θ₀,
    /// and each is climbed before it is tested. For a θ₀ between the optima, far from the rest.
    pub start_std: f64,
    /// Standard deviation of a climb's first trials, in distances to the nearest known optimum.
    pub relative_std: f64,
    /// Largest standard deviation of a climb's first trials, in widths of the box.
    pub initial_std: f64,
    /// Trials of a climb between two tests for a valley to the nearest known optimum.
    pub n_between_tests: u64,
    /// Optima with this share of the best reward count as solutions, and their neighbourhoods are searched.
    pub answer_share: f64,
    /// Half the width of the box around θ₀, where no box is known.
    pub half_width: f64,
    /// A climb from a start to an optimum.
    pub climb: ClimbConfig,
}

impl Default for NichingConfig {
    fn default() -> Self {
        NichingConfig {
            n_candidates: 8,
            start_std: 0.0,
            relative_std: 0.3,
            initial_std: 0.1,
            n_between_tests: 30,
            answer_share: 0.9,
            half_width: 3.0,
            climb: ClimbConfig::default(),
        }
    }
}

impl NichingConfig {
    /// Settings and their ranges.
    pub fn ranges(&self) -> Vec<Range> {
        let own = vec![
            range("n_candidates", self.n_candidates as f64, 1.0, 1e4, "1"),
            range("start_std", self.start_std, 0.0, 10.0, "1"),
            range("relative_std", self.relative_std, 1e-3, 10.0, "1"),
            range("initial_std", self.initial_std, 1e-6, 10.0, "1"),
            range("n_between_tests", self.n_between_tests as f64, 1.0, 1e6, "1"),
            range("answer_share", self.answer_share, 0.0, 1.0, "1"),
            range("half_width", self.half_width, 1e-6, 1e6, "1"),
        ];
        [own, self.climb.ranges()].concat()
    }
}
