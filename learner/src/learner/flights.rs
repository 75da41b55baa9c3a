//! Rollouts in flight: proposed, durably, and without a trial so far.
//!
//! They are numbered in the order in which they were asked for, without gaps, and told in the order in which they
//! come back.

use shm_types::episode::EpisodeHeader;
use shm_types::equipment::Equipment;
use shm_types::measures::Measures;
use shm_types::policy::PolicyMsg;

use super::Learner;
use crate::error::{CompleteError, LearnerError};
use crate::replay::ask;
use crate::store::{Asked, CellRecord, TrialRecord};

/// A rollout that was asked for.
pub(super) struct Flight {
    pub asked: Asked,
    pub policy: PolicyMsg,
}

impl Learner {
    /// The policy to publish next where one rollout is in flight at a time: the first one in flight, or a new
    /// one. Asking again before it is completed returns the same one.
    pub fn next_policy(&mut self) -> Result<PolicyMsg, LearnerError> {
        let first = self.in_flight().next().copied();
        Ok(match first {
            Some(policy) => policy,
            None => self.put_next("")?,
        })
    }

    /// A further policy beside those in flight, for `cell`, durable and sealed; `None` where there is none to be had
    /// now.
    pub fn another_policy(&mut self, cell: &str) -> Result<Option<PolicyMsg>, LearnerError> {
        self.may_ask().then(|| self.put_next(cell)).transpose()
    }

    /// The cell that a rollout in flight was given to last, by this or an earlier run; empty where there is but one.
    pub fn given_to(&self, rollout: u64) -> Option<&str> {
        self.in_flight.get(&rollout).map(|flight| flight.asked.cell.as_str())
    }

    /// Gives a rollout in flight to `cell`, durably.
    pub fn give(&mut self, rollout: u64, cell: &str) -> Result<(), LearnerError> {
        if let Some(flight) = self.in_flight.get_mut(&rollout)
            && flight.asked.cell != cell
        {
            self.store.put_given(rollout, cell)?;
            flight.asked.cell = cell.into();
        }
        Ok(())
    }

    /// What the cells drive, in the order of the trials from which on they do.
    pub fn cells(&self) -> &[CellRecord] {
        &self.cells
    }

    /// What a trial tells of its cell, if that is news.
    pub(super) fn news_of_cell(
        &self,
        trial: &TrialRecord,
        equipment: &Equipment,
    ) -> Option<CellRecord> {
        let known = self.cells.iter().rev().find(|known| known.cell == trial.cell);
        let told = CellRecord::of(&trial.cell, trial.told, equipment)?;
        known.is_none_or(|known| !known.is_alike(&told)).then_some(told)
    }

    /// The policies in flight, in the order of their rollouts.
    pub fn in_flight(&self) -> impl Iterator<Item = &PolicyMsg> {
        self.in_flight.values().map(|flight| &flight.policy)
    }

    /// Every rollout up to this one is durable and may be acknowledged.
    pub fn durable_rollout(&self) -> u64 {
        let first = self.in_flight.keys().next().copied();
        first.unwrap_or(self.next_rollout()) - 1
    }

    /// Every rollout that was told comes before those in flight: these can be taken back, if they are nowhere
    /// executed.
    pub fn is_settled(&self) -> bool {
        self.durable_rollout() == self.trials.len() as u64
    }

    /// This rollout has a trial.
    pub fn is_told(&self, rollout: u64) -> bool {
        (1..self.next_rollout()).contains(&rollout) && !self.in_flight.contains_key(&rollout)
    }

    /// The next rollout that is asked for.
    pub(super) fn next_rollout(&self) -> u64 {
        (self.trials.len() + self.in_flight.len()) as u64 + 1
    }

    /// There are rollouts left, and no rating is waited for.
    pub(super) fn may_ask(&self) -> bool {
        self.next_rollout() <= self.config.rollouts && self.awaits_rating().is_none()
    }

    fn put_next(&mut self, cell: &str) -> Result<PolicyMsg, LearnerError> {
        let flight = self.propose(cell);
        let policy = flight.policy;
        if let Err(error) = self.store.put_proposal(&flight.asked, &policy) {
            self.forget_what_is_not_durable();
            return Err(error.into());
        }
        self.in_flight.insert(policy.rollout, flight);
        Ok(policy)
    }

    /// The next rollout, for `cell`, not durable yet.
    pub(super) fn propose(&mut self, cell: &str) -> Flight {
        let (rollout, after) = (self.next_rollout(), self.trials.len() as u64);
        let proposal = ask(&mut self.search, &self.problem, &self.history, &self.trials, rollout);
        // Before the first trial the mean is where the search starts.
        let is_mean = after > 0 && proposal.theta == *self.search.mean();
        self.flight(Asked { proposal, after, is_mean, cell: cell.into() })
    }

    fn flight(&self, asked: Asked) -> Flight {
        let rollout = asked.proposal.rollout;
        let policy = self.problem.decode(&asked.proposal.theta, self.ids(rollout, rollout));
        Flight { asked, policy }
    }

    /// A stored proposal, which the search has reproduced, again: its policy must be what was stored before it
    /// was published.
    pub(super) fn take_up(&mut self, asked: Asked) -> Result<(), LearnerError> {
        let flight = self.flight(asked);
        let (rollout, policy) = (flight.policy.rollout, flight.policy);
        if self.store.policy(policy.policy_id)? != Some(policy) {
            return Err(LearnerError::NotReproduced { rollout });
        }
        self.in_flight.insert(rollout, flight);
        Ok(())
    }

    /// The flight that an episode says it executed.
    pub(super) fn matching_flight(&self, header: &EpisodeHeader) -> Result<&Flight, CompleteError> {
        let (rollout, expected) = (header.rollout, self.session_id());
        if header.session != expected {
            return Err(CompleteError::ForeignSession { found: header.session, expected });
        }
        if self.is_told(rollout) {
            return Err(CompleteError::Duplicate { rollout });
        }
        let Some(flight) = self.in_flight.get(&rollout) else {
            return Err(CompleteError::NotAsked { rollout });
        };
        let PolicyMsg { policy_id, digest, .. } = flight.policy;
        if (header.policy_id, header.policy_digest) != (policy_id, digest) {
            return Err(CompleteError::OtherPolicy { rollout });
        }
        Ok(flight)
    }

    /// The trial of a flight before anything is known of its execution in `cell`.
    pub(super) fn unjudged(&self, flight: &Flight, cell: &str) -> TrialRecord {
        let Asked { proposal, after, is_mean, .. } = &flight.asked;
        TrialRecord {
            rollout: proposal.rollout,
            asked_after: *after,
            told: self.trials.len() as u64 + 1,
            cell: cell.into(),
            theta: proposal.theta.clone(),
            reward: 0.0,
            success: false,
            judged_success: false,
            own_reward: 0.0,
            own_success: false,
            rating: None,
            unrated: false,
            policy_id: flight.policy.policy_id,
            policy_digest: flight.policy.digest,
            boot_id: 0,
            applied_tick: 0,
            fault: 0,
            n_records: 0,
            set_aside: false,
            is_mean: *is_mean,
            measures: Measures::NONE,
        }
    }
}
