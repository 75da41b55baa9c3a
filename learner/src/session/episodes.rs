//! What comes back from a cell: learnt, asked for again, or given up.

use std::time::Instant;

use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::telemetry::WAITS_JUDGE;

use super::{ATTEMPTS, Event, LONG, NOT_JUDGED, REFUSED, SET_ASIDE, Session, SessionError};
use crate::cells::odd_ones;
use crate::error::{CompleteError, LearnerError};
use crate::judge::JudgeError;
use crate::learner::Learner;
use crate::summary::TrialReport;

/// Trials between two looks for cells that differ.
const ODD_EVERY: usize = 10;

/// What became of an episode.
type Completed = Result<TrialReport, CompleteError>;

/// What ends the session, apart from what an episode may lack.
fn sessions_end(completed: Completed) -> Result<Completed, LearnerError> {
    match completed {
        Err(CompleteError::Learner(error)) => Err(error),
        completed => Ok(completed),
    }
}

impl Session<'_> {
    /// Takes what has come from all cells, one episode of each at a time. How many; `None` when stopped.
    pub(super) fn take_episodes(&mut self) -> Result<Option<usize>, SessionError> {
        let mut taken = 0;
        for k in 0..self.links.len() {
            let Some(ports) = &self.links[k].ports else { continue };
            if let Ok(Some(episode)) = ports.episodes.receive() {
                taken += 1;
                if self.take(k, episode.user_header(), episode.payload())?.is_none() {
                    return Ok(None);
                }
            }
        }
        Ok(Some(taken))
    }

    /// Takes an episode of cell `k`.
    fn take(
        &mut self,
        k: usize,
        header: &EpisodeHeader,
        records: &[TickRecord],
    ) -> Result<Option<()>, SessionError> {
        let rollout = header.rollout;
        let policy = self.learner.in_flight().find(|policy| policy.rollout == rollout).copied();
        if policy.is_some_and(|policy| policy.session == header.session)
            && let Err(error) = self.check_equipment(header)
        {
            return self.unusable(k, rollout, &error);
        }
        // While its episode is in hand, a controller that restarts need not execute it again.
        let asked = self.links[k].asked.take_if(|asked| asked.policy.rollout == rollout);
        let Some(completed) = self.completed(k, header, records)? else { return Ok(None) };
        self.links[k].asked = self.links[k].asked.take().or(asked);
        match completed {
            Ok(report) => {
                self.links[k].set_aside_in_a_row = 0;
                if let Some(policy) = policy {
                    (self.on_event)(Event::executed(&policy, header, records));
                }
                self.landed(k, &report);
            }
            Err(CompleteError::Refused { reason, .. }) => return self.refused(k, rollout, reason),
            Err(CompleteError::NotJudged { error, .. }) => {
                return self.not_judged(k, header, records, &error);
            }
            // Another cell was asked for it meanwhile, or its acknowledgement was lost: it is learnt already.
            Err(refused @ CompleteError::Duplicate { .. }) => {
                tracing::debug!("cell {}: {refused}", self.links[k].name());
                self.links[k].newest = rollout;
                self.links[k].asked.take_if(|asked| asked.policy.rollout == rollout);
                self.acknowledge(k);
            }
            // An operator's or the machine's doing, as often as it comes: no attempt of ours.
            Err(
                no_trial @ (CompleteError::Swapped { .. } | CompleteError::MachineFault { .. }),
            ) => {
                self.ask_again(k, rollout, no_trial.to_string())?;
            }
            Err(
                unusable @ (CompleteError::Invalid(_)
                | CompleteError::NotExecuted { .. }
                | CompleteError::Tell(_)),
            ) => return self.unusable(k, rollout, &unusable),
            Err(refused) => tracing::warn!("episode refused: {refused}"),
        }
        Ok(Some(()))
    }

    /// Has an episode judged, however long its judge takes, and stored; `None` when stopped. The controllers
    /// hear meanwhile that this learner lives.
    fn completed(
        &mut self,
        k: usize,
        header: &EpisodeHeader,
        records: &[TickRecord],
    ) -> Result<Option<Completed>, SessionError> {
        let (since, cell) = (Instant::now(), self.links[k].name().to_string());
        loop {
            let complete =
                |learner: &mut Learner| sessions_end(learner.complete(&cell, header, records));
            match self.stored(complete)? {
                Some(Err(CompleteError::BeingJudged { .. })) => {}
                completed => return Ok(completed),
            }
            if self.is_stopped() {
                return Ok(None);
            }
            if since.elapsed() >= LONG {
                self.waits = WAITS_JUDGE;
            }
            self.look_around()?;
        }
    }

    /// An episode of which nothing can be learnt: the rollout is asked for again, some times.
    fn unusable(
        &mut self,
        k: usize,
        rollout: u64,
        error: &CompleteError,
    ) -> Result<Option<()>, SessionError> {
        let was_executed = !matches!(error, CompleteError::NotExecuted { .. });
        let reason = error.to_string();
        let Some(asked) = self.links[k].asked.as_mut().filter(|a| a.policy.rollout == rollout)
        else {
            tracing::warn!("cell {}: {reason}", self.links[k].name());
            return Ok(Some(()));
        };
        asked.attempts += 1;
        let attempts = asked.attempts;
        match attempts == ATTEMPTS {
            true if was_executed => self.set_aside(k, rollout, reason),
            true => {
                self.retire(k, SessionError::NotExecuted { rollout, attempts, reason })?;
                Ok(Some(()))
            }
            false => {
                self.ask_again(k, rollout, reason)?;
                Ok(Some(()))
            }
        }
    }

    /// Goes on after a policy that a controller refused: asked again, it would say the same.
    fn refused(
        &mut self,
        k: usize,
        rollout: u64,
        reason: String,
    ) -> Result<Option<()>, SessionError> {
        if self.learner.asks_for_the_start(rollout) {
            return Err(SessionError::StartRefused { rollout, reason });
        }
        let cell = self.links[k].name().to_string();
        let store = |learner: &mut Learner| learner.refused(&cell, rollout, &reason);
        let Some(report) = self.stored_trial(store)? else { return Ok(None) };
        let rollouts = self.learner.refused_in_a_row();
        if rollouts >= REFUSED {
            return Err(SessionError::AllRefused { rollouts, last: rollout, reason });
        }
        (self.on_event)(Event::Refused { rollout, reason });
        self.landed(k, &report);
        Ok(Some(()))
    }

    /// Goes on without a rollout of which there is no verdict: executed again, it would be the same.
    fn not_judged(
        &mut self,
        k: usize,
        header: &EpisodeHeader,
        records: &[TickRecord],
        error: &JudgeError,
    ) -> Result<Option<()>, SessionError> {
        let (rollout, cell) = (header.rollout, self.links[k].name().to_string());
        let store = |learner: &mut Learner| learner.not_judged(&cell, header, records, error);
        let Some(report) = self.stored_trial(store)? else { return Ok(None) };
        let (rollouts, reason) = (self.learner.set_aside_in_a_row(), error.to_string());
        if rollouts >= NOT_JUDGED {
            return Err(SessionError::NoneJudged { rollouts, last: rollout, reason });
        }
        (self.on_event)(Event::SetAside { rollout, reason });
        self.landed(k, &report);
        Ok(Some(()))
    }

    /// Goes on without a rollout that cannot be used.
    fn set_aside(
        &mut self,
        k: usize,
        rollout: u64,
        reason: String,
    ) -> Result<Option<()>, SessionError> {
        self.links[k].set_aside_in_a_row += 1;
        if self.links[k].set_aside_in_a_row == SET_ASIDE {
            self.retire(k, SessionError::Unusable { rollouts: SET_ASIDE, last: rollout, reason })?;
            return Ok(Some(()));
        }
        let cell = self.links[k].name().to_string();
        let store = |learner: &mut Learner| learner.set_aside(&cell, rollout, &reason);
        let Some(report) = self.stored_trial(store)? else { return Ok(None) };
        (self.on_event)(Event::SetAside { rollout, reason });
        self.landed(k, &report);
        Ok(Some(()))
    }

    /// A trial of a rollout in flight, of which only the disk can say no; `None` when stopped.
    fn stored_trial(
        &mut self,
        mut store: impl FnMut(&mut Learner) -> Result<TrialReport, CompleteError>,
    ) -> Result<Option<TrialReport>, SessionError> {
        self.stored(|learner| match store(learner) {
            Ok(report) => Ok(report),
            Err(CompleteError::Learner(error)) => Err(error),
            Err(other) => unreachable!("the rollout is in flight: {other}"),
        })
    }

    /// A rollout of cell `k` is a trial now: other cells that were asked for it are free, and observers are told.
    fn landed(&mut self, k: usize, report: &TrialReport) {
        for link in &mut self.links {
            link.asked.take_if(|asked| asked.policy.rollout == report.rollout);
        }
        self.links[k].newest = report.rollout;
        // Whether it was a success, a person may have to say first.
        if self.learner.awaits_rating().is_none() {
            self.acknowledge(k);
        }
        (self.on_event)(Event::Trial { cell: self.links[k].name(), report });
        self.name_odd_cells();
        let cells: Vec<_> = self.links.iter().filter_map(|link| link.ports.as_ref()).collect();
        self.news.trial(&cells, self.learner, &mut *self.on_event);
    }

    /// Says, once of each, which cells differ from the others.
    fn name_odd_cells(&mut self) {
        let is_time = self.learner.trials().len().is_multiple_of(ODD_EVERY);
        if self.links.len() < 2 || !is_time {
            return;
        }
        for odd in odd_ones(self.learner.trials()) {
            if !self.odd.contains(&odd.cell) {
                (self.on_event)(Event::Odd(&odd));
                self.odd.push(odd.cell);
            }
        }
    }

    fn ask_again(&mut self, k: usize, rollout: u64, reason: String) -> Result<(), SessionError> {
        let link = &mut self.links[k];
        if link.has(rollout) {
            (self.on_event)(Event::AskedAgain { cell: link.name(), rollout, reason });
            link.ask_again()?;
        }
        Ok(())
    }

    /// Asks cell `k` for nothing more until its controller is a new one; the last cell's end is the session's.
    fn retire(&mut self, k: usize, error: SessionError) -> Result<(), SessionError> {
        let others = self.links.iter().enumerate().filter(|(other, _)| *other != k);
        if others.filter(|(_, link)| !link.is_retired).count() == 0 {
            return Err(error);
        }
        let link = &mut self.links[k];
        (link.is_retired, link.asked, link.set_aside_in_a_row) = (true, None, 0);
        (self.on_event)(Event::Retired { cell: link.name(), reason: error.to_string() });
        Ok(())
    }
}
