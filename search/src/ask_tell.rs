//! Checks between a search and its callers: only requested trials are learnt, each once.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::DVector;
use thiserror::Error;

use super::{Mode, RewardError, Search, SearchSnapshot};
use crate::trial::{Proposal, Trial};

/// Why a trial was not learnt. Nothing has changed; the session goes on.
#[derive(Debug, Error, PartialEq)]
pub enum TellError {
    #[error("trial {rollout}: {why}")]
    Reward { rollout: u64, why: RewardError },
    #[error("trial {rollout}: θ has {found} numbers instead of {expected}")]
    Dimension { rollout: u64, found: usize, expected: usize },
    #[error("trial {rollout}: θ is not finite")]
    Theta { rollout: u64 },
    #[error("trial {rollout} was not proposed")]
    NotAsked { rollout: u64 },
    #[error("trial {rollout} was already reported")]
    Duplicate { rollout: u64 },
}

/// A search behind checks. Several rollouts may be in flight, and are told in any order; the same calls in the
/// same order give the same bits.
pub struct AskTell {
    search: Box<dyn Search>,
    dim: usize,
    in_flight: BTreeMap<u64, Proposal>,
    told: BTreeSet<u64>,
}

impl AskTell {
    pub fn new(search: Box<dyn Search>) -> AskTell {
        let dim = search.mean().len();
        AskTell { search, dim, in_flight: BTreeMap::new(), told: BTreeSet::new() }
    }

    /// The θ for rollout `rollout` (from 1), knowing of the rollouts before it that are in flight. One that is in
    /// flight itself keeps its θ, whatever was told since: a caller that lost a proposal asks again.
    pub fn ask(&mut self, rollout: u64) -> Proposal {
        if let Some(proposal) = self.in_flight.get(&rollout) {
            return proposal.clone();
        }
        let before = self.in_flight.range(..rollout);
        let pending: Vec<Proposal> = before.map(|(_, proposal)| proposal.clone()).collect();
        let proposal = self.search.ask(rollout, &pending);
        if !self.told.contains(&rollout) {
            self.search.note(&proposal, &pending);
            self.in_flight.insert(rollout, proposal.clone());
        }
        proposal
    }

    /// The proposals that were asked for and neither told nor withdrawn, in the order of their rollouts.
    pub fn in_flight(&self) -> impl Iterator<Item = &Proposal> {
        self.in_flight.values()
    }

    /// Gives up a rollout that will never be told, so that no later one reckons with it. It may be asked for
    /// again, and is then another proposal. `None` if it was not in flight.
    pub fn withdraw(&mut self, rollout: u64) -> Option<Proposal> {
        self.in_flight.remove(&rollout)
    }

    pub fn tell(&mut self, trial: &Trial) -> Result<(), TellError> {
        let rollout = trial.rollout;
        if self.told.contains(&rollout) {
            return Err(TellError::Duplicate { rollout });
        }
        if !self.in_flight.contains_key(&rollout) {
            return Err(TellError::NotAsked { rollout });
        }
        let (found, expected) = (trial.theta.len(), self.dim);
        if found != expected {
            return Err(TellError::Dimension { rollout, found, expected });
        }
        if !trial.theta.iter().all(|value| value.is_finite()) {
            return Err(TellError::Theta { rollout });
        }
        let checked = self.search.check_reward(trial.reward);
        checked.map_err(|why| TellError::Reward { rollout, why })?;
        self.in_flight.remove(&rollout);
        self.told.insert(rollout);
        self.search.tell(trial);
        Ok(())
    }

    pub fn mean(&self) -> &DVector<f64> {
        self.search.mean()
    }

    pub fn snapshot(&self, rollout: u64) -> SearchSnapshot {
        self.search.snapshot(rollout)
    }

    pub fn doubted(&self) -> Vec<usize> {
        self.search.doubted()
    }

    pub fn modes(&self) -> Vec<Mode> {
        self.search.modes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{SearchConfig, Space, build};

    fn desk() -> AskTell {
        let space = Space::white(DVector::zeros(2));
        AskTell::new(build(&SearchConfig::default(), 1, space))
    }

    fn trial(rollout: u64, reward: f64) -> Trial {
        Trial { rollout, theta: DVector::zeros(2), reward, success: false, measured: Vec::new() }
    }

    #[test]
    fn bad_trials_are_named_and_change_nothing() {
        let mut desk = desk();
        let next = desk.ask(2);
        for reward in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let error = desk.tell(&trial(2, reward)).unwrap_err().to_string();
            assert!(error.contains("trial 2: its reward is"), "{error}");
        }
        let long = Trial { theta: DVector::zeros(3), ..trial(2, 1.0) };
        assert_eq!(
            desk.tell(&long),
            Err(TellError::Dimension { rollout: 2, found: 3, expected: 2 })
        );
        let far = Trial { theta: DVector::repeat(2, f64::NAN), ..trial(2, 1.0) };
        assert_eq!(desk.tell(&far), Err(TellError::Theta { rollout: 2 }));
        assert_eq!(desk.tell(&trial(9, 1.0)), Err(TellError::NotAsked { rollout: 9 }));
        assert_eq!(desk.ask(2), next);

        assert_eq!(desk.tell(&trial(2, 0.0)), Ok(()));
        assert_eq!(desk.tell(&trial(2, 0.0)), Err(TellError::Duplicate { rollout: 2 }));
    }
}
