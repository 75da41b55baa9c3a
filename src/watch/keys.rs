//! Keys of the terminal view: each runs a command of the tool on its own thread.
//! A rating is a letter to the session of the cell's learner.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use shm_types::cell::Cell;
use shm_types::command::{
    AT_NOW, COMMAND_ACTIVATE, COMMAND_HOLD, COMMAND_PIN, COMMAND_REARM, COMMAND_ROLLBACK,
    COMMAND_UNPIN, Command, UNKNOWN,
};
use shm_types::ports::ToolPorts;
use shm_types::random_id;

use crate::cell::through;
use crate::people::{self, Word};
use crate::session_folder::SessionFolder;

const OPEN: Duration = Duration::from_secs(1);
const TIMEOUT: Duration = Duration::from_secs(5);

/// A command that a key stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// The policy of this number in the cell's catalogue, into the running rollout.
    Activate(u64),
    Pin,
    Unpin,
    RollBack,
    Hold,
    Rearm,
    /// Rates the newest rollout shown.
    Rate(Word),
}

/// What the bottom line asks.
#[derive(Clone, Debug, PartialEq)]
pub enum Prompt {
    None,
    /// Number of the policy to activate, as typed so far.
    Number(String),
    /// A rating from 0 to 10, as typed so far.
    Rating(String),
    /// An action that wants a second key.
    Sure(Action),
}

impl Action {
    /// `None` of what is not for the controller.
    fn command(self) -> Option<Command> {
        let kind = match self {
            Action::Rate(_) => return None,
            Action::Activate(_) => COMMAND_ACTIVATE,
            Action::Pin => COMMAND_PIN,
            Action::Unpin => COMMAND_UNPIN,
            Action::RollBack => COMMAND_ROLLBACK,
            Action::Hold => COMMAND_HOLD,
            Action::Rearm => COMMAND_REARM,
        };
        let command = Command::new(kind, random_id());
        Some(match self {
            Action::Activate(policy_id) => Command { policy_id, at: AT_NOW, ..command },
            Action::RollBack => Command { at: AT_NOW, ..command },
            _ => command,
        })
    }

    fn name(self) -> String {
        match self {
            Action::Activate(id) => format!("activate {id}"),
            Action::Pin => "pin".into(),
            Action::Unpin => "unpin".into(),
            Action::RollBack => "roll back".into(),
            Action::Hold => "hold".into(),
            Action::Rearm => "re-arm".into(),
            Action::Rate(_) => "rate".into(),
        }
    }
}

/// Runs actions and collects their results.
pub struct Keys {
    cell: Cell,
    said: Sender<String>,
    says: Receiver<String>,
}

impl Keys {
    pub fn new(cell: &Cell) -> Keys {
        let (said, says) = channel();
        Keys { cell: cell.clone(), said, says }
    }

    /// `newest` is the newest rollout that is shown.
    pub fn send(&self, action: Action, newest: Option<u64>) {
        let (cell, said) = (self.cell.clone(), self.said.clone());
        std::thread::spawn(move || {
            let answer = match action {
                Action::Rate(word) => rate(&cell, newest, word),
                action => carry_out(&cell, action),
            };
            // The receiver may be gone; nobody needs the reply then.
            let _ = said.send(answer);
        });
    }

    /// Results of earlier actions.
    pub fn answers(&self) -> impl Iterator<Item = String> {
        self.says.try_iter()
    }
}

fn rate(cell: &Cell, newest: Option<u64>, word: Word) -> String {
    let Some(folder) = cell.session() else {
        return "rate: this cell has had no learner, so there is no session".into();
    };
    let rated = SessionFolder::open(&folder).and_then(|folder| people::rate(&folder, newest, word));
    rated.map_or_else(|error| format!("rate: {error:#}"), |rated| rated.sentence())
}

fn carry_out(cell: &Cell, action: Action) -> String {
    let name = action.name();
    let Some(command) = action.command() else { return format!("{name}: not the controller's") };
    let ports = match ToolPorts::open(cell, OPEN) {
        Ok(ports) => ports,
        Err(error) => return format!("{name}: {error}"),
    };
    match ports.request(&command, TIMEOUT) {
        None => format!("{name}: no reply yet; see the active policy above"),
        Some(reply) if reply.accepted == UNKNOWN => format!("{name}: {}", reply.reason_text()),
        Some(reply) if reply.accepted != 1 => {
            format!("{name}: refused{}: {}", through(&reply), reply.reason_text())
        }
        Some(reply) if reply.applied_tick > 0 => {
            let (policy, tick) = (reply.policy.describe(), reply.applied_tick);
            format!("{name}: policy {policy} applied at tick {tick}{}", through(&reply))
        }
        Some(reply) => format!("{name}: done{}", through(&reply)),
    }
}
