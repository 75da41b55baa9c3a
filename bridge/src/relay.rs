//! Commands of tools on the learner's machine, on their way to a controller elsewhere.
//!
//! Each is carried out at most once. One that has not been sent is withdrawn. If the link is cut between a command and its
//! reply, the tool gets the reply that the outcome is unknown.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use shm_types::channel::CommandRequest;
use shm_types::command::{ACCEPTED, COMMAND_STATUS, Command, REFUSED, Reply, Status, command_name};
use shm_types::text;

use crate::command::{SentReply, check_command};
use crate::event::Event;

/// How long a command may wait to be sent, and one that was sent for its reply. A swap may wait for a rollout to end.
const UNSENT: Duration = Duration::from_secs(3);
const UNANSWERED: Duration = Duration::from_secs(90);
/// Commands under way at once.
const MAX_PENDING: usize = 8;
/// Why nothing is done, and nothing known.
pub(crate) const NOT_CONNECTED: &str = "it is not connected: nothing was done";
/// Replies kept for tools that ask again.
const RECENT: usize = 32;

/// Whether a command can have been carried out.
#[derive(Clone, Copy, PartialEq)]
enum Progress {
    Queued,
    Sent,
    /// The cell says that it has it.
    Taken,
}

struct Pending {
    number: u64,
    command: Box<Command>,
    /// The tool's attempts; the newest is alive while the tool is.
    request: CommandRequest,
    came: Instant,
    progress: Progress,
}

/// What waits for a reply, of one cell.
pub(crate) struct Relay {
    cell: String,
    /// The machine of the bridge that has joined, or had.
    host: String,
    newest: u64,
    pending: Vec<Pending>,
    recent: VecDeque<Reply>,
}

impl Relay {
    pub fn new(cell: &str) -> Relay {
        let (cell, host) = (cell.to_string(), String::new());
        Relay { cell, host, newest: 0, pending: Vec::new(), recent: VecDeque::new() }
    }

    pub fn joined(&mut self, host: &str) {
        self.host = host.to_string();
    }

    pub fn host(&self) -> &str {
        &self.host
    }

    /// Takes what a tool asks of the controller, or refuses it.
    pub fn take(&mut self, request: CommandRequest, is_connected: bool) {
        if let Some(reply) = self.recent.iter().find(|reply| reply.id == request.id) {
            let _ = request.send_copy(*reply);
            return;
        }
        if let Some(pending) = self.pending.iter_mut().find(|p| p.command.id == request.id) {
            pending.request = request;
            return;
        }
        if !is_connected {
            return self.refuse(&request, NOT_CONNECTED);
        }
        if let Err(error) = check_command(&request) {
            return self.refuse(&request, &error.to_string());
        }
        if self.pending.len() >= MAX_PENDING {
            let reason = format!("{MAX_PENDING} commands wait for their replies: nothing was done");
            return self.refuse(&request, &reason);
        }
        self.newest += 1;
        let command = Box::new(*request);
        let (number, came) = (self.newest, Instant::now());
        let progress = Progress::Queued;
        self.pending.push(Pending { number, command, request, came, progress });
    }

    /// The command that a cell needs next that has those up to `after`. Nobody waits for one whose tool has gone.
    pub fn next(&self, after: u64) -> Option<(u64, &Command)> {
        let is_next = |p: &&Pending| {
            p.number > after && p.progress != Progress::Taken && p.request.is_connected()
        };
        self.pending.iter().find(is_next).map(|pending| (pending.number, &*pending.command))
    }

    /// It is in an answer that goes out.
    pub fn sent(&mut self, number: u64) {
        for pending in self.pending.iter_mut().filter(|pending| pending.number == number) {
            pending.progress = Progress::Sent;
        }
    }

    /// The cell has all that were sent up to this one.
    pub fn taken(&mut self, up_to: u64) {
        let is_taken = |p: &&mut Pending| p.number <= up_to && p.progress == Progress::Sent;
        self.pending.iter_mut().filter(is_taken).for_each(|p| p.progress = Progress::Taken);
    }

    /// Gives a reply to its tool; `now_ns` is the time of this machine. What is to be logged of it.
    pub fn replied(&mut self, sent: &SentReply, now_ns: u64) -> Event {
        let applied_ns = match sent.reply.applied_ns {
            0 => 0,
            _ => now_ns.saturating_sub(sent.age_ns),
        };
        let reply = Reply { applied_ns, ..sent.reply };
        let is_it = |pending: &Pending| pending.command.id == reply.id;
        let Some(at) = self.pending.iter().position(is_it) else {
            return self.told("a command that was given up", &reply);
        };
        let pending = self.pending.remove(at);
        self.reply(&pending.request, reply);
        self.told(command_name(pending.command.kind), &reply)
    }

    /// The bridge has gone: what it was sent and did not reply to is unknown from now on.
    pub fn cut(&mut self) -> Vec<Event> {
        let reason = format!("the link to {} was cut", self.host);
        self.give_up(&reason, |pending| pending.progress != Progress::Queued)
    }

    /// Withdraws what could not be sent, and gives up what nobody replies to.
    pub fn expire(&mut self) -> Vec<Event> {
        let is_late =
            |p: &mut Pending| p.progress == Progress::Queued && p.came.elapsed() >= UNSENT;
        for pending in self.pending.extract_if(.., is_late).collect::<Vec<_>>() {
            let reason =
                format!("the cell did not accept it within {UNSENT:.0?}: nothing was done");
            self.refuse(&pending.request, &reason);
        }
        let reason = format!("no reply for {UNANSWERED:.0?}");
        self.give_up(&reason, |pending| pending.came.elapsed() >= UNANSWERED)
    }

    fn give_up(&mut self, reason: &str, is_lost: impl Fn(&Pending) -> bool) -> Vec<Event> {
        let mut events = Vec::new();
        for pending in self.pending.extract_if(.., |p| is_lost(p)).collect::<Vec<_>>() {
            let what = command_name(pending.command.kind);
            let reason = format!(
                "{reason}: it is unknown whether `{what}` was carried out, and it will not be repeated; \
                 `skillet status --cell {}` shows the state of the cell",
                self.cell
            );
            let reply = Reply::unknown(pending.command.id, Status::ZERO, &reason);
            self.reply(&pending.request, reply);
            events.push(self.told(what, &reply));
        }
        events
    }

    pub fn refuse(&mut self, request: &CommandRequest, reason: &str) {
        self.reply(request, Reply::refused(request.id, Status::ZERO, reason));
    }

    /// Replies, and keeps the reply.
    fn reply(&mut self, request: &CommandRequest, reply: Reply) {
        let reply = Reply { via: text::pack(&self.host), ..reply };
        if request.kind != COMMAND_STATUS {
            self.recent.truncate(RECENT - 1);
            self.recent.push_front(reply);
        }
        // A tool that has gone does not care.
        let _ = request.send_copy(reply);
    }

    fn told(&self, what: &'static str, reply: &Reply) -> Event {
        Event::Command { cell: self.cell.clone(), what, outcome: outcome(reply) }
    }
}

/// A reply in words; a refusal with its reason.
pub(crate) fn outcome(reply: &Reply) -> Result<(), String> {
    match reply.accepted {
        ACCEPTED => Ok(()),
        REFUSED => Err(format!("refused: {}", reply.reason_text())),
        _ => Err(reply.reason_text()),
    }
}
