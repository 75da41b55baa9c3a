//! Rollouts that were not executed, or gave nothing to learn from: counted all the same.

use shm_types::episode::{EpisodeHeader, FAULT_POLICY_REFUSED, TickRecord};
use shm_types::measures::Measures;

use super::Learner;
use crate::error::CompleteError;
use crate::judge::JudgeError;
use crate::path::decimate;
use crate::store::{Event, TrialRecord};
use crate::summary::TrialReport;

impl Learner {
    /// Gives up on a rollout in flight, which gives no usable episode: it is stored and counted, but not
    /// learnt, and the session goes on.
    pub fn set_aside(
        &mut self,
        cell: &str,
        rollout: u64,
        reason: &str,
    ) -> Result<TrialReport, CompleteError> {
        let trial = TrialRecord { set_aside: true, ..self.not_executed(cell, rollout)? };
        let note = note("set aside", trial.rollout, reason);
        self.record(trial, None, &[], Some(&note))
    }

    /// Gives up on a rollout in flight, which was executed but has no verdict: its measures and its
    /// path are stored, so that it can be judged another time.
    pub fn not_judged(
        &mut self,
        cell: &str,
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
            ..self.not_executed(cell, header.rollout)?
        };
        let records = header.validate(records)?;
        let note = note("not judged", trial.rollout, &error.to_string());
        self.record(trial, Some(&header.equipment), &decimate(records), Some(&note))
    }

    /// How many of the newest trials, without a break, were set aside.
    pub fn set_aside_in_a_row(&self) -> u64 {
        self.trials.iter().rev().take_while(|trial| trial.set_aside).count() as u64
    }

    /// Counts a rollout in flight, whose policy the controller refused: like any other failure of a
    /// policy it is a trial, and the session goes on. It is worth nothing, and where rewards are
    /// negative no more than the worst so far.
    pub fn refused(
        &mut self,
        cell: &str,
        rollout: u64,
        reason: &str,
    ) -> Result<TrialReport, CompleteError> {
        let rewards = self.trials.iter().filter(|trial| !trial.set_aside).map(|trial| trial.reward);
        let own_reward = rewards.fold(0.0, f64::min);
        let fault = FAULT_POLICY_REFUSED;
        let unexecuted = self.not_executed(cell, rollout)?;
        let trial = self.seen(TrialRecord { fault, own_reward, ..unexecuted });
        let note = note("refused", trial.rollout, reason);
        self.tell(&trial)?;
        self.record(trial, None, &[], Some(&note))
    }

    /// The trial of a rollout in flight when nothing was executed.
    fn not_executed(&self, cell: &str, rollout: u64) -> Result<TrialRecord, CompleteError> {
        match self.in_flight.get(&rollout) {
            Some(flight) => Ok(self.unjudged(flight, cell)),
            None if self.is_told(rollout) => Err(CompleteError::Duplicate { rollout }),
            None => Err(CompleteError::NotAsked { rollout }),
        }
    }

    /// This rollout, in flight, is where the session began: the demonstration, without exploration.
    pub fn asks_for_the_start(&self, rollout: u64) -> bool {
        let flight = self.in_flight.get(&rollout);
        flight.is_some_and(|flight| self.problem.starts_at(&flight.asked.proposal.theta))
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
