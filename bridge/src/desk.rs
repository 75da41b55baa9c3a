//! The controller's place in a local cell, taken by the hub for a controller that is elsewhere.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use shm_types::cell::{Cell, CellLock, Role};
use shm_types::channel::ChannelError;
use shm_types::command::{COMMAND_STATUS, Command, Reply, Status};
use shm_types::episode::EpisodeHeader;
use shm_types::policy::{PolicyMsg, PolicyName};
use shm_types::ports::ControllerPorts;
use shm_types::telemetry::{Heartbeat, Telemetry};
use shm_types::text;

use crate::acks::Acks;
use crate::answer::{
    AnswerHead, VERDICT_ASKED_AGAIN, VERDICT_DURABLE, VERDICT_FOREIGN, VERDICT_PENDING,
};
use crate::live::{Live, LiveHead};
use crate::relay::{NOT_CONNECTED, Relay};
use crate::turn::{Episode, Seen};

/// Age of a heartbeat after which a learner does not count as there.
const SILENT: Duration = Duration::from_secs(2);
/// Dead processes that the transport may fail to clear away, as in the controller.
const MAX_LEAKED: usize = 4;
/// Outcomes remembered, of which observers are told once.
const OUTCOMES: usize = 32;

/// An episode that the learner was given.
#[derive(Clone, Copy, PartialEq)]
struct HandedIn {
    name: PolicyName,
    boot_id: u64,
    /// Policies published until then.
    policies: u64,
}

pub(crate) struct Desk {
    cell: Cell,
    /// Absent until there is a controller to play.
    ports: Option<ControllerPorts>,
    learner: Heartbeat,
    learner_heard: Option<Instant>,
    asked: Option<Box<PolicyMsg>>,
    acks: Acks,
    /// What there is, counted.
    seen: Seen,
    handed_in: Option<HandedIn>,
    /// Start of the controller and first tick of each rollout that observers were told of.
    outcomes: VecDeque<(u64, u64)>,
    beats: u64,
    // Last, so that it is given back after the ports.
    _lock: CellLock,
}

impl Desk {
    /// Takes the controller's place in `cell`. `hub` names this start of the hub.
    pub fn open(cell: &Cell, hub: u64) -> Result<Desk, shm_types::cell::CellError> {
        let lock = cell.lock(Role::Controller)?;
        Ok(Desk {
            cell: cell.clone(),
            ports: None,
            learner: Heartbeat::NONE,
            learner_heard: None,
            asked: None,
            acks: Acks::NONE,
            seen: Seen { hub, policy: 0, ack: 0 },
            handed_in: None,
            outcomes: VecDeque::new(),
            beats: 0,
            _lock: lock,
        })
    }

    pub fn cell(&self) -> &str {
        self.cell.name()
    }

    pub fn seen(&self) -> Seen {
        self.seen
    }

    /// Makes the services of the cell, so that its learner comes.
    pub fn start(&mut self) -> Result<(), ChannelError> {
        if self.ports.is_none() {
            self.ports = Some(ControllerPorts::create(&self.cell)?);
        }
        Ok(())
    }

    /// Takes what the learner has published, and answers tools: with the controller's own word of itself, or with none
    /// while no bridge is connected. Commands are for the controller, and go into the `relay`.
    pub fn listen(&mut self, status: Option<Status>, relay: &mut Relay) {
        let Some(ports) = &self.ports else { return };
        while let Ok(Some(policy)) = ports.policies.receive() {
            match policy.validate() {
                Ok(()) => {
                    self.asked = Some(Box::new(*policy));
                    self.seen.policy += 1;
                }
                Err(error) => tracing::warn!("cell {}: policy ignored: {error}", self.cell.name()),
            }
        }
        while let Ok(Some(ack)) = ports.acks.receive() {
            self.seen.ack += u64::from(self.acks.take(*ack));
        }
        while let Ok(Some(beat)) = ports.learner_beat.receive() {
            if beat.is_valid() && *beat != self.learner {
                (self.learner, self.learner_heard) = (*beat, Some(Instant::now()));
            }
        }
        while let Ok(Some(request)) = ports.commands.receive() {
            match status {
                _ if request.kind != COMMAND_STATUS => relay.take(request, status.is_some()),
                None => relay.refuse(&request, NOT_CONNECTED),
                Some(status) if status.boot_id != 0 => {
                    let via = text::pack(relay.host());
                    let _ = request.send_copy(Reply { via, ..Reply::accepted(request.id, status) });
                }
                // Where there is no controller, silence is the right answer.
                Some(_) => {}
            }
        }
    }

    /// Beats as the controller that is elsewhere does.
    pub fn beat(&mut self, controller: &Heartbeat) {
        self.beats += 1;
        let Some(ports) = &self.ports else { return };
        let _ = ports.beat.send_copy(Heartbeat { counter: self.beats, ..*controller });
        ports.meet_newcomers();
    }

    /// Frees what dead processes held.
    pub fn clean_up(&mut self) {
        let Some(ports) = &self.ports else { return };
        if ports.clean_up() > MAX_LEAKED {
            match ports.renewed() {
                Ok(ports) => (self.ports, self.handed_in) = (Some(ports), None),
                Err(error) => tracing::error!("cell {}: {error}", self.cell.name()),
            }
        }
    }

    /// Gives an episode to the learner, unless it has it already; whether it has it now.
    pub fn hand_in(&mut self, episode: &Episode) -> Result<bool, ChannelError> {
        let (name, boot_id) = (episode.header.name(), episode.header.boot_id);
        let is_it = |had: &HandedIn| had.name == name && had.boot_id == boot_id;
        if self.handed_in.as_ref().is_some_and(is_it) {
            return Ok(true);
        }
        let Some(ports) = &self.ports else { return Ok(false) };
        let mut loan = ports.loan_episode(episode.records.len().max(1))?;
        *loan.user_header_mut() = episode.header;
        loan.payload_mut()[..episode.records.len()].copy_from_slice(&episode.records);
        // No learner took it, or it is full: the next attempt is the caller's.
        let is_taken = loan.send().is_ok_and(|receivers| receivers > 0);
        if is_taken {
            let _ = ports.episode_sent.notify();
            self.handed_in = Some(HandedIn { name, boot_id, policies: self.seen.policy });
            self.tell_outcome(&episode.header);
        }
        Ok(is_taken)
    }

    /// Tells observers of a rollout, of which they may hear on two ways, once.
    fn tell_outcome(&mut self, header: &EpisodeHeader) {
        let (Some(ports), rollout) = (&self.ports, (header.boot_id, header.applied_tick)) else {
            return;
        };
        if !self.outcomes.contains(&rollout) {
            self.outcomes.truncate(OUTCOMES - 1);
            self.outcomes.push_front(rollout);
            let _ = ports.outcomes.send_copy(*header);
        }
    }

    /// Somebody on this machine looks at the loop.
    pub fn is_watched(&self) -> bool {
        self.ports.as_ref().is_some_and(ControllerPorts::has_observers)
    }

    /// Shows observers what was seen of the loop on `host`, as what it is.
    pub fn show(&mut self, head: &LiveHead, live: &Live, host: &str) {
        let Some(ports) = &self.ports else { return };
        match live {
            Live::Tick(tick) => {
                let (via, via_hz) = (text::pack(host), head.hz);
                let mut sample = Telemetry { n_ticks: 1, via, via_hz, ..Telemetry::EMPTY };
                sample.ticks[0] = **tick;
                let _ = ports.telemetry.send_copy(sample);
            }
            Live::Policy(policy) => {
                let _ = ports.in_loop.send_copy(**policy);
            }
            Live::Outcome(header) => self.tell_outcome(header),
        }
    }

    /// What the learner has said to an episode, by `VERDICT_*`.
    pub fn verdict(&mut self, episode: &Episode) -> u64 {
        let (session, rollout) = (episode.header.session, episode.header.rollout);
        if self.acks.covers(session, rollout) {
            return VERDICT_DURABLE;
        }
        if self.session() != 0 && self.session() != session {
            return VERDICT_FOREIGN;
        }
        let policies = self.seen.policy;
        let asked_since =
            |had: &mut HandedIn| had.name == episode.header.name() && had.policies < policies;
        match self.handed_in.take_if(asked_since) {
            Some(_) => VERDICT_ASKED_AGAIN,
            None => VERDICT_PENDING,
        }
    }

    /// The learner's, or 0 while it has said nothing.
    pub fn session(&self) -> u64 {
        match &self.asked {
            Some(asked) => asked.session,
            None => self.acks.newest().map_or(0, |ack| ack.session),
        }
    }

    /// The answer for a cell that has `seen` so much, with a `command` and its number.
    pub fn answer(&self, verdict: u64, seen: Seen, command: Option<(u64, &Command)>) -> Vec<u8> {
        let is_there =
            self.learner.leaving == 0 && self.learner_heard.is_some_and(|at| at.elapsed() < SILENT);
        let head = AnswerHead {
            verdict,
            session: self.session(),
            learner_is_there: u64::from(is_there),
            learner: self.learner,
            acks: self.acks,
            seen: self.seen,
            watched: u64::from(self.is_watched()),
            has_policy: 0,
            command: 0,
        };
        let is_news = seen.hub != self.seen.hub || seen.policy != self.seen.policy;
        // What is durable need not be executed.
        let is_open =
            |asked: &&PolicyMsg| is_news && !self.acks.covers(asked.session, asked.rollout);
        head.encode(self.asked.as_deref().filter(is_open), command)
    }
}
