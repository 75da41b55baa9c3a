//! Settings of the niching search.

use serde::{Deserialize, Serialize};

use super::climb::ClimbConfig;
use crate::range::{Range, range};

/// Settings; lengths in widths of the box.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NichingConfig {
    /// Even places of which the best becomes a start.
    pub n_candidates: usize,
    /// Above 0, starts are drawn about θ₀ with this standard deviation instead, the first is θ₀, and a
    /// climb begins at each before it is tested: where θ₀ lies between the optima, far from the rest.
    pub start_std: f64,
    /// Standard deviation of a climb's first trials, in distances to the nearest known optimum …
    pub relative_std: f64,
    /// … and at most.
    pub initial_std: f64,
    /// A valley to the nearest known optimum is looked for after so many trials of a climb.
    pub n_between_tests: u64,
    /// Optima with this share of the best reward are answers, and worth a look at their neighbours.
    pub answer_share: f64,
    /// θ₀ ± this is the box where none is known.
    pub half_width: f64,
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
            range("n_candidates", self.n_candidates as f64, 1.0, 1e4),
            range("start_std", self.start_std, 0.0, 10.0),
            range("relative_std", self.relative_std, 1e-3, 10.0),
            range("initial_std", self.initial_std, 1e-6, 10.0),
            range("n_between_tests", self.n_between_tests as f64, 1.0, 1e6),
            range("answer_share", self.answer_share, 0.0, 1.0),
            range("half_width", self.half_width, 1e-6, 1e6),
        ];
        [own, self.climb.ranges()].concat()
    }
}
