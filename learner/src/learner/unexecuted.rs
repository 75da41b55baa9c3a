//! Rollouts that were not executed, or gave nothing to learn from: counted all the same.

use shm_types::episode::{FAULT_POLICY_REFUSED, OutcomeMsg};

use super::Learner;
use crate::error::CompleteError;
use crate::store::TrialRecord;
use crate::summary::TrialReport;
use search::trial::Proposal;

impl Learner {
    /// Gives up on the pending rollout, which gives no usable episode: it is stored and counted,
    /// but not learnt, and the session goes on.
    pub fn set_aside(&mut self, reason: &str) -> Result<TrialReport, CompleteError> {
        let trial = TrialRecord { set_aside: true, ..self.not_executed()? };
        self.note("set aside", trial.rollout, reason)?;
        self.record(trial, &[])
    }

    /// Counts the pending rollout, whose policy the controller refused: like any other failure of a
    /// policy it is a trial, without reward, and the session goes on.
    pub fn refused(&mut self, reason: &str) -> Result<TrialReport, CompleteError> {
        let trial = TrialRecord { fault: FAULT_POLICY_REFUSED, ..self.not_executed()? };
        self.note("refused", trial.rollout, reason)?;
        self.search.tell(&trial.trial())?;
        self.record(trial, &[])
    }

    /// The trial of the pending proposal when nothing was executed.
    fn not_executed(&self) -> Result<TrialRecord, CompleteError> {
        let Some((proposal, policy)) = &self.pending else {
            return Err(CompleteError::NotAsked { rollout: self.durable_rollout() + 1 });
        };
        Ok(TrialRecord {
            rollout: proposal.rollout,
            theta: proposal.theta.clone(),
            reward: 0.0,
            policy_id: policy.policy_id,
            policy_digest: policy.digest,
            boot_id: 0,
            applied_tick: 0,
            fault: 0,
            n_records: 0,
            set_aside: false,
            outcome: OutcomeMsg::ZERO,
        })
    }

    /// Into the session's diary.
    fn note(&mut self, kind: &str, rollout: u64, reason: &str) -> Result<(), CompleteError> {
        let noted = self.store.record_event(kind, &format!("rollout {rollout}: {reason}"));
        noted.map_err(|error| CompleteError::Learner(error.into()))
    }

    /// The pending proposal is where the search starts: the demonstration, without exploration.
    pub fn asks_for_the_start(&self) -> bool {
        let starts = |(proposal, _): &(Proposal, _)| self.problem.starts_at(&proposal.theta);
        self.pending.as_ref().is_some_and(starts)
    }

    /// How many of the newest trials, without a break, are of policies that were refused.
    pub fn refused_in_a_row(&self) -> u64 {
        let trials = self.trials.iter().rev();
        trials.take_while(|trial| trial.fault == FAULT_POLICY_REFUSED).count() as u64
    }
}
