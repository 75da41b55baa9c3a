//! A tool's end of a cell: it sends commands and gets replies.

use std::sync::Arc;
use std::time::{Duration, Instant};

use iceoryx2::port::client::Client;
use iceoryx2::prelude::*;

use crate::SCHEMA;
use crate::advice;
use crate::cell::{Cell, Role};
use crate::channel::*;
use crate::command::{ACCEPTED, COMMAND_STATUS, Command, Reply, Status};
use crate::ports::with_retry;
use crate::text;

/// A client looks for its reply without pause for this long.
const EAGER: Duration = Duration::from_millis(2);

/// A command without reply is sent again after this long.
const REPEAT: Duration = Duration::from_secs(1);

/// The tool's end.
pub struct ToolPorts {
    pub commands: Client<Ipc, Command, (), Reply, ()>,
    cell: Cell,
    member: Arc<Member>,
}

impl ToolPorts {
    pub fn open(cell: &Cell, timeout: Duration) -> Result<ToolPorts, ChannelError> {
        with_retry(cell, timeout, &|| false, |member| ToolPorts::try_open(cell, member))
    }

    fn try_open(cell: &Cell, member: &Arc<Member>) -> Result<ToolPorts, ChannelError> {
        Ok(ToolPorts {
            commands: commands(&member.node, Door::Open)?
                .client_builder()
                .backpressure_strategy(BackpressureStrategy::DiscardData)
                .create()
                .map_err(failed(COMMAND, "creating the client"))?,
            cell: cell.clone(),
            member: member.clone(),
        })
    }

    /// Sends a command and waits for its reply; `None` after `timeout`. What is lost on the way, either
    /// way, is sent again: its id makes a repetition the same command.
    pub fn request(&self, command: &Command, timeout: Duration) -> Option<Reply> {
        let start = Instant::now();
        loop {
            let left = timeout.checked_sub(start.elapsed())?;
            if !self.member.generation.is_current() {
                // Nobody answers here any more.
                return ToolPorts::open(&self.cell, left).ok()?.request(command, left);
            }
            if let Some(reply) = self.attempt(command, left.min(REPEAT)) {
                return Some(reply);
            }
        }
    }

    /// As [`ToolPorts::request`], of the controller that is there now and of no other: `None` when it has gone, after
    /// `timeout`, or on `stop`. Nothing is said to one that follows it.
    pub fn request_here(
        &self,
        command: &Command,
        timeout: Duration,
        stop: &dyn Fn() -> bool,
    ) -> Option<Reply> {
        let start = Instant::now();
        while start.elapsed() < timeout && !stop() {
            if !self.member.generation.is_current() || !self.cell.has(Role::Controller) {
                return None;
            }
            if let Some(reply) = self.attempt(command, REPEAT) {
                return Some(reply);
            }
        }
        None
    }

    fn attempt(&self, command: &Command, patience: Duration) -> Option<Reply> {
        let start = Instant::now();
        let pending = self.commands.send_copy(*command).ok();
        while start.elapsed() < patience {
            if let Some(Ok(Some(reply))) = pending.as_ref().map(|pending| pending.receive())
                && reply.schema == SCHEMA
                && reply.id == command.id
            {
                return Some(*reply);
            }
            // Most replies come at once; the others must not cost a core.
            match start.elapsed() < EAGER {
                true => std::thread::yield_now(),
                false => std::thread::sleep(Duration::from_micros(500)),
            }
        }
        None
    }

    /// Why there was no reply for so long: the controller has died or stands still, or it is this process
    /// that cannot reach it.
    pub fn silence(&self, waited: Duration) -> ChannelError {
        let (cell, seconds) = (self.cell.name().to_string(), waited.as_secs_f64());
        if !self.cell.has(Role::Controller) {
            return ChannelError::NoController { cell, seconds };
        }
        let action = "reaching the controller";
        if let Err(error) = self.commands.send_copy(Command::new(COMMAND_STATUS, 0)) {
            return failed(COMMAND, action)(error);
        }
        match advice::on_no_connection() {
            Some(advice) => {
                let reason = "no connection".into();
                ChannelError::Service { service: COMMAND, action, reason, advice }
            }
            None => ChannelError::NoAnswer { cell, seconds },
        }
    }

    pub fn status(&self, timeout: Duration) -> Option<Status> {
        let reply = self.request(&status_command(), timeout)?;
        (reply.accepted == ACCEPTED).then_some(reply.status)
    }

    /// The status and which way it came, or why there is none.
    pub fn ask(&self, timeout: Duration) -> Result<Reply, ChannelError> {
        match self.request(&status_command(), timeout) {
            Some(reply) if reply.accepted == ACCEPTED => Ok(reply),
            Some(reply) => {
                let (cell, host) = (self.cell.name().to_string(), text::unpack(&reply.via));
                Err(ChannelError::NotConnected { cell, host })
            }
            None => Err(self.silence(timeout)),
        }
    }
}

fn status_command() -> Command {
    Command::new(COMMAND_STATUS, u64::from(std::process::id()))
}
