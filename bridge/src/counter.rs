//! One remote cell at the hub: who speaks for it, and what waits for an answer.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use shm_types::SCHEMA;
use shm_types::command::{Command, Status};
use shm_types::telemetry::Heartbeat;
use zenoh::Wait;
use zenoh::handlers::{FifoChannelHandler, RingChannelHandler};
use zenoh::query::Query;
use zenoh::sample::{Sample, SampleKind};

use crate::answer::{VERDICT_NONE, VERDICT_PENDING};
use crate::desk::Desk;
use crate::event::Event;
use crate::live::Live;
use crate::net::monotonic_ns;
use crate::relay::Relay;
use crate::said::Said;
use crate::turn::{Episode, Seen, Turn, TurnHead, refusal};

/// A cell that says nothing for so long is gone: another bridge may speak for it.
const GONE: Duration = Duration::from_secs(3);
const BEAT: Duration = Duration::from_millis(100);
const HOUSEKEEPING: Duration = Duration::from_secs(1);
/// A turn without news is answered after this long, one with an episode after the other.
const NO_NEWS: Duration = Duration::from_millis(500);
const NOT_DURABLE: Duration = Duration::from_secs(8);
/// Between two attempts to give an episode to a learner that does not take it.
const AGAIN: Duration = Duration::from_millis(50);
/// What is seen of the loop and shown between two looks at the turns.
const LIVE_AT_ONCE: usize = 8;
/// Turns that may wait; of more, the oldest is answered.
const MAX_WAITING: usize = 8;

/// The bridge that speaks for the cell.
struct Owner {
    bridge: u64,
    host: String,
    heard: Instant,
    controller: Heartbeat,
    status: Status,
}

/// A turn that has no answer yet.
struct Waiting {
    query: Query,
    seen: Seen,
    /// The newest command that the cell has.
    commands: u64,
    until: Instant,
    episode: Option<Episode>,
    next_try: Instant,
}

/// What comes over the network for the cell.
pub(crate) struct Incoming<'a> {
    pub queries: &'a FifoChannelHandler<Query>,
    pub tokens: &'a FifoChannelHandler<Sample>,
    pub live: &'a RingChannelHandler<Sample>,
}

pub(crate) struct Counter<'a> {
    desk: Desk,
    relay: Relay,
    world: String,
    owner: Option<Owner>,
    waiting: Vec<Waiting>,
    said: Said,
    on_event: &'a (dyn Fn(Event) + Sync),
}

impl<'a> Counter<'a> {
    pub fn new(desk: Desk, world: String, on_event: &'a (dyn Fn(Event) + Sync)) -> Counter<'a> {
        let (relay, waiting) = (Relay::new(desk.cell()), Vec::new());
        Counter { desk, relay, world, owner: None, waiting, said: Said::default(), on_event }
    }

    /// Serves the cell until `stop`.
    pub fn run(mut self, incoming: &Incoming, stop: &AtomicBool) {
        let (mut next_beat, mut next_housekeeping) = (Instant::now(), Instant::now());
        while !stop.load(Ordering::Relaxed) {
            match incoming.queries.recv_timeout(self.patience()) {
                Ok(Some(query)) => self.take(query),
                Ok(None) => {}
                Err(_) => std::thread::sleep(AGAIN), // the session has ended; so will this
            }
            while let Ok(Some(token)) = incoming.tokens.try_recv() {
                self.look_at(&token);
            }
            let status = self.owner.as_ref().map(|owner| owner.status);
            self.desk.listen(status, &mut self.relay);
            self.answer();
            // Last, and not for long: what comes too fast is dropped.
            let samples = std::iter::from_fn(|| incoming.live.try_recv().ok().flatten());
            samples.take(LIVE_AT_ONCE).for_each(|sample| self.show(&sample));
            let now = Instant::now();
            if now >= next_beat {
                next_beat = now + BEAT;
                self.beat();
            }
            if now >= next_housekeeping {
                next_housekeeping = now + HOUSEKEEPING;
                self.desk.clean_up();
                self.relay.expire().into_iter().for_each(self.on_event);
            }
        }
        self.relay.cut().into_iter().for_each(self.on_event);
    }

    /// How long to wait for a turn: acknowledgements and policies come without a call.
    fn patience(&self) -> Duration {
        match &self.waiting[..] {
            [] => Duration::from_millis(20),
            waiting if waiting.iter().any(|turn| turn.episode.is_some()) => {
                Duration::from_micros(200)
            }
            _ => Duration::from_millis(1),
        }
    }

    fn take(&mut self, query: Query) {
        let bytes = query.payload().map(|payload| payload.to_bytes()).unwrap_or_default();
        let turn = match Turn::decode(&bytes) {
            Ok(turn) => turn,
            Err(error) => return self.refuse(&query, error.to_string()),
        };
        drop(bytes);
        if let Err(reason) = self.admit(&turn.head) {
            return self.refuse(&query, reason);
        }
        if turn.head.controller.schema == SCHEMA
            && let Err(error) = self.desk.start()
        {
            return self.refuse(&query, format!("the learner's machine: {error}"));
        }
        let (seen, episode) = (turn.head.seen, turn.episode);
        if let Some(sent) = turn.reply {
            let event = self.relay.replied(&sent, monotonic_ns());
            (self.on_event)(event);
            return self.reply(&query, VERDICT_NONE, seen, None);
        }
        let commands = if seen.hub == self.desk.seen().hub { turn.head.commands } else { 0 };
        self.relay.taken(commands);
        if self.waiting.len() >= MAX_WAITING {
            let oldest = self.waiting.remove(0);
            self.reply(&oldest.query, self.verdict_of_none(&oldest), oldest.seen, None);
        }
        let now = Instant::now();
        let patience = if episode.is_some() { NOT_DURABLE } else { NO_NEWS };
        let (until, next_try) = (now + patience, now);
        self.waiting.push(Waiting { query, seen, commands, until, episode, next_try });
    }

    /// Shows observers what the cell sends of its loop. What is not right is not shown, and said.
    fn show(&mut self, sample: &Sample) {
        match Live::decode(&sample.payload().to_bytes()) {
            Ok((head, live)) => {
                // Of another bridge than the one that has joined, nothing.
                let owner = self.owner.as_ref().filter(|owner| owner.bridge == head.bridge);
                if let Some(owner) = owner {
                    self.desk.show(&head, &live, &owner.host);
                }
            }
            Err(error) => {
                let (cell, reason) = (self.desk.cell().to_string(), error.to_string());
                self.once(Event::Refused { cell, reason: format!("live telemetry: {reason}") });
            }
        }
    }

    /// Lets a bridge speak for the cell, or says why not.
    fn admit(&mut self, head: &TurnHead) -> Result<(), String> {
        let (cell, said) = (self.desk.cell(), head.cell_name());
        if said != cell {
            return Err(format!(
                "the certificate is that of cell '{cell}', but it joins as '{said}'"
            ));
        }
        let world = head.world_name();
        if !world.is_empty() && !self.world.is_empty() && world != self.world {
            return Err(format!(
                "cell '{cell}' has {world}, but the learner has {}: give both machines the same configuration",
                self.world
            ));
        }
        let controller = head.controller;
        let now = Instant::now();
        match &mut self.owner {
            Some(owner) if owner.bridge == head.bridge => {
                (owner.heard, owner.controller, owner.status) = (now, controller, head.status);
                return Ok(());
            }
            Some(owner) if owner.heard.elapsed() < GONE => {
                return Err(format!(
                    "cell '{cell}' is joined from {} already: give this one another name, or stop the other bridge",
                    owner.host
                ));
            }
            _ => {}
        }
        let host = head.host_name();
        (self.on_event)(Event::Joined { cell: cell.to_string(), host: host.clone() });
        self.relay.cut().into_iter().for_each(self.on_event);
        self.relay.joined(&host);
        // What another one has asked is nobody's any more.
        self.waiting.clear();
        self.owner =
            Some(Owner { bridge: head.bridge, host, heard: now, controller, status: head.status });
        Ok(())
    }

    /// A bridge that dies or is cut off takes its token with it.
    fn look_at(&mut self, token: &Sample) {
        if token.kind() != SampleKind::Delete {
            return;
        }
        let key = token.key_expr().as_str();
        let is_it = |owner: &mut Owner| key.ends_with(&format!("{:016x}", owner.bridge));
        if let Some(owner) = self.owner.take_if(is_it) {
            self.left(owner, "is gone");
        }
    }

    fn left(&mut self, owner: Owner, why: &'static str) {
        self.waiting.clear();
        self.relay.cut().into_iter().for_each(self.on_event);
        let (cell, host) = (self.desk.cell().to_string(), owner.host);
        (self.on_event)(Event::Left { cell, host, why });
    }

    /// Beats for a controller that is heard. One that is not must be missed by its learner.
    fn beat(&mut self) {
        if let Some(owner) = self.owner.take_if(|owner| owner.heard.elapsed() >= GONE) {
            self.left(owner, "is silent");
        }
        if let Some(owner) = &self.owner
            && owner.controller.schema == SCHEMA
        {
            self.desk.beat(&owner.controller);
        }
    }

    /// Answers what can be answered.
    fn answer(&mut self) {
        let now = Instant::now();
        for turn in std::mem::take(&mut self.waiting) {
            let is_over = now >= turn.until;
            match &turn.episode {
                Some(episode) => match self.settle(episode, now >= turn.next_try) {
                    VERDICT_PENDING if !is_over => {
                        let next_try =
                            if now >= turn.next_try { now + AGAIN } else { turn.next_try };
                        self.waiting.push(Waiting { next_try, ..turn });
                    }
                    verdict => self.reply(&turn.query, verdict, turn.seen, None),
                },
                None => {
                    let command = self.relay.next(turn.commands);
                    if command.is_some() || is_over || turn.seen != self.desk.seen() {
                        self.reply(&turn.query, VERDICT_NONE, turn.seen, command);
                        if let Some(number) = command.map(|(number, _)| number) {
                            self.relay.sent(number);
                        }
                    } else {
                        self.waiting.push(turn);
                    }
                }
            }
        }
    }

    /// What has become of an episode, which is given to the learner if it has not got it.
    fn settle(&mut self, episode: &Episode, may_try: bool) -> u64 {
        let verdict = self.desk.verdict(episode);
        // Before the learner has said a word it may be that of another session.
        if verdict != VERDICT_PENDING || !may_try || self.desk.session() == 0 {
            return verdict;
        }
        let cell = self.desk.cell().to_string();
        match self.desk.hand_in(episode) {
            Ok(true) => {
                let (session, rollout) = (episode.header.session, episode.header.rollout);
                self.once(Event::HandedIn { cell, session, rollout });
            }
            Ok(false) => {}
            Err(error) => {
                self.once(Event::Trouble { cell, reason: error.to_string() });
            }
        }
        verdict
    }

    fn verdict_of_none(&self, turn: &Waiting) -> u64 {
        if turn.episode.is_some() { VERDICT_PENDING } else { VERDICT_NONE }
    }

    fn reply(&self, query: &Query, verdict: u64, seen: Seen, command: Option<(u64, &Command)>) {
        let bytes = self.desk.answer(verdict, seen, command);
        // A cell that is cut off asks again.
        let _ = query.reply(query.key_expr().clone(), bytes).wait();
    }

    fn refuse(&mut self, query: &Query, reason: String) {
        let _ = query.reply_err(refusal(&reason)).wait();
        self.once(Event::Refused { cell: self.desk.cell().to_string(), reason });
    }

    /// Says something, unless it was said just now.
    fn once(&mut self, event: Event) {
        if self.said.is_news(&event) {
            (self.on_event)(event);
        }
    }
}
