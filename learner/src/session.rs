//! The session loop: ask → publish → receive → reward → tell → checkpoint.
//!
//! The loop never waits for ever: it wakes up at least every [`WAIT`], shows that it lives, and
//! looks at `stop`. A controller that restarts is asked again; one that is silent is waited for,
//! visibly. What it must not do twice, it does not: [`Learner::complete`] refuses an episode that
//! is late, foreign or a duplicate.

mod controller;
mod event;
mod news;
mod people;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use shm_types::SCHEMA;
use shm_types::episode::{Ack, EpisodeHeader, TickRecord};
use shm_types::policy::PolicyMsg;
use shm_types::ports::LearnerPorts;
use shm_types::telemetry::{Heartbeat, WAITS_DISK, WAITS_JUDGE, WAITS_NOT};

use crate::error::{CompleteError, LearnerError};
use crate::judge::JudgeError;
use crate::learner::Learner;
use crate::summary::TrialReport;
pub use event::{End, Event, SessionError};
use news::News;

/// Longest wait for an episode before the loop looks around.
const WAIT: Duration = Duration::from_millis(50);
/// What the disk refused is tried again after this long.
const RETRY: Duration = Duration::from_secs(1);
const HOUSEKEEPING: Duration = Duration::from_secs(1);
/// Unusable episodes of one rollout after which it is set aside, or, when it was not executed at
/// all, the session ends.
const ATTEMPTS: u32 = 3;
/// Rollouts set aside in a row after which the session ends: the fault lies elsewhere.
const SET_ASIDE: u32 = 3;
/// Policies refused in a row after which the session ends: the search will not find its way back.
const REFUSED: u64 = 20;
/// Rollouts without a verdict in a row after which the session ends: nothing is learnt.
const NOT_JUDGED: u64 = 20;
/// A judge that takes longer is what the learner is said to wait for.
const LONG: Duration = Duration::from_secs(1);
/// A rollout that takes longer, Approach included, is asked for again.
const ROLLOUT: Duration = Duration::from_secs(30);

/// Runs the session until it is done or stopped. When the disk refuses something, it waits if it
/// `is_patient`, as a service is; else that is its end.
pub fn run(
    ports: LearnerPorts,
    learner: &mut Learner,
    is_patient: bool,
    stop: &AtomicBool,
    on_event: &mut dyn FnMut(Event<'_>),
) -> Result<End, SessionError> {
    let mut link = Link::new(ports, is_patient);
    let end = link.learn(learner, stop, on_event)?;
    link.beat(true);
    Ok(end)
}

/// What became of an episode.
type Completed = Result<TrialReport, CompleteError>;

/// What ends the session, apart from what an episode may lack.
fn sessions_end(completed: Completed) -> Result<Completed, LearnerError> {
    match completed {
        Err(CompleteError::Learner(error)) => Err(error),
        completed => Ok(completed),
    }
}

/// The learner's side of the cell, with what is known of the other side.
struct Link {
    ports: LearnerPorts,
    is_patient: bool,
    next_beat: Instant,
    next_housekeeping: Instant,
    beat_counter: u64,
    controller: Option<Heartbeat>,
    heard: Instant,
    is_silent: bool,
    is_pinned: bool,
    /// Fault after which the arm is held, or 0.
    latched: u64,
    /// What this learner is waiting for, as the controller is told.
    waits: u64,
    /// The search stands still, and a demonstration would help.
    asks: bool,
    set_aside_in_a_row: u32,
    news: News,
}

impl Link {
    fn new(ports: LearnerPorts, is_patient: bool) -> Link {
        let now = Instant::now();
        Link {
            ports,
            is_patient,
            next_beat: now,
            next_housekeeping: now + HOUSEKEEPING,
            beat_counter: 0,
            controller: None,
            heard: now,
            is_silent: false,
            is_pinned: false,
            latched: 0,
            waits: WAITS_NOT,
            asks: false,
            set_aside_in_a_row: 0,
            news: News::default(),
        }
    }

    /// Trial after trial, until the session is done or stopped.
    fn learn(
        &mut self,
        learner: &mut Learner,
        stop: &AtomicBool,
        on_event: &mut dyn FnMut(Event<'_>),
    ) -> Result<End, SessionError> {
        // The last acknowledgement of an earlier run may have been lost with its process.
        self.acknowledge(learner);
        self.news.all(&self.ports, learner);
        if self.hear_people(learner, stop, on_event)?.is_none() {
            return Ok(End::Stopped);
        }
        while !learner.is_done() {
            let Some(policy) = self.stored(stop, on_event, || learner.next_policy())? else {
                return Ok(End::Stopped);
            };
            self.publish(&policy)?;
            let Some(report) = self.await_trial(learner, &policy, stop, on_event)? else {
                return Ok(End::Stopped);
            };
            // Whether it was a success, a person may have to say first.
            let is_rated_first = learner.awaits_rating().is_some();
            if !is_rated_first {
                self.acknowledge(learner);
            }
            on_event(Event::Trial(&report));
            self.news.trial(&self.ports, learner, on_event);
            if self.hear_people(learner, stop, on_event)?.is_none() {
                return Ok(End::Stopped);
            }
            if is_rated_first {
                self.acknowledge(learner);
            }
        }
        Ok(End::Done)
    }

    fn publish(&self, policy: &PolicyMsg) -> Result<(), SessionError> {
        self.ports.policies.send_copy(*policy).map(|_receivers| ()).map_err(|error| {
            SessionError::Publish { rollout: policy.rollout, reason: format!("{error:?}") }
        })
    }

    /// Tells the controller what is durable. It is cumulative, so a lost one does no harm.
    fn acknowledge(&self, learner: &Learner) {
        let (session, durable_rollout) = (learner.session_id(), learner.durable_rollout());
        let success = u64::from(learner.trials().last().is_some_and(|trial| trial.success));
        let ack = Ack { schema: SCHEMA, session, durable_rollout, success };
        if let Err(error) = self.ports.acks.send_copy(ack) {
            tracing::warn!("acknowledgement of rollout {durable_rollout} not sent: {error:?}");
        }
    }

    /// Waits for the episode of `policy`; `None` when stopped.
    fn await_trial(
        &mut self,
        learner: &mut Learner,
        policy: &PolicyMsg,
        stop: &AtomicBool,
        on_event: &mut dyn FnMut(Event<'_>),
    ) -> Result<Option<TrialReport>, SessionError> {
        let mut asked = Instant::now();
        let mut attempts = 0;
        loop {
            while let Ok(Some(episode)) = self.ports.episodes.receive() {
                let executed = (episode.user_header(), episode.payload());
                let completed = self.completed(learner, policy, executed, stop, on_event)?;
                let Some(completed) = completed else { return Ok(None) };
                match completed {
                    Ok(report) => {
                        self.set_aside_in_a_row = 0;
                        on_event(Event::executed(policy, executed.0, executed.1));
                        return Ok(Some(report));
                    }
                    Err(CompleteError::Refused { rollout, reason }) => {
                        return self.refused(learner, rollout, reason, stop, on_event);
                    }
                    Err(CompleteError::NotJudged { rollout, error }) => {
                        return self.not_judged(learner, rollout, executed, &error, stop, on_event);
                    }
                    // An operator's or the machine's doing, as often as it comes: no attempt of ours.
                    Err(
                        no_trial @ (CompleteError::Swapped { rollout }
                        | CompleteError::MachineFault { rollout }),
                    ) => {
                        on_event(Event::AskedAgain { rollout, reason: no_trial.to_string() });
                        self.publish(policy)?;
                        asked = Instant::now();
                    }
                    Err(
                        unusable @ (CompleteError::Invalid(_)
                        | CompleteError::NotExecuted { .. }
                        | CompleteError::Tell(_)),
                    ) => {
                        let was_executed = !matches!(unusable, CompleteError::NotExecuted { .. });
                        attempts += 1;
                        let (rollout, reason) = (policy.rollout, unusable.to_string());
                        if attempts == ATTEMPTS && !was_executed {
                            return Err(SessionError::NotExecuted { rollout, attempts, reason });
                        }
                        if attempts == ATTEMPTS {
                            return self.set_aside(learner, rollout, reason, stop, on_event);
                        }
                        on_event(Event::AskedAgain { rollout, reason });
                        self.publish(policy)?;
                        asked = Instant::now();
                    }
                    Err(refused) => tracing::warn!("episode refused: {refused}"),
                }
            }
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            let restarted = self.look_around(on_event)?;
            if self.is_pinned || self.latched != 0 {
                asked = Instant::now(); // it waits for its turn
            }
            let reason = match (restarted, asked.elapsed() >= ROLLOUT && !self.is_silent) {
                (true, _) => Some("the controller has restarted".to_string()),
                (_, true) => Some("its episode did not come".to_string()),
                _ => None,
            };
            if let Some(reason) = reason {
                on_event(Event::AskedAgain { rollout: policy.rollout, reason });
                self.acknowledge(learner);
                self.news.all(&self.ports, learner);
                self.publish(policy)?;
                asked = Instant::now();
            }
            self.wait();
        }
    }

    /// Has an episode judged, however long its judge takes, and stored; `None` when stopped. The controller
    /// hears meanwhile that this learner lives.
    fn completed(
        &mut self,
        learner: &mut Learner,
        policy: &PolicyMsg,
        (header, records): (&EpisodeHeader, &[TickRecord]),
        stop: &AtomicBool,
        on_event: &mut dyn FnMut(Event<'_>),
    ) -> Result<Option<Completed>, SessionError> {
        let since = Instant::now();
        loop {
            let complete = || sessions_end(learner.complete(policy, header, records));
            match self.stored(stop, on_event, complete)? {
                Some(Err(CompleteError::BeingJudged { .. })) => {}
                completed => return Ok(completed),
            }
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            if since.elapsed() >= LONG {
                self.waits = WAITS_JUDGE;
            }
            // Who restarted meanwhile gets the next policy.
            self.look_around(on_event)?;
        }
    }

    /// For an episode, or a moment.
    fn wait(&self) {
        // A failed wait must not turn the loop into a spin.
        if self.ports.episode_sent.timed_wait(|_| {}, WAIT).is_err() {
            std::thread::sleep(WAIT);
        }
    }

    /// Goes on after a policy that the controller refused: asked again, it would say the same.
    fn refused(
        &mut self,
        learner: &mut Learner,
        rollout: u64,
        reason: String,
        stop: &AtomicBool,
        on_event: &mut dyn FnMut(Event<'_>),
    ) -> Result<Option<TrialReport>, SessionError> {
        if learner.asks_for_the_start() {
            return Err(SessionError::StartRefused { rollout, reason });
        }
        let report = self.stored_trial(stop, on_event, || learner.refused(&reason))?;
        let rollouts = learner.refused_in_a_row();
        if rollouts >= REFUSED {
            return Err(SessionError::AllRefused { rollouts, last: rollout, reason });
        }
        if report.is_some() {
            on_event(Event::Refused { rollout, reason });
        }
        Ok(report)
    }

    /// Goes on without a rollout of which there is no verdict: executed again, it would be the same.
    fn not_judged(
        &mut self,
        learner: &mut Learner,
        rollout: u64,
        (header, records): (&EpisodeHeader, &[TickRecord]),
        error: &JudgeError,
        stop: &AtomicBool,
        on_event: &mut dyn FnMut(Event<'_>),
    ) -> Result<Option<TrialReport>, SessionError> {
        let store = || learner.not_judged(header, records, error);
        let report = self.stored_trial(stop, on_event, store)?;
        let (rollouts, reason) = (learner.set_aside_in_a_row(), error.to_string());
        if rollouts >= NOT_JUDGED {
            return Err(SessionError::NoneJudged { rollouts, last: rollout, reason });
        }
        if report.is_some() {
            on_event(Event::SetAside { rollout, reason });
        }
        Ok(report)
    }

    /// Goes on without a rollout that cannot be used.
    fn set_aside(
        &mut self,
        learner: &mut Learner,
        rollout: u64,
        reason: String,
        stop: &AtomicBool,
        on_event: &mut dyn FnMut(Event<'_>),
    ) -> Result<Option<TrialReport>, SessionError> {
        self.set_aside_in_a_row += 1;
        if self.set_aside_in_a_row == SET_ASIDE {
            return Err(SessionError::Unusable { rollouts: SET_ASIDE, last: rollout, reason });
        }
        let report = self.stored_trial(stop, on_event, || learner.set_aside(&reason))?;
        if report.is_some() {
            on_event(Event::SetAside { rollout, reason });
        }
        Ok(report)
    }

    /// The same for a trial of the pending rollout, of which only the disk can say no.
    fn stored_trial(
        &mut self,
        stop: &AtomicBool,
        on_event: &mut dyn FnMut(Event<'_>),
        mut store: impl FnMut() -> Result<TrialReport, CompleteError>,
    ) -> Result<Option<TrialReport>, SessionError> {
        self.stored(stop, on_event, || match store() {
            Ok(report) => Ok(report),
            Err(CompleteError::Learner(error)) => Err(error),
            Err(other) => unreachable!("the rollout is pending: {other}"),
        })
    }

    /// Has something stored, again and again while the disk refuses it; `None` when stopped. Nothing
    /// is lost meanwhile: what was not stored was not learnt, published or acknowledged.
    fn stored<T>(
        &mut self,
        stop: &AtomicBool,
        on_event: &mut dyn FnMut(Event<'_>),
        mut store: impl FnMut() -> Result<T, LearnerError>,
    ) -> Result<Option<T>, SessionError> {
        let mut refused: Option<Instant> = None;
        loop {
            if refused.is_none_or(|at| at.elapsed() >= RETRY) {
                match store() {
                    Err(LearnerError::Store(error)) if self.is_patient && error.may_pass() => {
                        if refused.is_none() {
                            on_event(Event::NotStored(error.to_string()));
                            self.waits = WAITS_DISK;
                        }
                        refused = Some(Instant::now());
                    }
                    result => {
                        self.waits = WAITS_NOT;
                        if refused.is_some() && result.is_ok() {
                            on_event(Event::Stored);
                        }
                        return Ok(Some(result?));
                    }
                }
            }
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            // Who restarted meanwhile gets the next policy.
            self.look_around(on_event)?;
            std::thread::sleep(WAIT);
        }
    }
}
