//! This learner's side of one cell: showing it that the learner lives, seeing how its controller does, and the
//! rollout it was asked to execute.

use std::time::{Duration, Instant};

use shm_types::SCHEMA;
use shm_types::cell::Cell;
use shm_types::channel::ChannelError;
use shm_types::episode::Ack;
use shm_types::policy::PolicyMsg;
use shm_types::ports::LearnerPorts;
use shm_types::telemetry::Heartbeat;

use super::{Event, ROLLOUT, SessionError};
use crate::store::TrialRecord;

const BEAT: Duration = Duration::from_millis(100);
const HOUSEKEEPING: Duration = Duration::from_secs(1);
/// A controller whose heartbeat is older than this is silent.
const SILENT: Duration = Duration::from_secs(2);
/// Between two looks for the controller of a cell where none has been so far, and how long a look may take.
const JOIN: Duration = Duration::from_millis(50);
const LOOK: Duration = Duration::from_millis(1);
/// How long a controller may be looked for before that is said, and said again.
const PATIENCE: Duration = Duration::from_secs(10);

/// What a cell was asked to execute.
pub(super) struct Asked {
    pub policy: PolicyMsg,
    pub since: Instant,
    /// Unusable episodes of it so far.
    pub attempts: u32,
}

/// What was seen of a cell in one look.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Seen {
    Nothing,
    /// Its controller is a new one: nothing that was sent to the one before has arrived.
    NewController,
}

pub(super) struct Link {
    /// As the session calls it.
    name: String,
    cell: Cell,
    /// Absent until the cell has had a controller.
    pub ports: Option<LearnerPorts>,
    next_beat: Instant,
    next_housekeeping: Instant,
    next_join: Instant,
    next_complaint: Instant,
    beat_counter: u64,
    controller: Option<Heartbeat>,
    heard: Instant,
    is_silent: bool,
    is_pinned: bool,
    /// Fault after which the arm is held, or 0.
    latched: u64,
    pub asked: Option<Asked>,
    /// It let a rollout lie: others are asked first until then.
    pub rests_until: Option<Instant>,
    /// It was found unable to execute rollouts, and is asked again when its controller is a new one.
    pub is_retired: bool,
    pub set_aside_in_a_row: u32,
    /// The newest rollout it executed that is durable, or 0.
    pub newest: u64,
}

impl Link {
    /// To `cell`, for a session that calls it `name` and has these trials.
    pub fn new(name: String, cell: Cell, trials: &[TrialRecord]) -> Link {
        let now = Instant::now();
        let newest = trials.iter().rev().find(|trial| trial.cell == name);
        let newest = newest.map_or(0, |trial| trial.rollout);
        Link {
            name,
            cell,
            ports: None,
            next_beat: now,
            next_housekeeping: now + HOUSEKEEPING,
            next_join: now,
            next_complaint: now + PATIENCE,
            beat_counter: 0,
            controller: None,
            heard: now,
            is_silent: false,
            is_pinned: false,
            latched: 0,
            asked: None,
            rests_until: None,
            is_retired: false,
            set_aside_in_a_row: 0,
            newest,
        }
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// It executes what it is asked to as soon as it can, by all that is heard of it.
    pub fn is_able(&self) -> bool {
        self.ports.is_some() && !self.is_silent && !self.is_pinned && self.latched == 0
    }

    /// Its controller has been heard at some time.
    pub fn is_heard(&self) -> bool {
        self.controller.is_some()
    }

    pub fn is_silent(&self) -> bool {
        self.is_silent
    }

    /// It was asked to execute this rollout.
    pub fn has(&self, rollout: u64) -> bool {
        self.asked.as_ref().is_some_and(|asked| asked.policy.rollout == rollout)
    }

    /// Asks the cell to execute `policy`.
    pub fn ask(&mut self, policy: PolicyMsg) -> Result<(), SessionError> {
        self.asked = Some(Asked { policy, since: Instant::now(), attempts: 0 });
        self.rests_until = None;
        self.publish(&policy)
    }

    /// Asks it once more for what it was asked.
    pub fn ask_again(&mut self) -> Result<(), SessionError> {
        let Some(asked) = &mut self.asked else { return Ok(()) };
        asked.since = Instant::now();
        let policy = asked.policy;
        self.publish(&policy)
    }

    /// Leaves the rollout to others; it is asked for another one when it has rested.
    pub fn rest(&mut self) {
        self.asked = None;
        self.rests_until = Some(Instant::now() + ROLLOUT);
    }

    fn publish(&self, policy: &PolicyMsg) -> Result<(), SessionError> {
        let Some(ports) = &self.ports else { return Ok(()) };
        ports.policies.send_copy(*policy).map(|_receivers| ()).map_err(|error| {
            SessionError::Publish { rollout: policy.rollout, reason: format!("{error:?}") }
        })
    }

    /// Tells the controller what is durable. A later one says all that an earlier one did, so a lost one does
    /// no harm.
    pub fn acknowledge(&self, session: u64, durable_rollout: u64, is_success: bool) {
        let Some(ports) = &self.ports else { return };
        let (rollout, success) = (self.newest, u64::from(is_success));
        let ack = Ack { schema: SCHEMA, session, durable_rollout, rollout, success };
        if let Err(error) = ports.acks.send_copy(ack) {
            tracing::warn!("acknowledgement of rollout {durable_rollout} not sent: {error:?}");
        }
    }

    /// Beats, listens to the controller's beat, cleans up; joins the cell when it gets a controller.
    pub fn look(
        &mut self,
        waits: u64,
        on_event: &mut dyn FnMut(Event<'_>),
    ) -> Result<Seen, SessionError> {
        let now = Instant::now();
        if self.ports.is_none() {
            return self.join(now, on_event);
        }
        let mut restarted = false;
        if now >= self.next_beat {
            self.next_beat = now + BEAT;
            if let Some(ports) = &mut self.ports {
                restarted = ports.follow()?;
            }
            if restarted {
                self.controller = None; // its beat is to come
            }
            self.beat(waits, false);
        }
        if now >= self.next_housekeeping {
            self.next_housekeeping = now + HOUSEKEEPING;
            self.ports.iter().for_each(LearnerPorts::clean_up);
        }
        let before = (self.is_pinned, self.latched);
        restarted |= self.hear(now);
        self.tell_changes(before, now, on_event);
        if restarted {
            self.is_retired = false;
            self.rests_until = None;
        }
        Ok(if restarted { Seen::NewController } else { Seen::Nothing })
    }

    fn join(
        &mut self,
        now: Instant,
        on_event: &mut dyn FnMut(Event<'_>),
    ) -> Result<Seen, SessionError> {
        if now < self.next_join {
            return Ok(Seen::Nothing);
        }
        self.next_join = now + JOIN;
        match LearnerPorts::open(&self.cell, LOOK, &|| false) {
            Ok(ports) => {
                (self.ports, self.heard) = (Some(ports), Instant::now());
                on_event(Event::Joined { cell: &self.name });
                Ok(Seen::NewController)
            }
            Err(ChannelError::NoController { .. }) => {
                if now >= self.next_complaint {
                    self.next_complaint = now + PATIENCE;
                    on_event(Event::NoController { cell: &self.name });
                }
                Ok(Seen::Nothing)
            }
            Err(error) => Err(error.into()),
        }
    }

    fn tell_changes(
        &mut self,
        (was_pinned, was_latched): (bool, u64),
        now: Instant,
        on_event: &mut dyn FnMut(Event<'_>),
    ) {
        let cell = &self.name;
        if self.is_pinned != was_pinned {
            on_event(Event::Pinned { cell, is_pinned: self.is_pinned });
        }
        if self.latched != was_latched {
            on_event(Event::Held { cell, fault: self.latched });
        }
        let silence = now.saturating_duration_since(self.heard);
        if silence >= SILENT && !self.is_silent {
            self.is_silent = true;
            on_event(Event::ControllerSilent { cell, silence });
        } else if silence < SILENT && self.is_silent {
            self.is_silent = false;
            on_event(Event::ControllerBack { cell });
        }
    }

    /// Shows the controller that the learner lives, or that it ends cleanly and nobody need miss it.
    pub fn beat(&mut self, waits: u64, is_leaving: bool) {
        self.beat_counter += 1;
        let Some(ports) = &self.ports else { return };
        let beat = Heartbeat {
            schema: SCHEMA,
            boot_id: u64::from(std::process::id()),
            counter: self.beat_counter,
            leaving: u64::from(is_leaving),
            waits,
            ..Heartbeat::NONE
        };
        // Nobody listening is what the controller's own silence will tell.
        let _ = ports.beat.send_copy(beat);
    }

    fn hear(&mut self, now: Instant) -> bool {
        let Some(ports) = &self.ports else { return false };
        let mut restarted = false;
        while let Ok(Some(beat)) = ports.controller_beat.receive() {
            if beat.schema != SCHEMA || self.controller == Some(*beat) {
                continue;
            }
            restarted |= self.controller.is_some_and(|last| last.boot_id != beat.boot_id);
            self.controller = Some(*beat);
            (self.is_pinned, self.latched) = (beat.pinned == 1, beat.latched);
            self.heard = now;
        }
        restarted
    }
}
