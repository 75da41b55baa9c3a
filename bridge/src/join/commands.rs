//! Commands from the learner's machine, carried out at the controller of this cell.
//!
//! Each at most once: it goes to the controller that is there when it comes, and to none that follows. Its id tells
//! whether it came before.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use shm_types::cell::Cell;
use shm_types::command::{Command, Reply, Status, command_name};
use shm_types::ports::ToolPorts;

use crate::command::{Accepts, SentReply};
use crate::event::Event;
use crate::net;
use crate::relay::outcome;

/// How long a controller is looked for, and how long it may take. A swap may wait for a rollout to end.
const OPEN: Duration = Duration::from_secs(1);
const LONGEST: Duration = Duration::from_secs(75);
/// Commands that are carried out at once.
const MAX_RUNNING: usize = 4;
/// Replies kept for commands that come again.
const RECENT: usize = 64;

/// A command that is carried out.
struct Running {
    id: u64,
    what: &'static str,
    thread: JoinHandle<Reply>,
}

pub(super) struct Commands {
    cell: Cell,
    accepts: Accepts,
    /// The newest command that has come, and the start of the hub that it came from.
    hub: u64,
    newest: u64,
    running: Vec<Running>,
    recent: VecDeque<Reply>,
    /// Replies that the hub does not have yet.
    waiting: VecDeque<Reply>,
    stop: Arc<AtomicBool>,
}

impl Commands {
    pub fn new(cell: &Cell, accepts: Accepts) -> Commands {
        Commands {
            cell: cell.clone(),
            accepts,
            hub: 0,
            newest: 0,
            running: Vec::new(),
            recent: VecDeque::new(),
            waiting: VecDeque::new(),
            stop: Arc::new(AtomicBool::new(false)),
        }
    }

    /// The newest that has come from `hub`.
    pub fn newest(&self, hub: u64) -> u64 {
        if self.hub == hub { self.newest } else { 0 }
    }

    /// Takes a command of `hub`; `status` is that of the controller. What is to be logged.
    pub fn take(
        &mut self,
        hub: u64,
        number: u64,
        command: Box<Command>,
        status: Status,
    ) -> Option<Event> {
        if number <= self.newest(hub) {
            return None;
        }
        (self.hub, self.newest) = (hub, number);
        // From a hub that has restarted, of which the tool asked it again.
        if self.running.iter().any(|running| running.id == command.id) {
            return None;
        }
        if let Some(reply) = self.recent.iter().find(|reply| reply.id == command.id).copied() {
            self.deliver(reply);
            return None;
        }
        let (name, host) = (self.cell.name(), net::host_name());
        let what = command_name(command.kind);
        let refusal = self.accepts.refusal(command.kind, name, &host).or_else(|| {
            let is_full = self.running.len() >= MAX_RUNNING;
            is_full
                .then(|| format!("{MAX_RUNNING} commands are being carried out: repeat it later"))
        });
        if let Some(reason) = refusal {
            let reply = Reply::refused(command.id, status, &reason);
            return Some(self.ended(what, reply));
        }
        let (cell, stop, id) = (self.cell.clone(), self.stop.clone(), command.id);
        let thread = std::thread::spawn(move || carry_out(&cell, &command, &stop));
        self.running.push(Running { id, what, thread });
        None
    }

    /// Looks what has been carried out.
    pub fn look(&mut self) -> Vec<Event> {
        let is_over = |running: &mut Running| running.thread.is_finished();
        let over: Vec<Running> = self.running.extract_if(.., is_over).collect();
        over.into_iter().map(|running| self.over(running)).collect()
    }

    fn over(&mut self, running: Running) -> Event {
        let Running { id, what, thread } = running;
        let reply = thread.join().unwrap_or_else(|_| {
            Reply::unknown(id, Status::ZERO, "the bridge of the cell failed: see its log")
        });
        self.ended(what, reply)
    }

    fn ended(&mut self, what: &'static str, reply: Reply) -> Event {
        self.recent.truncate(RECENT - 1);
        self.recent.push_front(reply);
        self.deliver(reply);
        Event::Command { cell: self.cell.name().to_string(), what, outcome: outcome(&reply) }
    }

    fn deliver(&mut self, reply: Reply) {
        self.waiting.truncate(RECENT - 1);
        self.waiting.push_back(reply);
    }

    /// The reply that the hub is to get next; `now_ns` is the time of this machine's controllers.
    pub fn reply(&self, now_ns: u64) -> Option<SentReply> {
        let reply = *self.waiting.front()?;
        Some(SentReply { age_ns: now_ns.saturating_sub(reply.applied_ns), reply })
    }

    /// The hub has that reply.
    pub fn delivered(&mut self) {
        self.waiting.pop_front();
    }
}

impl Drop for Commands {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for running in self.running.drain(..) {
            let _ = running.thread.join();
        }
    }
}

fn carry_out(cell: &Cell, command: &Command, stop: &AtomicBool) -> Reply {
    let ports = match ToolPorts::open(cell, OPEN) {
        Ok(ports) => ports,
        Err(error) => {
            let reason = format!("{error}; nothing was done");
            return Reply::refused(command.id, Status::ZERO, &reason);
        }
    };
    let start = Instant::now();
    let is_over = || stop.load(Ordering::Relaxed);
    ports.request_here(command, LONGEST, &is_over).unwrap_or_else(|| {
        let (what, seconds) = (command_name(command.kind), start.elapsed().as_secs_f64());
        let reason = format!(
            "the controller of cell '{}' did not reply ({seconds:.1} s): it is unknown whether `{what}` was carried out",
            cell.name()
        );
        Reply::unknown(command.id, Status::ZERO, &reason)
    })
}
