//! The search: proposes θ, learns from trials, and knows nothing of robots.

pub mod normals;
pub mod power;
pub mod random;

use nalgebra::DVector;

use crate::config::{LearnerConfig, Method};
use crate::trial::{Proposal, Trial};

/// An episodic search over θ, deterministic in (configuration, seed, told trials).
pub trait Search: Send {
    /// The θ for rollout `rollout` (from 1). A pure function of configuration, seed and the trials
    /// told so far: asking again gives the same bits, and telling stored trials again in their
    /// order resumes a session.
    fn ask(&self, rollout: u64) -> Proposal;

    /// Learns from a trial; its reward is finite and not negative.
    fn tell(&mut self, trial: &Trial);

    /// Centre of the distribution proposals are drawn from.
    fn mean(&self) -> &DVector<f64>;

    /// The distribution from which rollout `rollout` is drawn.
    fn snapshot(&self, rollout: u64) -> SearchSnapshot;
}

/// State of a search, for the record.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchSnapshot {
    pub mean: DVector<f64>,
    /// Square roots of the diagonal of the exploration covariance.
    pub std: DVector<f64>,
    /// Standard deviation of the exploration floor Σ₀ = floor²·I.
    pub floor: f64,
}

/// The configured search around θ₀.
pub fn build(config: &LearnerConfig, theta_0: DVector<f64>) -> Box<dyn Search> {
    match config.method {
        Method::Power => Box::new(power::Power::new(config.power, config.seed, theta_0)),
        Method::Random => Box::new(random::Random::new(config.random, config.seed, theta_0)),
    }
}
