//! Commands of the tool to the controller, and its replies.

use iceoryx2::prelude::ZeroCopySend;
use thiserror::Error;

use crate::SCHEMA;

pub const COMMAND_STATUS: u64 = 1;
pub const COMMAND_STOP: u64 = 2;

message! {
    /// A request; `id` is the client's own, so that a repeated request is recognised.
    pub struct Command as "skillet/Command/1" {
        pub schema: u64,
        pub id: u64,
        /// `COMMAND_*`.
        pub kind: u64,
    }
}

message! {
    /// State of the controller when it answered. Times in ns; percentiles since its start.
    pub struct Reply as "skillet/Reply/1" {
        pub schema: u64,
        pub id: u64,
        /// 1 when the command was understood and carried out.
        pub accepted: u64,
        pub boot_id: u64,
        pub tick: u64,
        pub phase: u64,
        pub fault: u64,
        pub period_ns: u64,
        /// 1: paced by the wall clock; 0: as fast as the simulation allows.
        pub realtime: u64,
        /// 1: the loop has real-time priority.
        pub privileged: u64,
        /// Active or last policy, and where it came from.
        pub session: u64,
        pub rollout: u64,
        pub policy_id: u64,
        pub applied_tick: u64,
        pub rollouts_done: u64,
        pub policies_refused: u64,
        /// Episodes sent whose durability the learner has not confirmed.
        pub unacknowledged: u64,
        /// Age of the learner's last heartbeat; `u64::MAX` when none was ever seen.
        pub learner_age_ns: u64,
        pub deadline_misses: u64,
        pub wakeup_p50_ns: u64,
        pub wakeup_p99_ns: u64,
        pub wakeup_max_ns: u64,
        pub tick_p50_ns: u64,
        pub tick_p99_ns: u64,
        pub tick_max_ns: u64,
    }
}

/// Why a command was refused.
#[derive(Debug, Error, PartialEq)]
pub enum CommandError {
    #[error(
        "schema {found:#x} instead of {SCHEMA:#x}: tool and controller are different builds; use one"
    )]
    Schema { found: u64 },
    #[error("command kind {0} is unknown to this controller; update it")]
    Kind(u64),
}

impl Command {
    pub fn validate(&self) -> Result<(), CommandError> {
        if self.schema != SCHEMA {
            return Err(CommandError::Schema { found: self.schema });
        }
        match self.kind {
            COMMAND_STATUS | COMMAND_STOP => Ok(()),
            other => Err(CommandError::Kind(other)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refuses_unknown_kinds_and_other_builds() {
        let status = Command { schema: SCHEMA, id: 1, kind: COMMAND_STATUS };
        assert_eq!(status.validate(), Ok(()));
        assert_eq!(Command { kind: 99, ..status }.validate(), Err(CommandError::Kind(99)));
        let old = Command { schema: 3, ..status };
        assert_eq!(old.validate(), Err(CommandError::Schema { found: 3 }));
    }
}
