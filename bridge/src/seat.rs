//! The learner's place in the cell, taken by the bridge for a learner that is elsewhere.

use std::time::{Duration, Instant};

use shm_types::SCHEMA;
use shm_types::cell::{Cell, CellLock, Role};
use shm_types::channel::ChannelError;
use shm_types::command::Status;
use shm_types::episode::Ack;
use shm_types::policy::PolicyMsg;
use shm_types::ports::{LearnerPorts, ToolPorts};
use shm_types::telemetry::Heartbeat;

use crate::acks::Acks;
use crate::turn::Episode;

/// Age of a heartbeat after which a controller is not told of any more.
const SILENT: Duration = Duration::from_secs(1);
/// Between two looks for a controller, and how long one may take.
const JOIN: Duration = Duration::from_millis(50);
const LOOK: Duration = Duration::from_millis(1);

/// How long a controller may take to say how it is.
const ANSWER: Duration = Duration::from_millis(20);

pub(crate) struct Seat {
    cell: Cell,
    /// Absent until the cell has had a controller.
    ports: Option<LearnerPorts>,
    next_join: Instant,
    controller: Heartbeat,
    heard: Option<Instant>,
    /// The newest of the learner, for a controller that restarts.
    policy: Option<Box<PolicyMsg>>,
    acks: Acks,
    beats: u64,
    /// What the controller says of itself, and how it is asked.
    status: Status,
    tool: Option<ToolPorts>,
    _lock: CellLock,
}

impl Seat {
    pub fn open(cell: &Cell) -> Result<Seat, shm_types::cell::CellError> {
        let lock = cell.lock(Role::Learner)?;
        Ok(Seat {
            cell: cell.clone(),
            ports: None,
            next_join: Instant::now(),
            controller: Heartbeat::NONE,
            heard: None,
            policy: None,
            acks: Acks::NONE,
            beats: 0,
            status: Status::ZERO,
            tool: None,
            _lock: lock,
        })
    }

    /// Follows the controller into its services; true when it is another one.
    pub fn follow(&mut self) -> Result<bool, ChannelError> {
        let is_new = match &mut self.ports {
            Some(ports) => ports.follow()?,
            None if Instant::now() < self.next_join => false,
            None => {
                self.next_join = Instant::now() + JOIN;
                match LearnerPorts::open(&self.cell, LOOK, &|| false) {
                    Ok(ports) => self.ports = Some(ports),
                    Err(ChannelError::NoController { .. }) => return Ok(false),
                    Err(error) => return Err(error),
                }
                true
            }
        };
        if is_new {
            self.controller = Heartbeat::NONE; // its beat is to come
            self.publish_all();
        }
        Ok(is_new)
    }

    /// Hears the controller.
    pub fn listen(&mut self) {
        let Some(ports) = &self.ports else { return };
        while let Ok(Some(beat)) = ports.controller_beat.receive() {
            if beat.is_valid() && *beat != self.controller {
                (self.controller, self.heard) = (*beat, Some(Instant::now()));
            }
        }
    }

    /// The newest of a controller that is heard, else one that says nothing.
    pub fn controller(&self) -> Heartbeat {
        match self.heard {
            Some(heard) if heard.elapsed() < SILENT => self.controller,
            _ => Heartbeat::NONE,
        }
    }

    /// Asks the controller how it is, for tools on the learner's machine.
    pub fn ask_status(&mut self) {
        if self.controller().schema != SCHEMA {
            (self.status, self.tool) = (Status::ZERO, None);
            return;
        }
        self.tool = self.tool.take().or_else(|| ToolPorts::open(&self.cell, LOOK).ok());
        let status = self.tool.as_ref().and_then(|tool| tool.status(ANSWER));
        self.status = status.unwrap_or(Status::ZERO);
    }

    pub fn status(&self) -> Status {
        self.status
    }

    /// An episode, if one has come. What is not fit to be sent is ignored.
    pub fn episode(&self) -> Option<Episode> {
        let sample = self.ports.as_ref()?.episodes.receive().ok()??;
        let header = *sample.user_header();
        match header.validate(sample.payload()) {
            Ok(records) => Some(Episode { header, records: records.to_vec() }),
            Err(error) => {
                tracing::warn!("episode ignored: {error}");
                None
            }
        }
    }

    /// Says what is new in it, that of the learner's session last. A hub that was restarted knows less: what is
    /// durable stays so.
    pub fn acknowledge(&mut self, acks: &Acks) {
        let had = self.acks;
        for ack in acks.iter() {
            self.acks.take(ack);
        }
        if self.acks != had {
            let is_news = |ack: &Ack| had.iter().all(|one| one != *ack);
            let newest = acks.newest();
            for ack in acks.iter().filter(|ack| is_news(ack) || newest == Some(*ack)) {
                self.publish(|ports| ports.acks.send_copy(ack).map(drop));
            }
        }
    }

    pub fn ask(&mut self, policy: Box<PolicyMsg>) {
        let message = *policy;
        self.policy = Some(policy);
        self.publish(|ports| ports.policies.send_copy(message).map(drop));
    }

    /// Says everything to a controller that has just come.
    fn publish_all(&mut self) {
        for ack in self.acks.iter() {
            self.publish(|ports| ports.acks.send_copy(ack).map(drop));
        }
        self.policy.take_if(|asked| self.acks.covers(asked.session, asked.rollout));
        if let Some(policy) = self.policy.as_deref().copied() {
            self.publish(|ports| ports.policies.send_copy(policy).map(drop));
        }
    }

    fn publish<E: std::fmt::Debug>(&self, send: impl Fn(&LearnerPorts) -> Result<(), E>) {
        if let Some(ports) = &self.ports
            && let Err(error) = send(ports)
        {
            tracing::warn!("not sent to the controller: {error:?}; the learner will ask again");
        }
    }

    /// Beats as the learner that is elsewhere does.
    pub fn beat(&mut self, learner: &Heartbeat) {
        self.beats += 1;
        let Some(ports) = &self.ports else { return };
        let _ = ports.beat.send_copy(Heartbeat { counter: self.beats, ..*learner });
    }

    pub fn clean_up(&self) {
        self.ports.iter().for_each(LearnerPorts::clean_up);
    }
}
