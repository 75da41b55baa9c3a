//! The search: proposes θ, learns from trials, and knows nothing of robots, transports and files.
//!
//! ```
//! use nalgebra::dvector;
//! use search::trial::Trial;
//! use search::{AskTell, SearchConfig, Space, build};
//!
//! // Rewards are 1 at (0.3, -0.2), and 0 far away.
//! let reward_of = |theta: &nalgebra::DVector<f64>| {
//!     (-10.0 * (theta - dvector![0.3, -0.2]).norm_squared()).exp()
//! };
//! let space = Space::white(dvector![0.0, 0.0]);
//! let mut search = AskTell::new(build(&SearchConfig::default(), 1, space));
//! let mut best: f64 = 0.0;
//! for rollout in 1..=100 {
//!     let theta = search.ask(rollout).theta;
//!     let reward = reward_of(&theta);
//!     let success = reward > 0.9;
//!     search.tell(&Trial { rollout, theta, reward, success, measured: Vec::new() })?;
//!     best = best.max(reward);
//! }
//! assert!(best > 0.9);
//! # Ok::<(), search::TellError>(())
//! ```

#![forbid(unsafe_code)]

pub mod aim;
pub mod algorithm1;
mod ask_tell;
pub mod batch;
pub mod cem;
#[cfg(test)]
mod comparators_tests;
mod config;
pub mod enac;
#[cfg(test)]
mod every_method_tests;
mod filling;
pub mod gaussian;
pub mod gradient;
#[cfg(test)]
mod in_flight_tests;
pub mod mixture;
pub mod niching;
pub mod normals;
pub mod pi2;
pub mod power;
pub mod random;
pub mod range;
pub mod regions;
pub mod reinforce;
pub mod rewards;
pub mod rwr;
mod several;
mod space;
pub mod split_merge;
pub mod subspace;
pub mod tempered;
pub mod trial;
#[cfg(test)]
mod vectors;

use nalgebra::{DMatrix, DVector};

pub use ask_tell::{AskTell, TellError};
pub use config::{Method, SearchConfig};
pub use rewards::{RewardError, RewardMap};
pub use space::{Bounds, BoundsError, Direction, DirectionsError, Known, Prediction, Space};

use crate::trial::{Proposal, Trial};
use batch::BatchSearch;

/// An episodic search over θ, deterministic in (configuration, seed, told trials).
pub trait Search: Send {
    /// The θ for rollout `rollout` (from 1). `pending` are the proposals that were asked for and are not
    /// told yet, in the order of their rollouts, each before `rollout`: nothing is known of them but that
    /// they will be told. A pure function of these and of what was told and noted so far: asking again
    /// gives the same bits, and repeating a session's calls in their order resumes it.
    fn ask(&self, rollout: u64, pending: &[Proposal]) -> Proposal;

    /// Notes that `proposal`, asked for beside these `pending` ones, is executed, and with it what it was
    /// drawn from or meant for, if that says what its trial means: several trials may be told in between.
    /// A trial that was not noted is taken for what would be asked for at the moment it is told, which is
    /// right where one rollout is executed at a time.
    fn note(&mut self, _proposal: &Proposal, _pending: &[Proposal]) {}

    /// Whether a trial with this reward can be learnt. A search that only compares rewards takes any
    /// finite one; a search that weights trials by them says so here.
    fn check_reward(&self, reward: f64) -> Result<(), RewardError> {
        rewards::finite(reward)
    }

    /// Learns from a trial whose reward passes [`Search::check_reward`]. Trials come in any order.
    fn tell(&mut self, trial: &Trial);

    /// Centre of the distribution proposals are drawn from.
    fn mean(&self) -> &DVector<f64>;

    /// The distribution from which rollout `rollout` is drawn.
    fn snapshot(&self, rollout: u64) -> SearchSnapshot;

    /// Which targets' predictions have been worse than none, by their place in the configuration.
    fn doubted(&self) -> Vec<usize> {
        Vec::new()
    }

    /// The solutions found so far, at least one, those with the highest prior first. A search for
    /// one optimum has one: its mean, with the variance it draws from.
    fn modes(&self) -> Vec<Mode> {
        let SearchSnapshot { mean, std, .. } = self.snapshot(u64::MAX);
        let covariance = DMatrix::from_diagonal(&std.map(|s| s * s));
        vec![Mode { prior: 1.0, mean, covariance }]
    }
}

/// One mixture component or solution region: πᵢ, μᵢ, Σᵢ of Sec. 4.1.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// πᵢ; sums to one over the modes.
    pub prior: f64,
    /// The policy this mode stands for.
    pub mean: DVector<f64>,
    pub covariance: DMatrix<f64>,
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

/// The configured search from each of `spaces`, at least one; several take turns.
pub fn build_all(config: &SearchConfig, seed: u64, spaces: Vec<Space>) -> Box<dyn Search> {
    build_joined(config, seed, spaces.into_iter().map(|space| (0, space)).collect())
}

/// The same where starts joined later: each with the number of rollouts before it, in rising order from 0.
pub fn build_joined(
    config: &SearchConfig,
    seed: u64,
    mut spaces: Vec<(u64, Space)>,
) -> Box<dyn Search> {
    if spaces.len() == 1 {
        return build(config, seed, spaces.remove(0).1);
    }
    let unmapped = |(after, space): (u64, Space)| (after, unmapped(config, seed, space));
    let searches = spaces.into_iter().map(unmapped).collect();
    rewards::mapped(config.reward_map, Box::new(several::Several::new(searches)))
}

/// The configured search in `space`; along directions if it has some.
pub fn build(config: &SearchConfig, seed: u64, space: Space) -> Box<dyn Search> {
    rewards::mapped(config.reward_map, unmapped(config, seed, space))
}

/// The same, told the rewards as they are.
fn unmapped(config: &SearchConfig, seed: u64, space: Space) -> Box<dyn Search> {
    if !space.is_white() {
        return Box::new(subspace::Subspace::new(space, |inner| unmapped(config, seed, inner)));
    }
    match config.method {
        Method::Algorithm1 => Box::new(algorithm1::Algorithm1::new(config.algorithm1, seed, space)),
        Method::Aim => Box::new(aim::Aim::new(config.aim.clone(), config.power, seed, space)),
        Method::Power => Box::new(power::Power::new(config.power, seed, space)),
        Method::Tempered => Box::new(tempered::Tempered::new(config.tempered, seed, space)),
        Method::Random => Box::new(random::Random::new(config.random, seed, space)),
        Method::Cem => Box::new(BatchSearch::new(config.cem, seed, space)),
        Method::Pi2 => Box::new(BatchSearch::new(config.pi2, seed, space)),
        Method::Rwr => Box::new(BatchSearch::new(config.rwr, seed, space)),
        Method::Reinforce => Box::new(BatchSearch::new(config.reinforce, seed, space)),
        Method::Regions => Box::new(regions::Regions::new(config.regions, seed, space)),
        Method::Niching => Box::new(niching::Niching::new(config.niching, seed, space)),
        Method::Enac => Box::new(BatchSearch::new(config.enac, seed, space)),
    }
}
