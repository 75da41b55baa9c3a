//! The bridge beside a cell: it takes the cell's turns at the hub, and plays the learner here.
//!
//! Two kinds of turns are under way at once: one that waits for news, again and again, and, while there is an episode,
//! one that carries it until the learner holds it durable. A turn that fails is repeated after a while that grows.
//!
//! Without an answer for `PATIENCE` the bridge stops beating, so that the controller serves its last good policy
//! alone (`controller.alone_after_s`). What it has executed stays in its spool.

mod commands;
mod reach;
mod telemetry;
mod turns;

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use shm_types::SCHEMA;
use shm_types::cell::Cell;
use shm_types::channel::ChannelError;
use shm_types::text;
use thiserror::Error;
use zenoh::{Session, Wait};

use crate::answer::{Answer, AnswerHead, VERDICT_ASKED_AGAIN, VERDICT_DURABLE, VERDICT_FOREIGN};
use crate::command::Accepts;
use crate::event::Event;
use crate::net::{self, DOOR, Keys, NetError, alive_key, live_key, monotonic_ns, turn_key};
use crate::seat::Seat;
use crate::turn::{Episode, Seen, TurnHead};
use commands::Commands;
use reach::Reach;
use telemetry::Telemetry;
use turns::{Kind, Listener, Turns, Word};

/// How long the controller is told of a learner that does not answer.
const PATIENCE: Duration = Duration::from_secs(2);
const BEAT: Duration = Duration::from_millis(100);
const HOUSEKEEPING: Duration = Duration::from_secs(1);
/// Between two looks at the cell while nothing comes over the network.
const LOOK: Duration = Duration::from_micros(500);
/// How long a turn may take; the hub answers earlier.
const TURN: Duration = Duration::from_secs(3);
const EPISODE_TURN: Duration = Duration::from_secs(12);
/// Failures after which the reason is asked for at the door.
const KNOCK_AFTER: u32 = 3;
/// Episodes that are held here, of those that the controller has sent.
const MAX_HELD: usize = 4;

/// Which cell joins where.
pub struct JoinConfig {
    pub cell: Cell,
    /// `HOST:PORT` of the hub.
    pub connect: String,
    /// Without keys the hub must be on this machine.
    pub keys: Option<Keys>,
    /// Which task on which arm, or empty.
    pub world: String,
    /// Which commands of the learner's machine are carried out.
    pub accepts: Accepts,
    /// Ticks a second that the learner's machine sees at most while it looks; 0: none.
    pub telemetry_hz: u64,
    /// Names this start of the bridge; drawn at random.
    pub id: u64,
}

/// Why a bridge ends.
#[derive(Debug, Error)]
pub enum JoinError {
    #[error(transparent)]
    Net(#[from] NetError),
    #[error(transparent)]
    Cell(#[from] shm_types::cell::CellError),
    #[error(transparent)]
    Channel(#[from] ChannelError),
}

/// Takes the turns of the cell until `stop`, over any cut of the network.
pub fn run(
    config: &JoinConfig,
    stop: &AtomicBool,
    on_event: &mut dyn FnMut(Event),
) -> Result<(), JoinError> {
    let owner = config.keys.as_ref().map(Keys::owner).transpose()?;
    let mut seat = Seat::open(&config.cell)?;
    let mut reach = Reach::new(config, on_event);
    let Some(session) = reach.session(&mut seat, stop)? else { return Ok(()) };
    // A certificate speaks for its own cell alone; the hub says so to one that was mixed up.
    let speaks_for = owner.clone().unwrap_or_else(|| config.cell.name().to_string());
    let token = session.liveliness().declare_token(alive_key(&speaks_for, config.id)).wait();
    let _token = token.map_err(|error| NetError::Transport {
        address: config.connect.clone(),
        reason: error.to_string(),
    })?;
    let (out, words) = channel();
    let (cell, live) = (&config.cell, live_key(&speaks_for));
    let mut join = Join {
        reach,
        seat,
        commands: Commands::new(cell, config.accepts),
        telemetry: Telemetry::start(&session, &live, cell, config.id, config.telemetry_hz),
        is_watched: false,
        session: &session,
        key: turn_key(&speaks_for),
        certificate: owner.unwrap_or_default(),
        out,
        seen: Seen::default(),
        learner: None,
        held: VecDeque::new(),
        news: Turns::new(config.id),
        episode: Turns::new(config.id ^ 1),
        door: Turns::new(config.id ^ 2),
        reply: Turns::new(config.id ^ 3),
    };
    join.run(&words, stop)?;
    drop(join);
    let _ = session.close().wait();
    Ok(())
}

struct Join<'a> {
    reach: Reach<'a>,
    seat: Seat,
    commands: Commands,
    telemetry: Telemetry,
    is_watched: bool,
    session: &'a Session,
    key: String,
    /// The name in it, or empty.
    certificate: String,
    out: Sender<(Kind, Word)>,
    seen: Seen,
    /// The newest answer, and when it came.
    learner: Option<(AnswerHead, Instant)>,
    /// Episodes that the learner does not hold yet, the oldest first. They are in the controller's spool, too.
    held: VecDeque<Episode>,
    news: Turns,
    episode: Turns,
    door: Turns,
    reply: Turns,
}

impl Join<'_> {
    fn run(&mut self, words: &Receiver<(Kind, Word)>, stop: &AtomicBool) -> Result<(), JoinError> {
        let (mut next_beat, mut next_housekeeping) = (Instant::now(), Instant::now());
        while !stop.load(Ordering::Relaxed) {
            if let Ok((kind, word)) = words.recv_timeout(LOOK) {
                self.hear(kind, word);
            }
            self.seat.listen();
            // Those beyond wait in the spool.
            if self.held.len() < MAX_HELD
                && let Some(episode) = self.seat.episode()
            {
                self.hold(episode);
            }
            let now = Instant::now();
            if now >= next_beat {
                next_beat = now + BEAT;
                if self.seat.follow()? {
                    let cell = self.reach.config.cell.name().to_string();
                    (self.reach.on_event)(Event::Controller { cell });
                }
                self.beat();
            }
            if now >= next_housekeeping {
                next_housekeeping = now + HOUSEKEEPING;
                self.seat.clean_up();
                self.seat.ask_status();
            }
            self.commands.look().into_iter().for_each(|event| (self.reach.on_event)(event));
            self.take_turns();
        }
        Ok(())
    }

    /// A controller that is asked again sends again.
    fn hold(&mut self, episode: Episode) {
        if !self.held.contains(&episode) {
            self.held.push_back(episode);
        }
    }

    fn take_turns(&mut self) {
        if self.news.is_due() {
            self.send(Kind::News);
        }
        if !self.held.is_empty() && self.episode.is_due() {
            self.send(Kind::Episode);
        }
        if self.reply.is_due() && self.commands.reply(0).is_some() {
            self.send(Kind::Reply);
        }
        if self.news.failures >= KNOCK_AFTER && self.door.is_due() {
            self.send(Kind::Door);
        }
    }

    fn send(&mut self, kind: Kind) {
        let head = self.head();
        let bytes = match (kind, self.held.front()) {
            (Kind::Episode, Some(episode)) => {
                head.encode(Some((&episode.header, &episode.records)))
            }
            (Kind::Reply, _) => {
                let Some(reply) = self.commands.reply(monotonic_ns()) else { return };
                head.encode_reply(&reply)
            }
            _ => head.encode(None),
        };
        let key = if kind == Kind::Door { DOOR } else { &self.key };
        let timeout = if kind == Kind::Episode { EPISODE_TURN } else { TURN };
        let listener = Listener { kind, out: self.out.clone() };
        // Where it fails the listener is dropped, which is the end of the turn.
        let sent = self
            .session
            .get(key)
            .payload(bytes)
            .timeout(timeout)
            .callback(move |reply| listener.hear(reply))
            .wait();
        if let Err(error) = sent {
            self.reach.failed(error.to_string());
        }
        let turns = self.turns(kind);
        (turns.is_under_way, turns.is_answered) = (true, false);
    }

    fn turns(&mut self, kind: Kind) -> &mut Turns {
        match kind {
            Kind::News => &mut self.news,
            Kind::Episode => &mut self.episode,
            Kind::Door => &mut self.door,
            Kind::Reply => &mut self.reply,
        }
    }

    fn head(&self) -> TurnHead {
        let config = self.reach.config;
        TurnHead {
            bridge: config.id,
            host: text::pack(&net::host_name()),
            cell: text::pack(config.cell.name()),
            certificate: text::pack(&self.certificate),
            world: text::pack(&config.world),
            controller: self.seat.controller(),
            status: self.seat.status(),
            seen: self.seen,
            commands: self.commands.newest(self.seen.hub),
            has_episode: 0,
            has_reply: 0,
        }
    }

    fn hear(&mut self, kind: Kind, word: Word) {
        match word {
            // It lets this cell in: then it is only the network.
            Word::Answer(_) if kind == Kind::Door => self.door.is_answered = true,
            Word::Answer(bytes) => match Answer::decode(&bytes) {
                Ok(answer) => {
                    self.turns(kind).is_answered = true;
                    self.reach.answered();
                    self.take(kind, answer);
                }
                Err(error) => self.reach.failed(format!("its answer is not used: {error}")),
            },
            Word::Refusal(reason) => {
                self.learner = None;
                self.reach.refused(reason);
            }
            Word::End => {
                let turns = self.turns(kind);
                turns.ended();
                let is_unexplained = turns.failures > KNOCK_AFTER;
                if kind == Kind::News && is_unexplained && self.reach.complained.is_nothing() {
                    let reason = "the link is down, or no hub serves this cell";
                    self.reach.failed(reason.to_string());
                }
            }
        }
    }

    /// The acknowledgement goes to the controller before what is asked next.
    fn take(&mut self, kind: Kind, mut answer: Answer) {
        let had_learner = self.learner.map(|(head, _)| head.learner_is_there == 1);
        let is_there = answer.head.learner_is_there == 1;
        if had_learner != Some(is_there) {
            let cell = self.reach.config.cell.name().to_string();
            (self.reach.on_event)(Event::Learner { cell, is_there });
        }
        if had_learner == Some(true) && answer.head.learner.leaving == 1 {
            // It takes its leave once, so that nobody waits for it.
            self.seat.beat(&answer.head.learner);
        }
        self.learner = Some((answer.head, Instant::now()));
        match kind {
            Kind::Episode => self.settle(&answer.head),
            Kind::Reply => self.commands.delivered(),
            _ => {}
        }
        let (seen, had) = (answer.head.seen, self.seen);
        if let Some(command) = answer.command.take() {
            let (number, status) = (answer.head.command, self.seat.status());
            let event = self.commands.take(seen.hub, number, command, status);
            event.into_iter().for_each(|event| (self.reach.on_event)(event));
        }
        if seen.hub == had.hub && (seen.policy < had.policy || seen.ack < had.ack) {
            return; // overtaken by the answer to the other turn
        }
        self.seat.acknowledge(&answer.head.acks);
        self.seen = seen;
        let is_news = (seen.hub, seen.policy) != (had.hub, had.policy);
        if let Some(policy) = answer.policy.filter(|_| is_news) {
            let (session, rollout) = (policy.session, policy.rollout);
            (self.reach.on_event)(Event::Asked { session, rollout });
            self.seat.ask(policy);
        }
    }

    /// What has become of the episode in the turn: the oldest that is held.
    fn settle(&mut self, head: &AnswerHead) {
        let Some(episode) = self.held.front() else { return };
        let (session, rollout) = (episode.header.session, episode.header.rollout);
        let event = match head.verdict {
            VERDICT_DURABLE => Some(Event::Durable { session, rollout }),
            VERDICT_FOREIGN => Some(Event::Foreign { session, rollout, asks: head.session }),
            // Its controller will send it again.
            VERDICT_ASKED_AGAIN => None,
            _ => return,
        };
        self.held.pop_front();
        event.into_iter().for_each(|event| (self.reach.on_event)(event));
    }

    /// Beats for a learner that is heard over there. One that is not must be missed by the controller.
    fn beat(&mut self) {
        let is_fresh = |at: &Instant| at.elapsed() < PATIENCE;
        let learner = self.learner.as_ref();
        let is_watched = learner.is_some_and(|(head, at)| head.watched == 1 && is_fresh(at));
        self.watch(is_watched);
        if let Some((head, at)) = &self.learner
            && is_fresh(at)
            && head.learner_is_there == 1
            && head.learner.schema == SCHEMA
        {
            self.seat.beat(&head.learner);
        }
    }

    fn watch(&mut self, is_watched: bool) {
        self.telemetry.set_watched(is_watched);
        if std::mem::replace(&mut self.is_watched, is_watched) != is_watched
            && self.reach.config.telemetry_hz > 0
        {
            let cell = self.reach.config.cell.name().to_string();
            (self.reach.on_event)(Event::Watched { cell, is_watched });
        }
    }
}
