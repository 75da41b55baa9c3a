//! The session loop: ask → publish → receive → reward → tell → checkpoint, in every cell of the session.
//!
//! The loop never waits for ever: it wakes up at least every `WAIT`, shows that it lives, and
//! looks at `stop`. A controller that restarts is asked again; one that is silent is waited for,
//! visibly. What it must not do twice, it does not: [`Learner::complete`] refuses an episode that
//! is late, foreign or a duplicate.
//!
//! Where there are several cells, one rollout is in flight in each. A cell holds it on a lease of `ROLLOUT`: then
//! another cell is asked for the same rollout, under the same number. The episode that is durable first counts,
//! the other one is acknowledged and dropped.

mod episodes;
mod equipment;
mod event;
mod hand_out;
mod link;
mod news;
mod people;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use shm_types::cell::Cell;
use shm_types::equipment::Equipment;
use shm_types::ports::wait_for_episode;
use shm_types::service_manager::{Notice, notify};
use shm_types::telemetry::{ASKS_DEMONSTRATION, WAITS_DISK, WAITS_NOT};

use crate::error::LearnerError;
use crate::learner::Learner;
use equipment::Plants;
pub use event::{End, Event, SessionError};
use hand_out::Held;
use link::{Link, Seen};
use news::News;

/// Longest wait for an episode before the loop looks around.
const WAIT: Duration = Duration::from_millis(50);
/// Between two looks for controllers that are to hear that the session is over, and how long to look for them.
const LOOK: Duration = Duration::from_millis(5);
const PARTING: Duration = Duration::from_secs(1);
/// What the disk refused is tried again after this long.
const RETRY: Duration = Duration::from_secs(1);
const WATCHDOG: Duration = Duration::from_secs(1);
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
/// A rollout that takes longer, Approach included, is asked for again, of another cell if there is one.
const ROLLOUT: Duration = Duration::from_secs(30);

/// Where a session learns.
pub struct Cells {
    /// Each with what the session calls it.
    pub named: Vec<(String, Cell)>,
    /// The task and the arm they must drive.
    pub wanted: Equipment,
}

/// Runs the session in these cells until it is done or stopped. When the disk refuses something, it waits if it
/// `is_patient`, as a service is; else that is its end.
///
/// # Errors
/// [`SessionError`]; everything before it is stored.
pub fn run(
    cells: Cells,
    learner: &mut Learner,
    is_patient: bool,
    stop: &AtomicBool,
    on_event: &mut dyn FnMut(Event<'_>),
) -> Result<End, SessionError> {
    let Cells { named, wanted } = cells;
    let links: Vec<Link> =
        named.into_iter().map(|(name, cell)| Link::new(name, cell, learner.trials())).collect();
    let held = Held::of(learner, &links);
    let plants = Plants::of(learner.cells());
    let mut session = Session {
        links,
        learner,
        is_patient,
        stop,
        on_event,
        next_watchdog: Instant::now(),
        waits: WAITS_NOT,
        asks: false,
        awaited: None,
        news: News::default(),
        odd: Vec::new(),
        held,
        wanted,
        plants,
    };
    let end = session.learn()?;
    session.links.iter_mut().for_each(|link| link.beat(WAITS_NOT, true));
    Ok(end)
}

/// A learner with its cells.
struct Session<'a> {
    links: Vec<Link>,
    learner: &'a mut Learner,
    is_patient: bool,
    stop: &'a AtomicBool,
    on_event: &'a mut dyn FnMut(Event<'_>),
    next_watchdog: Instant,
    /// What this learner is waiting for, as the controllers are told.
    waits: u64,
    /// The search stands still, and a demonstration would help.
    asks: bool,
    /// The rollout whose rating learning waits for.
    awaited: Option<u64>,
    news: News,
    /// Cells that were said to differ from the others.
    odd: Vec<String>,
    /// Rollouts that an earlier run gave to a cell which may have executed them.
    held: Held,
    wanted: Equipment,
    plants: Plants,
}

impl Session<'_> {
    /// Trial after trial, until the session is done or stopped.
    fn learn(&mut self) -> Result<End, SessionError> {
        loop {
            let Some(may_ask) = self.hear_people()? else { return Ok(End::Stopped) };
            if self.learner.is_done() && may_ask {
                self.part()?;
                return Ok(End::Done);
            }
            if self.hand_out(may_ask)?.is_none() {
                return Ok(End::Stopped);
            }
            let Some(taken) = self.take_episodes()? else { return Ok(End::Stopped) };
            if self.is_stopped() {
                return Ok(End::Stopped);
            }
            self.look_around()?;
            if taken == 0 {
                self.wait();
            }
        }
    }

    /// The last acknowledgements of an earlier run may have been lost with its process: controllers that are there get
    /// them now.
    fn part(&mut self) -> Result<(), SessionError> {
        let begun = Instant::now();
        while self.links.iter().any(|link| !link.is_met())
            && begun.elapsed() < PARTING
            && !self.is_stopped()
        {
            self.look_around()?;
            std::thread::sleep(LOOK);
        }
        self.acknowledge_all();
        Ok(())
    }

    /// Beats, listens to the controllers, and asks again where it must be.
    fn look_around(&mut self) -> Result<(), SessionError> {
        let now = Instant::now();
        if now >= self.next_watchdog {
            self.next_watchdog = now + WATCHDOG;
            notify(&[Notice::Watchdog]);
        }
        let waits = match self.waits {
            WAITS_NOT if self.asks => ASKS_DEMONSTRATION,
            waits => waits,
        };
        for k in 0..self.links.len() {
            let seen = self.links[k].look(waits, &mut *self.on_event)?;
            self.look_at_equipment(k);
            if seen == Seen::NewController {
                self.acknowledge(k);
                if let Some(ports) = &self.links[k].ports {
                    self.news.all(ports, self.learner);
                }
            }
            self.look_after(k, seen)?;
        }
        Ok(())
    }

    /// Asks cell `k` again for what it has not done, or leaves that to others.
    fn look_after(&mut self, k: usize, seen: Seen) -> Result<(), SessionError> {
        let is_alone = self.links.len() == 1;
        let link = &mut self.links[k];
        let (is_able, is_silent) = (link.is_able(), link.is_silent());
        let Some(asked) = &mut link.asked else { return Ok(()) };
        let rollout = asked.policy.rollout;
        if is_alone && !is_able && !is_silent {
            asked.since = Instant::now(); // it waits for its turn
        }
        let is_over = asked.since.elapsed() >= ROLLOUT;
        let reason = match seen {
            Seen::NewController => "the controller has restarted",
            Seen::Nothing if is_over && !is_alone => {
                link.rest();
                (self.on_event)(Event::LeftToOthers { cell: link.name(), rollout });
                return Ok(());
            }
            Seen::Nothing if is_over && !is_silent => "its episode did not come",
            Seen::Nothing => return Ok(()),
        };
        (self.on_event)(Event::AskedAgain { cell: link.name(), rollout, reason: reason.into() });
        link.ask_again()
    }

    fn acknowledge(&self, k: usize) {
        let (link, learner) = (&self.links[k], &*self.learner);
        let newest = learner.trials().iter().rev().find(|trial| trial.rollout == link.newest);
        let is_success = newest.is_some_and(|trial| trial.success);
        link.acknowledge(learner.session_id(), learner.durable_rollout(), is_success);
    }

    fn acknowledge_all(&self) {
        (0..self.links.len()).for_each(|k| self.acknowledge(k));
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// For an episode, or a moment.
    fn wait(&self) {
        let cells: Vec<_> = self.links.iter().filter_map(|link| link.ports.as_ref()).collect();
        // A failed wait must not turn the loop into a spin.
        if cells.is_empty() || !wait_for_episode(&cells, WAIT) {
            std::thread::sleep(WAIT);
        }
    }

    /// Has something stored, again and again while the disk refuses it; `None` when stopped. Nothing
    /// is lost meanwhile: what was not stored was not learnt, published or acknowledged.
    fn stored<T>(
        &mut self,
        mut store: impl FnMut(&mut Learner) -> Result<T, LearnerError>,
    ) -> Result<Option<T>, SessionError> {
        let mut refused: Option<Instant> = None;
        loop {
            if refused.is_none_or(|at| at.elapsed() >= RETRY) {
                match store(self.learner) {
                    Err(LearnerError::Store(error)) if self.is_patient && error.may_pass() => {
                        if refused.is_none() {
                            (self.on_event)(Event::NotStored(error.to_string()));
                            self.waits = WAITS_DISK;
                        }
                        refused = Some(Instant::now());
                    }
                    result => {
                        self.waits = WAITS_NOT;
                        if refused.is_some() && result.is_ok() {
                            (self.on_event)(Event::Stored);
                        }
                        return Ok(Some(result?));
                    }
                }
            }
            if self.is_stopped() {
                return Ok(None);
            }
            self.look_around()?;
            std::thread::sleep(WAIT);
        }
    }
}
