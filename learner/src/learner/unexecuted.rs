//! Rollouts that were not executed, or gave nothing to learn from: counted all the same.

use shm_types::episode::{EpisodeHeader, FAULT_POLICY_REFUSED, TickRecord};
use shm_types::measures::Measures;

use super::Learner;
use crate::error::CompleteError;
use crate::judge::JudgeError;
use crate::path::decimate;
use crate::store::{Event, TrialRecord};
use crate::summary::TrialReport;
use search::trial::Proposal;

impl Learner {
    /// Gives up on the pending rollout, which gives no usable episode: it is stored and counted,
    /// but not learnt, and the session goes on.
    pub fn set_aside(&mut self, reason: &str) -> Result<TrialReport, CompleteError> {
        let trial = TrialRecord { set_aside: true, ..self.not_executed()? };
        let note = note("set aside", trial.rollout, reason);
        self.record(trial, &[], Some(&note))
    }

    /// Gives up on the pending rollout, which was executed but has no verdict: its measures and its
    /// path are stored, so that it can be judged another time.
    pub fn not_judged(
        &mut self,
        header: &EpisodeHeader,
        records: &[TickRecord],
        error: &JudgeError,
    ) -> Result<TrialReport, CompleteError> {
        let measures = match error {
            JudgeError::Verdict { measures, .. } => **measures,
            _ => Measures::NONE,
        };
        let trial = TrialRecord {
            set_aside: true,
            boot_id: header.boot_id,
            applied_tick: header.applied_tick,
            fault: header.fault,
            n_records: header.n_records,
            measures,
            ..self.not_executed()?
        };
        let records = header.validate(records)?;
        let note = note("not judged", trial.rollout, &error.to_string());
        self.record(trial, &decimate(records), Some(&note))
    }

    /// How many of the newest trials, without a break, were set aside.
    pub fn set_aside_in_a_row(&self) -> u64 {
        self.trials.iter().rev().take_while(|trial| trial.set_aside).count() as u64
    }

    /// Counts the pending rollout, whose policy the controller refused: like any other failure of a
    /// policy it is a trial, and the session goes on. It is worth nothing, and where rewards are
    /// negative no more than the worst so far.
    pub fn refused(&mut self, reason: &str) -> Result<TrialReport, CompleteError> {
        let rewards = self.trials.iter().filter(|trial| !trial.set_aside).map(|trial| trial.reward);
        let own_reward = rewards.fold(0.0, f64::min);
        let fault = FAULT_POLICY_REFUSED;
        let trial = self.seen(TrialRecord { fault, own_reward, ..self.not_executed()? });
        let note = note("refused", trial.rollout, reason);
        self.tell(&trial)?;
        self.record(trial, &[], Some(&note))
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
            success: false,
            judged_success: false,
            own_reward: 0.0,
            own_success: false,
            rating: None,
            unrated: false,
            policy_id: policy.policy_id,
            policy_digest: policy.digest,
            boot_id: 0,
            applied_tick: 0,
            fault: 0,
            n_records: 0,
            set_aside: false,
            is_mean: self.is_mean(proposal),
            measures: Measures::NONE,
        })
    }

    /// The pending proposal is where the session began: the demonstration, without exploration.
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

/// For the session's diary.
fn note(kind: &str, rollout: u64, reason: &str) -> Event {
    Event { kind: kind.into(), text: format!("rollout {rollout}: {reason}") }
}
