//! Commands of a tool, executed on the exchange thread.
//!
//! The reply to a swap is sent once the loop has applied it, to a change of the catalogue once it is on
//! disk. A command repeated with the same id gets the same reply and is not executed again.

use std::collections::VecDeque;
use std::sync::Arc;

use shm_types::channel::CommandRequest;
use shm_types::command::{
    COMMAND_ACTIVATE, COMMAND_ALLOW, COMMAND_FORBID, COMMAND_HOLD, COMMAND_IMPORT, COMMAND_PIN,
    COMMAND_POSTURE, COMMAND_REARM, COMMAND_ROLLBACK, COMMAND_STATUS, COMMAND_STOP, COMMAND_UNPIN,
    Command, CommandError, LAST_GOOD, Reply,
};
use shm_types::policy::PolicyName;
use thiserror::Error;

use crate::admit::admission::AdmissionError;
use crate::admit::disturbance::Disturbed;
use crate::admit::posture::PostureError;
use crate::disk::catalogue::CatalogueError;
use crate::disk::state_file::Remember;
use crate::exchange::swap::{Served, SwapRefused};
use crate::exchange::{Exchange, KNOWN};
use crate::fault::Fault;
use crate::hot::monitor::CLEAR_TICKS;
use crate::rings::{Applied, PostureTaken};

/// Replies kept for repeated commands.
const RECENT: usize = 64;

/// Why a command was not executed.
#[derive(Debug, Error)]
pub(crate) enum Refusal {
    #[error(transparent)]
    Command(#[from] CommandError),
    #[error(transparent)]
    Admission(#[from] AdmissionError),
    #[error(transparent)]
    Catalogue(#[from] CatalogueError),
    #[error(transparent)]
    Swap(#[from] SwapRefused),
    #[error(transparent)]
    Posture(#[from] PostureError),
    #[error(transparent)]
    Disturbed(#[from] Disturbed),
    #[error("the loop is still processing earlier postures: repeat the command in a moment")]
    PostureWaits,
    #[error("the rollout ended before policy {0} acted: {1}")]
    Abandoned(String, &'static str),
    #[error("the arm is held ({0}): run `skillet rearm` first")]
    Latched(&'static str),
    #[error("this task has no arm to hold")]
    NoArm,
    #[error("no fault is latched: there is nothing to re-arm")]
    NothingLatched,
    #[error(
        "{0}: its cause was present within the last {CLEAR_TICKS} ticks; try again in a moment, or fix it if it persists"
    )]
    StillPresent(&'static str),
    #[error("the cell's state cannot be saved ({0}): free space or fix permissions, then repeat")]
    NotKept(String),
}

/// What a command waits for.
#[derive(Clone, Copy, PartialEq)]
enum Outcome {
    Done,
    /// Replied to when the loop has applied this swap.
    Applied(u64),
    /// Replied to when this is on disk.
    Kept(u64),
    /// Replied to when the loop has reported whether it is re-armed.
    Rearmed,
    /// Replied to when the loop has this posture.
    Posture(u64),
    Stop,
}

struct Waiting {
    request: CommandRequest,
    outcome: Outcome,
}

/// Commands that wait for their reply, and replies kept for repeated commands.
pub(crate) struct Commands {
    waiting: Vec<Waiting>,
    recent: VecDeque<Reply>,
    pub refused: u64,
}

impl Commands {
    pub fn new() -> Commands {
        Commands { waiting: Vec::new(), recent: VecDeque::new(), refused: 0 }
    }

    /// Nobody waits for an answer.
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Takes the commands out that wait for `outcome`.
    fn waiting_for(&mut self, outcome: &Outcome) -> Vec<CommandRequest> {
        let is_it = |waiting: &mut Waiting| waiting.outcome == *outcome;
        self.waiting.extract_if(.., is_it).map(|waiting| waiting.request).collect()
    }

    /// A repeated command gets the answer of the first, now or when it is there.
    fn unless_repeated(&mut self, request: CommandRequest) -> Option<CommandRequest> {
        if request.kind == COMMAND_STATUS {
            return Some(request); // the answer is another one every time
        }
        if let Some(reply) = self.recent.iter().find(|reply| reply.id == request.id) {
            let _ = request.send_copy(*reply);
            return None;
        }
        let first = self.waiting.iter().find(|waiting| waiting.request.id == request.id);
        match first.map(|first| first.outcome) {
            Some(outcome) => {
                // Nobody waits any more for the answers of earlier attempts.
                let id = request.id;
                self.waiting.retain(|w| w.request.id != id || w.request.is_connected());
                self.waiting.push(Waiting { request, outcome });
                None
            }
            None => Some(request),
        }
    }

    fn answer(&mut self, request: CommandRequest, reply: Reply) {
        if request.kind != COMMAND_STATUS {
            self.recent.truncate(RECENT - 1);
            self.recent.push_front(reply);
        }
        // A client that has gone asks again, or does not care.
        let _ = request.send_copy(reply);
    }
}

impl<P: Clone + PartialEq> Exchange<'_, P> {
    /// Answers what can be answered. True when asked to stop.
    pub(crate) fn serve_commands(&mut self) -> bool {
        let mut stop = false;
        while let Ok(Some(request)) = self.ports.commands.receive() {
            self.active = true;
            let command: Command = *request;
            let Some(request) = self.commands.unless_repeated(request) else { continue };
            match self.carry_out(&command) {
                Ok(outcome) if !matches!(outcome, Outcome::Done | Outcome::Stop) => {
                    self.commands.waiting.push(Waiting { request, outcome });
                }
                Ok(outcome) => {
                    stop |= outcome == Outcome::Stop;
                    let policy = self.named(&command);
                    let reply = Reply { policy, ..Reply::accepted(command.id, self.status()) };
                    self.commands.answer(request, reply);
                }
                Err(refusal) => self.refuse(request, &refusal),
            }
        }
        self.answer_kept();
        stop
    }

    fn refuse(&mut self, request: CommandRequest, refusal: &Refusal) {
        tracing::warn!("command refused: {refusal}");
        self.commands.refused += 1;
        let reply = Reply::refused(request.id, self.status(), &refusal.to_string());
        self.commands.answer(request, reply);
    }

    fn carry_out(&mut self, command: &Command) -> Result<Outcome, Refusal> {
        command.validate()?;
        let (id, at) = (command.policy_id, command.at);
        Ok(match command.kind {
            COMMAND_STOP => Outcome::Stop,
            COMMAND_IMPORT => {
                let (policy, n_records) = (self.setup.admit_to_serve)(&command.policy)?;
                let ticket = self.catalogue.import(&command.policy)?;
                let message = command.policy.named(self.catalogue.numbered(command.policy.digest));
                self.know(Arc::new(Served { message, policy, n_records }));
                kept(ticket)
            }
            COMMAND_ACTIVATE => {
                self.expect_armed()?;
                let policy = self.servable(id)?;
                Outcome::Applied(self.serving.activate(policy, at)?)
            }
            COMMAND_ROLLBACK => {
                self.expect_armed()?;
                Outcome::Applied(self.serving.rollback(at)?)
            }
            COMMAND_HOLD => {
                self.hold()?;
                Outcome::Done
            }
            COMMAND_REARM => {
                self.rearm()?;
                Outcome::Rearmed
            }
            COMMAND_POSTURE => Outcome::Posture(self.move_posture(command)?),
            COMMAND_PIN | COMMAND_UNPIN => {
                self.serving.pin(command.kind == COMMAND_PIN)?;
                kept(self.remember())
            }
            COMMAND_FORBID | COMMAND_ALLOW => {
                let forbidden = command.kind == COMMAND_FORBID;
                let digest = self.catalogue.forbid(id, forbidden)?;
                if forbidden {
                    self.serving.drop_policy(digest);
                }
                kept(self.remember())
            }
            // Status: the reply carries it anyhow.
            _ => Outcome::Done,
        })
    }

    /// The policy `id`, checked again: the bounds may be others than when it was imported.
    fn servable(&mut self, id: u64) -> Result<Arc<Served<P>>, Refusal> {
        if id == LAST_GOOD {
            return Ok(self.serving.last_good().cloned().ok_or(CatalogueError::NoneGood)?);
        }
        let message = *self.catalogue.get(id)?;
        // Not long ago: the dry run need not be repeated.
        if let Some(known) = self.known.iter().find(|known| known.name() == message.name()) {
            return Ok(known.clone());
        }
        let (policy, n_records) = (self.setup.admit_to_serve)(&message)?;
        let served = Arc::new(Served { message, policy, n_records });
        self.know(served.clone());
        Ok(served)
    }

    fn know(&mut self, served: Arc<Served<P>>) {
        self.known.retain(|known| known.name() != served.name());
        self.known.insert(0, served);
        self.known.truncate(KNOWN);
    }

    /// Orders what is served to be written.
    pub(crate) fn remember(&mut self) -> Option<u64> {
        self.catalogue.remember(Remember {
            active: self.serving.active().map(|active| active.name()),
            last_good: self.serving.last_good().map(|good| &good.message),
            pinned: self.serving.is_pinned(),
            latched: self.latched,
        })
    }

    /// The loop has applied a swap: those who wait for it are told.
    pub(crate) fn answer_applied(&mut self, applied: &Applied<P>, policy: PolicyName) {
        for request in self.commands.waiting_for(&Outcome::Applied(applied.seq)) {
            let reply = Reply {
                policy,
                applied_tick: applied.tick,
                applied_ns: applied.at_ns,
                ..Reply::accepted(request.id, self.status())
            };
            self.commands.answer(request, reply);
        }
    }

    /// The loop has taken a posture.
    pub(crate) fn answer_posture(&mut self, taken: &PostureTaken) {
        for request in self.commands.waiting_for(&Outcome::Posture(taken.seq)) {
            let reply = Reply {
                applied_tick: taken.tick,
                applied_ns: taken.at_ns,
                ..Reply::accepted(request.id, self.status())
            };
            self.commands.answer(request, reply);
        }
    }

    /// The rollout that was to fulfil swap `seq` ended before.
    pub(crate) fn answer_abandoned(&mut self, seq: u64, policy: PolicyName, why: &'static str) {
        for request in self.commands.waiting_for(&Outcome::Applied(seq)) {
            self.refuse(request, &Refusal::Abandoned(policy.describe(), why));
        }
    }

    /// The loop has answered: what is re-armed is told when that is on disk.
    pub(crate) fn answer_rearmed(&mut self, rearmed: Result<Option<u64>, Fault>) {
        for request in self.commands.waiting_for(&Outcome::Rearmed) {
            match rearmed {
                Ok(Some(ticket)) => {
                    self.commands.waiting.push(Waiting { request, outcome: Outcome::Kept(ticket) });
                }
                Ok(None) => {
                    let reply = Reply::accepted(request.id, self.status());
                    self.commands.answer(request, reply);
                }
                Err(fault) => {
                    let why = Fault::describe(fault as u32);
                    self.refuse(request, &Refusal::StillPresent(why));
                }
            }
        }
    }

    fn answer_kept(&mut self) {
        while let Some(kept) = self.catalogue.kept() {
            for request in self.commands.waiting_for(&Outcome::Kept(kept.ticket)) {
                match &kept.result {
                    Ok(()) => {
                        let policy = self.named(&request);
                        let reply = Reply { policy, ..Reply::accepted(request.id, self.status()) };
                        self.commands.answer(request, reply);
                    }
                    Err(error) => self.refuse(request, &Refusal::NotKept(error.clone())),
                }
            }
        }
    }

    /// The policy that a change of the catalogue was about.
    fn named(&self, command: &Command) -> PolicyName {
        match command.kind {
            COMMAND_IMPORT => self.catalogue.numbered(command.policy.digest),
            COMMAND_FORBID | COMMAND_ALLOW => self.catalogue.name(command.policy_id),
            _ => self.serving.served().map_or(PolicyName::NONE, |served| served.name()),
        }
    }
}

/// Nothing to wait for where nothing is written.
fn kept(ticket: Option<u64>) -> Outcome {
    ticket.map_or(Outcome::Done, Outcome::Kept)
}
