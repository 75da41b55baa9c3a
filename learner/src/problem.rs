//! What a session searches: θ ↔ policy, where the search starts and along which directions.

use nalgebra::{DMatrix, DVector};
use shm_types::policy::PolicyMsg;

use crate::config::LearnerConfig;
use crate::demonstration::Demonstration;
use crate::error::LearnerError;
use crate::exploration::{ExplorationKind, directions};
use crate::initial_policy::initial_policy;
use crate::parameters::{ParameterMap, PolicyIds};
use crate::search::{self, Search, Space};

/// A configured search problem; the same for a session and for a study without one.
pub struct Problem {
    encoding: Encoding,
    pub space: Space,
}

/// How θ becomes a policy.
enum Encoding {
    /// Eq. (5): attractors and stiffnesses, scaled.
    Springs(Box<ParameterMap>),
    /// Sec. 4.2: θ is the action.
    Action,
}

impl Problem {
    /// Starts from the policy fitted to `demonstration`.
    pub fn new(
        config: &LearnerConfig,
        demonstration: &Demonstration,
    ) -> Result<Problem, LearnerError> {
        let initial = initial_policy(demonstration, &config.initial_policy());
        Problem::around(&initial, config, Some(demonstration))
    }

    /// Starts from `initial`, the policy that was fitted to `demonstration`, or an action.
    pub fn around(
        initial: &PolicyMsg,
        config: &LearnerConfig,
        demonstration: Option<&Demonstration>,
    ) -> Result<Problem, LearnerError> {
        let Some(demonstration) = demonstration else {
            return Ok(Problem { encoding: Encoding::Action, space: config.action.space() });
        };
        let map = ParameterMap::new(initial, config.scales)?;
        let theta_0 = map.encode(initial)?;
        let space = match config.exploration.kind {
            ExplorationKind::White => Space::white(theta_0),
            ExplorationKind::Demonstration => {
                let columns = directions(initial, &map, config, demonstration)?;
                Space::along(theta_0, matrix(map.dim(), &columns))?
            }
        };
        Ok(Problem { encoding: Encoding::Springs(Box::new(map)), space })
    }

    /// The sealed policy of θ.
    pub fn decode(&self, theta: &DVector<f64>, ids: PolicyIds) -> PolicyMsg {
        let PolicyIds { session, rollout, policy_id } = ids;
        match &self.encoding {
            Encoding::Springs(map) => map.decode(theta, ids),
            Encoding::Action => {
                let policy = PolicyMsg::of_action(theta.as_slice());
                PolicyMsg { session, rollout, policy_id, ..policy }.sealed()
            }
        }
    }

    /// The configured search, before its first trial.
    pub fn search(&self, config: &LearnerConfig) -> Box<dyn Search> {
        search::build(&config.search, config.seed, self.space.clone())
    }
}

fn matrix(dim: usize, columns: &[DVector<f64>]) -> DMatrix<f64> {
    DMatrix::from_fn(dim, columns.len(), |row, column| columns[column][row])
}
