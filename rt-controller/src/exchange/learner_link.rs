//! The controller's view of its learner: the pending proposal, the heartbeat and the
//! acknowledgements.

use std::time::{Duration, Instant};

use shm_types::SCHEMA;
use shm_types::episode::Ack;
use shm_types::policy::{PolicyMsg, PolicyName};
use shm_types::ports::ControllerPorts;
use shm_types::telemetry::{Heartbeat, WAITS_NOT};

pub(crate) struct LearnerLink {
    started: Instant,
    seen: Option<(Heartbeat, Instant)>,
    /// Since when a learner has been in the cell without a heartbeat.
    mute: Option<Instant>,
    /// Newest session and rollout reported, and what the learner has acknowledged.
    reported: PolicyName,
    acknowledged: Ack,
    /// What came since the last look; a bridge that was cut off has some of several sessions.
    news: Vec<Ack>,
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
            acknowledged: Ack::NONE,
            news: Vec::new(),
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
                self.acknowledged = *ack;
                self.news.push(*ack);
            }
        }
        // Asked for by a learner that has taken its episode since.
        let is_durable = |asked: &mut PolicyMsg| {
            let mut acks = self.news.iter().chain([&self.acknowledged]);
            acks.any(|ack| ack.covers(asked.session, asked.rollout))
        };
        self.proposal.take_if(is_durable);
        while let Ok(Some(beat)) = ports.learner_beat.receive() {
            if beat.is_valid() && self.seen.is_none_or(|(last, _)| last != *beat) {
                self.seen = Some((*beat, Instant::now()));
                self.mute = None;
            }
        }
    }

    /// An episode was sent.
    pub fn reported(&mut self, name: PolicyName) {
        self.reported = name;
    }

    /// What was acknowledged, once; the newest last.
    pub fn news(&mut self) -> Vec<Ack> {
        std::mem::take(&mut self.news)
    }

    /// Episodes sent whose durability is not confirmed.
    pub fn unacknowledged(&self) -> u64 {
        let (session, newest) = (self.reported.session, self.reported.rollout);
        if self.acknowledged.covers(session, newest) {
            return 0;
        }
        let Ack { durable_rollout, rollout, .. } = self.acknowledged;
        let is_its = self.acknowledged.session == session;
        newest.saturating_sub(if is_its { durable_rollout.max(rollout.min(newest)) } else { 0 })
    }

    /// Age of the last heartbeat of a learner that did not sign off.
    pub fn age(&self) -> Option<Duration> {
        self.seen.filter(|(beat, _)| beat.leaving == 0).map(|(_, seen)| seen.elapsed())
    }

    /// Tracks a learner that has joined the cell but sends no heartbeat: it is starting, ending or
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
