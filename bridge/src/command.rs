//! A command on its way to a controller on another machine, and the reply on its way back.
//!
//! The hub numbers what tools ask for. A number goes out with the answer to a turn, again and again until a turn says
//! that it has come; the cell takes each number once, and each id of a command once. The reply is a turn of its own.

use shm_types::command::{
    COMMAND_HOLD, COMMAND_IMPORT, COMMAND_REARM, COMMAND_STATUS, COMMAND_STOP, Command, Reply,
    Status, UNKNOWN,
};
use shm_types::{SCHEMA, text};
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

use crate::message::MessageError;

/// The reply to a command, as a cell sends it.
#[derive(Clone, Copy, Debug, PartialEq, IntoBytes, FromBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct SentReply {
    /// Since the tick of the reply began, ns. Clocks of two machines have nothing in common.
    pub age_ns: u64,
    pub reply: Reply,
}

impl SentReply {
    pub fn check(&self) -> Result<(), MessageError> {
        let Reply { schema, accepted, reason, via, status, .. } = &self.reply;
        if *schema != SCHEMA {
            return Err(MessageError::Schema { found: *schema });
        }
        if !text::is_valid(reason) || !text::is_valid(via) {
            return Err(MessageError::Text);
        }
        if *accepted > UNKNOWN {
            return Err(MessageError::Value("accepted"));
        }
        check_status(status)
    }
}

/// A status has two values that may not be finite.
pub fn check_status(status: &Status) -> Result<(), MessageError> {
    match status.posture.iter().chain([&status.posture_s]).all(|value| value.is_finite()) {
        true => Ok(()),
        false => Err(MessageError::Value("posture")),
    }
}

/// Checks what a cell is asked to do, the policy of an import with its digest. The controller checks it once more.
pub fn check_command(command: &Command) -> Result<(), MessageError> {
    command.validate()?;
    if matches!(command.kind, COMMAND_STATUS | COMMAND_STOP) {
        return Err(MessageError::Value("kind"));
    }
    if !command.posture.iter().chain([&command.duration_s]).all(|value| value.is_finite()) {
        return Err(MessageError::Value("posture"));
    }
    if command.kind == COMMAND_IMPORT {
        command.policy.validate()?;
    }
    Ok(())
}

/// What the owner of an arm lets other machines do with it. A hold is always accepted: it moves nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Accepts {
    /// Policies and postures.
    pub commands: bool,
    /// Ending a hold. Somebody may stand beside the arm who has held it.
    pub rearm: bool,
}

impl Accepts {
    /// Why a command of this kind is not carried out for cell `cell` of this `host`, if it is not.
    pub fn refusal(&self, kind: u64, cell: &str, host: &str) -> Option<String> {
        match kind {
            COMMAND_HOLD => None,
            COMMAND_REARM if self.rearm => None,
            COMMAND_REARM => Some(format!(
                "the arm is re-armed on its own machine only: run `skillet rearm --cell {cell}` on {host}, or start \
                 its `skillet bridge join` with --accept-rearm"
            )),
            _ if self.commands => None,
            _ => Some(format!(
                "{host} accepts no command but `hold` from another machine: run the command there, or start its \
                 `skillet bridge join` with --accept-commands"
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use shm_types::command::{COMMAND_ACTIVATE, COMMAND_POSTURE};
    use shm_types::policy::PolicyMsg;

    use super::*;

    #[test]
    fn what_a_controller_must_not_get_is_refused() {
        let activate = Command::new(COMMAND_ACTIVATE, 1);
        assert_eq!(check_command(&activate), Ok(()));
        for kind in [COMMAND_STATUS, COMMAND_STOP] {
            let refused = check_command(&Command { kind, ..activate });
            assert_eq!(refused, Err(MessageError::Value("kind")));
        }
        assert!(matches!(
            check_command(&Command { kind: 99, ..activate }),
            Err(MessageError::Command(_))
        ));
        let endless = Command { duration_s: f64::INFINITY, ..Command::new(COMMAND_POSTURE, 1) };
        assert_eq!(check_command(&endless), Err(MessageError::Value("posture")));
        let policy = PolicyMsg { duration_s: 2.0, ..PolicyMsg::of_action(&[0.5]).sealed() };
        let import = Command { policy, ..Command::new(COMMAND_IMPORT, 1) };
        assert!(matches!(check_command(&import), Err(MessageError::Policy(_))), "its digest");
    }

    #[test]
    fn a_reply_that_no_tool_could_read_is_refused() {
        let reply = Reply::accepted(1, Status::ZERO);
        let sent = |reply| SentReply { age_ns: 3, reply }.check();
        assert_eq!(sent(reply), Ok(()));
        assert_eq!(sent(Reply { accepted: 3, ..reply }), Err(MessageError::Value("accepted")));
        assert_eq!(sent(Reply { schema: 3, ..reply }), Err(MessageError::Schema { found: 3 }));
        let mut hidden = reply;
        hidden.reason[7] = b'x';
        assert_eq!(sent(hidden), Err(MessageError::Text));
        let status = Status { posture_s: f64::NAN, ..Status::ZERO };
        assert_eq!(sent(Reply { status, ..reply }), Err(MessageError::Value("posture")));
    }

    #[test]
    fn the_owner_of_the_arm_decides_and_a_hold_is_always_accepted() {
        let [none, commands, rearm] = [(false, false), (true, false), (false, true)]
            .map(|(commands, rearm)| Accepts { commands, rearm });
        let refusal = |accepts: Accepts, kind| accepts.refusal(kind, "kitchen", "arm-pc");
        assert_eq!(refusal(none, COMMAND_HOLD), None);
        assert!(refusal(none, COMMAND_ACTIVATE).unwrap().contains("--accept-commands"));
        assert_eq!(refusal(commands, COMMAND_ACTIVATE), None);
        assert!(refusal(commands, COMMAND_REARM).unwrap().contains("--accept-rearm"));
        assert_eq!(refusal(rearm, COMMAND_REARM), None);
        assert!(refusal(rearm, COMMAND_IMPORT).is_some());
    }
}
