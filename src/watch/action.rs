//! Commands that the terminal view and the browser view give to a cell.
//! A rating is a letter to the session of the cell's learner.

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

    pub fn name(self) -> String {
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

    /// Waits for the reply, and describes it; a refusal or silence is an error. `newest` is the newest
    /// rollout shown.
    pub fn carry_out(self, cell: &Cell, newest: Option<u64>) -> Result<String, String> {
        let done = match (self, self.command()) {
            (Action::Rate(word), _) => rate(cell, newest, word),
            (_, Some(command)) => request(cell, &command),
            (_, None) => Err("this command is not for the controller".into()),
        };
        let name = self.name();
        done.map(|text| format!("{name}: {text}")).map_err(|text| format!("{name}: {text}"))
    }
}

fn rate(cell: &Cell, newest: Option<u64>, word: Word) -> Result<String, String> {
    let folder = cell.session().ok_or("this cell has had no learner, so there is no session")?;
    let rated = SessionFolder::open(&folder).and_then(|folder| people::rate(&folder, newest, word));
    rated.map(|rated| rated.sentence()).map_err(|error| format!("{error:#}"))
}

fn request(cell: &Cell, command: &Command) -> Result<String, String> {
    let ports = ToolPorts::open(cell, OPEN).map_err(|error| error.to_string())?;
    match ports.request(command, TIMEOUT) {
        None => Err("no reply yet; see the active policy above".into()),
        Some(reply) if reply.accepted == UNKNOWN => Err(reply.reason_text()),
        Some(reply) if reply.accepted != 1 => {
            Err(format!("refused{}: {}", through(&reply), reply.reason_text()))
        }
        Some(reply) if reply.applied_tick > 0 => {
            let (policy, tick) = (reply.policy.describe(), reply.applied_tick);
            Ok(format!("policy {policy} applied at tick {tick}{}", through(&reply)))
        }
        Some(reply) => Ok(format!("done{}", through(&reply))),
    }
}
