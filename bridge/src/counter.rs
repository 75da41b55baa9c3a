//! One remote cell at the hub: who speaks for it, and what waits for an answer.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use shm_types::SCHEMA;
use shm_types::command::Status;
use shm_types::telemetry::Heartbeat;
use zenoh::Wait;
use zenoh::handlers::FifoChannelHandler;
use zenoh::query::Query;
use zenoh::sample::{Sample, SampleKind};

use crate::answer::{VERDICT_NONE, VERDICT_PENDING};
use crate::desk::Desk;
use crate::event::Event;
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
    until: Instant,
    episode: Option<Episode>,
    next_try: Instant,
}

pub(crate) struct Counter<'a> {
    desk: Desk,
    world: String,
    owner: Option<Owner>,
    waiting: Vec<Waiting>,
    said: Said,
    on_event: &'a (dyn Fn(Event) + Sync),
}

impl<'a> Counter<'a> {
    pub fn new(desk: Desk, world: String, on_event: &'a (dyn Fn(Event) + Sync)) -> Counter<'a> {
        Counter { desk, world, owner: None, waiting: Vec::new(), said: Said::default(), on_event }
    }

    /// Serves the cell until `stop`.
    pub fn run(
        mut self,
        queries: &FifoChannelHandler<Query>,
        tokens: &FifoChannelHandler<Sample>,
        stop: &AtomicBool,
    ) {
        let (mut next_beat, mut next_housekeeping) = (Instant::now(), Instant::now());
        while !stop.load(Ordering::Relaxed) {
            match queries.recv_timeout(self.patience()) {
                Ok(Some(query)) => self.take(query),
                Ok(None) => {}
                Err(_) => std::thread::sleep(AGAIN), // the session has ended; so will this
            }
            while let Ok(Some(token)) = tokens.try_recv() {
                self.look_at(&token);
            }
            let owner = self.owner.as_ref();
            self.desk.listen(owner.map(|owner| (&*owner.host, owner.status)));
            self.answer();
            let now = Instant::now();
            if now >= next_beat {
                next_beat = now + BEAT;
                self.beat();
            }
            if now >= next_housekeeping {
                next_housekeeping = now + HOUSEKEEPING;
                self.desk.clean_up();
            }
        }
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
        if self.waiting.len() >= MAX_WAITING {
            let oldest = self.waiting.remove(0);
            self.reply(&oldest.query, self.verdict_of_none(&oldest), oldest.seen);
        }
        let now = Instant::now();
        let patience = if turn.episode.is_some() { NOT_DURABLE } else { NO_NEWS };
        let (seen, episode) = (turn.head.seen, turn.episode);
        self.waiting.push(Waiting { query, seen, until: now + patience, episode, next_try: now });
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
                    verdict => self.reply(&turn.query, verdict, turn.seen),
                },
                None if is_over || turn.seen != self.desk.seen() => {
                    self.reply(&turn.query, VERDICT_NONE, turn.seen);
                }
                None => self.waiting.push(turn),
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

    fn reply(&self, query: &Query, verdict: u64, seen: Seen) {
        let bytes = self.desk.answer(verdict, seen);
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
