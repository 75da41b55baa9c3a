//! What a session searches: θ ↔ policy, where the search starts and along which directions.

use nalgebra::{DMatrix, DVector};
use shm_types::policy::PolicyMsg;

use crate::config::LearnerConfig;
use crate::demonstration::Demonstration;
use crate::exploration::{ExplorationKind, directions};
use crate::initial_policy::initial_policy;
use crate::learner::LearnerError;
use crate::parameters::ParameterMap;
use crate::search::{self, Search, Space};

/// A configured search problem; the same for a session and for a study without one.
#[derive(Clone, Debug)]
pub struct Problem {
    pub map: ParameterMap,
    pub space: Space,
}

impl Problem {
    /// Starts from the policy fitted to `demonstration`.
    pub fn new(
        config: &LearnerConfig,
        demonstration: &Demonstration,
    ) -> Result<Problem, LearnerError> {
        let initial = initial_policy(demonstration, &config.initial_policy());
        Problem::around(&initial, config, demonstration)
    }

    /// Starts from `initial`, the policy that was fitted to `demonstration`.
    pub fn around(
        initial: &PolicyMsg,
        config: &LearnerConfig,
        demonstration: &Demonstration,
    ) -> Result<Problem, LearnerError> {
        let map = ParameterMap::new(initial, config.scales)?;
        let theta_0 = map.encode(initial)?;
        let space = match config.exploration.kind {
            ExplorationKind::White => Space::white(theta_0),
            ExplorationKind::Demonstration => {
                let columns = directions(initial, &map, config, demonstration)?;
                Space::along(theta_0, matrix(map.dim(), &columns))?
            }
        };
        Ok(Problem { map, space })
    }

    /// The configured search, before its first trial.
    pub fn search(&self, config: &LearnerConfig) -> Box<dyn Search> {
        search::build(&config.search, config.seed, self.space.clone())
    }
}

fn matrix(dim: usize, columns: &[DVector<f64>]) -> DMatrix<f64> {
    DMatrix::from_fn(dim, columns.len(), |row, column| columns[column][row])
}
