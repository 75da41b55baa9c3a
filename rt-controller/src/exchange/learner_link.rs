//! What the controller knows of its learner: the proposal it waits for, its heartbeat, its
//! acknowledgements.

use std::time::{Duration, Instant};

use shm_types::SCHEMA;
use shm_types::policy::{PolicyMsg, PolicyName};
use shm_types::ports::ControllerPorts;
use shm_types::telemetry::{Heartbeat, WAITS_NOT};

pub(crate) struct LearnerLink {
    started: Instant,
    seen: Option<(Heartbeat, Instant)>,
    /// A learner is in the cell since then, and was not heard.
    mute: Option<Instant>,
    /// Newest session and rollout reported, and up to which the learner holds its own durable.
    reported: PolicyName,
    durable: (u64, u64),
    /// It has changed since somebody looked.
    has_news: bool,
    /// Received, not yet handed to the loop.
    pub proposal: Option<PolicyMsg>,
}

impl LearnerLink {
    pub fn new() -> LearnerLink {
        LearnerLink {
            started: Instant::now(),
            seen: None,
            mute: None,
            reported: PolicyName::NONE,
            durable: (0, 0),
            has_news: false,
            proposal: None,
        }
    }

    /// Keeps the newest proposal. One that is in flight already is not started twice; one that has
    /// ended is run again, because only a learner that missed its episode asks again.
    pub fn receive(&mut self, ports: &ControllerPorts, in_flight: Option<PolicyName>) {
        while let Ok(Some(sample)) = ports.policies.receive() {
            let message = *sample;
            if in_flight != Some(message.name()) {
                self.proposal = Some(message);
            }
        }
        while let Ok(Some(ack)) = ports.acks.receive() {
            if ack.schema == SCHEMA {
                self.durable = (ack.session, ack.durable_rollout);
                self.has_news = true;
            }
        }
        // Asked for by a learner that has taken its episode since.
        let (session, durable) = self.durable;
        self.proposal.take_if(|asked| asked.session == session && asked.rollout <= durable);
        while let Ok(Some(beat)) = ports.learner_beat.receive() {
            if beat.schema == SCHEMA && self.seen.is_none_or(|(last, _)| last != *beat) {
                self.seen = Some((*beat, Instant::now()));
                self.mute = None;
            }
        }
    }

    /// An episode was sent.
    pub fn reported(&mut self, name: PolicyName) {
        self.reported = name;
    }

    /// Session and rollout up to which it is durable, once after each acknowledgement.
    pub fn news(&mut self) -> Option<(u64, u64)> {
        std::mem::take(&mut self.has_news).then_some(self.durable)
    }

    /// Episodes sent whose durability is not confirmed.
    pub fn unacknowledged(&self) -> u64 {
        let (session, durable) = self.durable;
        let confirmed = if session == self.reported.session { durable } else { 0 };
        self.reported.rollout.saturating_sub(confirmed)
    }

    /// Age of the last heartbeat of a learner that did not take its leave.
    pub fn age(&self) -> Option<Duration> {
        self.seen.filter(|(beat, _)| beat.leaving == 0).map(|(_, seen)| seen.elapsed())
    }

    /// Looks after a learner that holds its place in the cell and says nothing: it starts, ends, or is
    /// stuck.
    pub fn look(&mut self, ports: &ControllerPorts) {
        match ports.has_learner() && self.age().is_none() {
            true => drop(self.mute.get_or_insert_with(Instant::now)),
            false => self.mute = None,
        }
    }

    /// For how long a learner has been there that was not heard.
    pub fn mute(&self) -> Option<Duration> {
        self.mute.map(|since| since.elapsed())
    }

    /// What the learner waits for, by its own word.
    pub fn waits(&self) -> u64 {
        let heard = self.seen.filter(|(beat, _)| beat.leaving == 0);
        heard.map_or(WAITS_NOT, |(beat, _)| beat.waits)
    }

    /// No learner was heard for `after`.
    pub fn is_absent(&self, after: Duration) -> bool {
        self.seen.map_or(self.started, |(_, seen)| seen).elapsed() >= after
    }
}
