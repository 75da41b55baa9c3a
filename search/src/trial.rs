//! What the search exchanges with the session: a proposal to execute, a trial to learn from.

use nalgebra::DVector;

/// A θ to be executed as rollout `rollout` (from 1).
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    pub rollout: u64,
    pub theta: DVector<f64>,
}

/// The pair (θ, r) the learner keeps of a rollout; r is finite.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    pub rollout: u64,
    pub theta: DVector<f64>,
    pub reward: f64,
    /// The task's own verdict, where it has one: a search may prefer such trials.
    pub success: bool,
    /// What was measured of the search's targets, in their order; `None` where a measure is missing in
    /// this rollout. Empty where the search has no targets.
    pub measured: Vec<Option<f64>>,
}
