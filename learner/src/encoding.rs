//! θ ↔ policy message: springs of an arm, or an action vector.

use nalgebra::DVector;
use shm_types::policy::PolicyMsg;

use crate::config::LearnerConfig;
use crate::parameters::{ParameterError, ParameterMap, PolicyIds};
use crate::search::Space;

/// How this session's θ becomes a policy.
pub enum Encoding {
    /// Eq. (5): attractors and stiffnesses, scaled.
    Springs(Box<ParameterMap>),
    /// Sec. 4.2: θ is the action.
    Action,
}

impl Encoding {
    /// Encoding and space of a session that starts from `initial`.
    pub fn new(
        initial: &PolicyMsg,
        config: &LearnerConfig,
    ) -> Result<(Encoding, Space), ParameterError> {
        if config.action.is_used() {
            return Ok((Encoding::Action, config.action.space()));
        }
        let map = ParameterMap::new(initial, config.scales)?;
        let theta_0 = map.encode(initial)?;
        Ok((Encoding::Springs(Box::new(map)), Space::white(theta_0)))
    }

    /// The sealed policy of θ.
    pub fn decode(&self, theta: &DVector<f64>, ids: PolicyIds) -> PolicyMsg {
        let PolicyIds { session, rollout, policy_id } = ids;
        match self {
            Encoding::Springs(map) => map.decode(theta, ids),
            Encoding::Action => {
                let policy = PolicyMsg::of_action(theta.as_slice());
                PolicyMsg { session, rollout, policy_id, ..policy }.sealed()
            }
        }
    }
}
