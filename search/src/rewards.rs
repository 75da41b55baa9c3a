//! Which rewards a search takes, and how to map those it does not.
//!
//! A reward may be negative. Most searches only compare rewards, so any finite one will do; some
//! weight trials by their rewards, which only works from 0 up. These refuse a negative reward and say
//! what to set: how to map rewards is a choice about the task, and no search makes it by itself.

use nalgebra::DVector;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{Mode, Search, SearchSnapshot};
use crate::range::{Range, range};
use crate::trial::{Proposal, Trial};

/// How rewards become what the search is told; the session keeps them as they are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum RewardMap {
    /// r.
    #[default]
    None,
    /// r + shift; refuses rewards below −shift.
    Shift(f64),
    /// exp(r / scale), for costs and log-likelihoods. The scale is about the spread of the rewards.
    Exp(f64),
}

impl RewardMap {
    /// Settings and their ranges.
    pub fn ranges(&self) -> Vec<Range> {
        match *self {
            RewardMap::None => Vec::new(),
            RewardMap::Shift(shift) => vec![range("shift", shift, 0.0, 1e12, "1")],
            RewardMap::Exp(scale) => vec![range("exp", scale, 1e-12, 1e12, "1")],
        }
    }

    fn apply(self, reward: f64) -> f64 {
        match self {
            RewardMap::None => reward,
            RewardMap::Shift(shift) => reward + shift,
            RewardMap::Exp(scale) => (reward / scale).exp(),
        }
    }
}

/// Why a search cannot learn from a reward.
#[derive(Debug, Error, PartialEq)]
pub enum RewardError {
    #[error("its reward is {reward}; rewards are finite numbers")]
    NotFinite { reward: f64 },
    #[error(
        "its reward is {reward}, and {why}, which must not be negative: map them with \
         learner.search.reward_map = {{ exp = 1.0 }} (exp(r / 1.0)) or {{ shift = 10.0 }} \
         (r + 10.0), or use a search that only compares rewards, such as power with \
         weights = \"rank\", or cem"
    )]
    Negative { reward: f64, why: &'static str },
    #[error(
        "its reward is {reward}, below the -{shift} that learner.search.reward_map = {{ shift = \
         {shift} }} allows: set a larger shift"
    )]
    Shift { reward: f64, shift: f64 },
    #[error(
        "its reward is {reward}, and exp(r / {scale}) is {mapped}: set \
         learner.search.reward_map = {{ exp = … }} to about the spread of the rewards"
    )]
    Exp { reward: f64, scale: f64, mapped: f64 },
}

/// That a reward is a finite number.
pub(super) fn finite(reward: f64) -> Result<(), RewardError> {
    if reward.is_finite() { Ok(()) } else { Err(RewardError::NotFinite { reward }) }
}

/// That a reward is a finite number from 0 up; `why` names the search and what it does with rewards.
pub(super) fn not_negative(reward: f64, why: &'static str) -> Result<(), RewardError> {
    finite(reward)?;
    if reward >= 0.0 { Ok(()) } else { Err(RewardError::Negative { reward, why }) }
}

/// `search`, told rewards through `map`.
pub(super) fn mapped(map: RewardMap, search: Box<dyn Search>) -> Box<dyn Search> {
    match map {
        RewardMap::None => search,
        map => Box::new(Mapped { map, search }),
    }
}

/// A search of mapped rewards.
struct Mapped {
    map: RewardMap,
    search: Box<dyn Search>,
}

impl Search for Mapped {
    fn ask(&self, rollout: u64, pending: &[Proposal]) -> Proposal {
        self.search.ask(rollout, pending)
    }

    fn note(&mut self, proposal: &Proposal, pending: &[Proposal]) {
        self.search.note(proposal, pending);
    }

    fn check_reward(&self, reward: f64) -> Result<(), RewardError> {
        finite(reward)?;
        let mapped = self.map.apply(reward);
        match self.map {
            RewardMap::Shift(shift) if mapped < 0.0 => Err(RewardError::Shift { reward, shift }),
            // Beyond both ends of the number range all rewards would be the same.
            RewardMap::Exp(scale) if !mapped.is_normal() => {
                Err(RewardError::Exp { reward, scale, mapped })
            }
            _ => self.search.check_reward(mapped),
        }
    }

    fn tell(&mut self, trial: &Trial) {
        self.search.tell(&Trial { reward: self.map.apply(trial.reward), ..trial.clone() });
    }

    fn mean(&self) -> &DVector<f64> {
        self.search.mean()
    }

    fn snapshot(&self, rollout: u64) -> SearchSnapshot {
        self.search.snapshot(rollout)
    }

    fn doubted(&self) -> Vec<usize> {
        self.search.doubted()
    }

    fn modes(&self) -> Vec<Mode> {
        self.search.modes()
    }
}
