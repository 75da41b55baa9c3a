//! Commands of the tool to the controller, and its replies.
//!
//! A command carries an id of the client's own: repeating it, after a lost reply, carries nothing
//! out twice.

#[cfg(feature = "transport")]
use iceoryx2::prelude::ZeroCopySend;
use thiserror::Error;

use crate::equipment::Equipment;
use crate::policy::{PolicyMsg, PolicyName};
use crate::text::{self, HOST_LEN, NO_HOST, NO_REASON, REASON_LEN};
use crate::{MAX_JOINTS, SCHEMA};

pub const COMMAND_STATUS: u64 = 1;
pub const COMMAND_STOP: u64 = 2;
/// Checks `policy` and puts it into the cell's catalogue; the reply names its id.
pub const COMMAND_IMPORT: u64 = 3;
/// Makes the policy `policy_id` the active one, at `at`; the reply comes when it is applied.
pub const COMMAND_ACTIVATE: u64 = 4;
/// Serves the active policy in every rollout and ignores the learner.
pub const COMMAND_PIN: u64 = 5;
pub const COMMAND_UNPIN: u64 = 6;
/// Activates the policy that was active before, else the last good one, at `at`.
pub const COMMAND_ROLLBACK: u64 = 7;
/// The policy `policy_id` may not be activated any more, or may again.
pub const COMMAND_FORBID: u64 = 8;
pub const COMMAND_ALLOW: u64 = 9;
/// Ends the hold after a latched fault, if its cause is gone.
pub const COMMAND_REARM: u64 = 10;
/// Holds the arm where it is, until it is re-armed.
pub const COMMAND_HOLD: u64 = 11;
/// Moves the posture that the null space is drawn to by `posture` within `duration_s`; the reply comes when
/// the loop has it.
pub const COMMAND_POSTURE: u64 = 12;

/// Values of [`Command::at`].
pub const AT_NEXT_ROLLOUT: u64 = 0;
pub const AT_NOW: u64 = 1;

/// Values of [`Reply::accepted`]: not carried out; carried out; sent to another machine, which did not say.
pub const REFUSED: u64 = 0;
pub const ACCEPTED: u64 = 1;
pub const UNKNOWN: u64 = 2;

/// `policy_id` of the last good policy, whatever its number.
pub const LAST_GOOD: u64 = 0;

message! {
    /// A request; `id` is drawn at random by the client, so that a repeated request is recognised.
    pub struct Command as "skillet/Command/3" {
        pub schema: u64,
        pub id: u64,
        /// `COMMAND_*`.
        pub kind: u64,
        /// Number in the cell's catalogue, or [`LAST_GOOD`].
        pub policy_id: u64,
        /// `AT_*`.
        pub at: u64,
        /// Offset of every joint from the start posture, rad, and how long the move takes, s; 0: as long as
        /// it needs. Read by [`COMMAND_POSTURE`] only.
        pub posture: [f64; MAX_JOINTS],
        pub duration_s: f64,
        /// Read by an import only.
        pub policy: PolicyMsg,
    }
}

/// What a command asks for, in a log.
pub fn command_name(kind: u64) -> &'static str {
    match kind {
        COMMAND_STATUS => "status",
        COMMAND_STOP => "stop",
        COMMAND_IMPORT => "policy import",
        COMMAND_ACTIVATE => "policy activate",
        COMMAND_PIN => "policy pin",
        COMMAND_UNPIN => "policy unpin",
        COMMAND_ROLLBACK => "policy rollback",
        COMMAND_FORBID => "policy forbid",
        COMMAND_ALLOW => "policy allow",
        COMMAND_REARM => "rearm",
        COMMAND_HOLD => "hold",
        COMMAND_POSTURE => "posture",
        _ => "unknown",
    }
}

/// What paces the loop: the simulation, the wall clock, the samples of a plant in another process.
pub const PACE_MAX: u64 = 0;
pub const PACE_REALTIME: u64 = 1;
pub const PACE_PLANT: u64 = 2;

pub const PLANT_BUILT_IN: u64 = 0;
pub const PLANT_THERE: u64 = 1;
pub const PLANT_ABSENT: u64 = 2;

message! {
    /// State of the controller when it answered. Times in ns; percentiles since its start.
    pub struct Status as "skillet/Status/7" {
        pub boot_id: u64,
        pub tick: u64,
        pub phase: u64,
        pub fault: u64,
        /// The hardware fault that holds the arm until it is re-armed, or 0; for how long; 1 while its
        /// cause is there.
        pub latched_fault: u64,
        pub latched_ns: u64,
        pub latched_present: u64,
        /// `PLANT_BUILT_IN`, or whether the one in another process has come.
        pub plant: u64,
        pub equipment: Equipment,
        /// Flight records in the state folder.
        pub fault_records: u64,
        pub period_ns: u64,
        /// `PACE_*`.
        pub pace: u64,
        /// 1: the loop has real-time priority.
        pub privileged: u64,
        /// Policy in the loop, or the last one that was, and since when it was applied.
        pub in_loop: PolicyName,
        pub applied_tick: u64,
        /// Policy that is served when pinned or when no learner is there; digest 0: none.
        pub active: PolicyName,
        pub last_good: PolicyName,
        pub pinned: u64,
        /// 1: the pin is that of an earlier run, and nobody has said anything about it since.
        pub pin_restored: u64,
        /// Where the null space is drawn to in served rollouts: offset from the start posture, rad, reached
        /// within so long, s.
        pub posture: [f64; MAX_JOINTS],
        pub posture_s: f64,
        /// Policies in the catalogue.
        pub imported: u64,
        /// Rollouts that a learner asked for, and others.
        pub rollouts_done: u64,
        pub rollouts_served: u64,
        /// Commanded swaps that were applied; of these, read back damaged (never, it is hoped).
        pub swaps_applied: u64,
        pub swaps_torn: u64,
        /// Policies refused by admission, and commands refused for any reason.
        pub policies_refused: u64,
        pub commands_refused: u64,
        /// Ways back to an earlier policy: by a command, or after a fault by itself.
        pub rollbacks: u64,
        /// Writes of the cell's state that failed.
        pub state_errors: u64,
        /// Episodes in the spool, on disk until the learner holds them durable; 1 when it is full and
        /// learning pauses.
        pub spooled: u64,
        pub spool_full: u64,
        /// Episodes sent whose durability the learner has not confirmed.
        pub unacknowledged: u64,
        /// Age of the learner's last heartbeat; `u64::MAX` without a learner: none was ever seen, or it
        /// ended cleanly.
        pub learner_age_ns: u64,
        /// For how long a learner has been in the cell that was not heard; `u64::MAX` without one.
        pub learner_mute_ns: u64,
        /// What the learner waits for: `telemetry::WAITS_*`.
        pub learner_waits: u64,
        /// How often the loop stood still, for how long at most and the last time, and how long ago that
        /// ended; `u64::MAX` when it never did.
        pub stalls: u64,
        pub stall_longest_ns: u64,
        pub stall_last_ns: u64,
        pub stall_age_ns: u64,
        /// In real time: since the loop's last tick was seen.
        pub tick_age_ns: u64,
        pub deadline_misses: u64,
        pub wakeup_p50_ns: u64,
        pub wakeup_p99_ns: u64,
        pub wakeup_max_ns: u64,
        pub tick_p50_ns: u64,
        pub tick_p99_ns: u64,
        pub tick_max_ns: u64,
    }
}

message! {
    /// The answer to a command.
    pub struct Reply as "skillet/Reply/4" {
        pub schema: u64,
        pub id: u64,
        /// [`ACCEPTED`] when the command was understood and carried out, else [`REFUSED`] or [`UNKNOWN`].
        pub accepted: u64,
        /// For an import, its id. For a swap, the policy, the first tick in which no other policy acts, and
        /// when that tick began on the monotonic clock, ns; at the latest, if the reply came through a bridge.
        /// For a posture, the first tick that uses it.
        pub policy: PolicyName,
        pub applied_tick: u64,
        pub applied_ns: u64,
        /// Why it was refused: UTF-8, filled up with zeros.
        pub reason: [u8; REASON_LEN],
        /// Machine of the controller where a bridge lies between, else [`NO_HOST`].
        pub via: [u8; HOST_LEN],
        pub status: Status,
    }
}

/// Why a command was refused before it was looked at.
#[derive(Debug, Error, PartialEq)]
pub enum CommandError {
    #[error(
        "schema {found:#x} instead of {SCHEMA:#x}: tool and controller are different builds; use one"
    )]
    Schema { found: u64 },
    #[error("command kind {0} is unknown to this controller; update it")]
    Kind(u64),
    #[error("at is {0}: use {AT_NEXT_ROLLOUT} (next rollout) or {AT_NOW} (now)")]
    At(u64),
}

impl Command {
    /// A command of `kind` about no policy.
    pub fn new(kind: u64, id: u64) -> Command {
        Command {
            schema: SCHEMA,
            id,
            kind,
            policy_id: LAST_GOOD,
            at: AT_NEXT_ROLLOUT,
            posture: [0.0; MAX_JOINTS],
            duration_s: 0.0,
            policy: PolicyMsg::EMPTY,
        }
    }

    /// Everything but policy and posture, which are admission's matter.
    pub fn validate(&self) -> Result<(), CommandError> {
        if self.schema != SCHEMA {
            return Err(CommandError::Schema { found: self.schema });
        }
        if !(COMMAND_STATUS..=COMMAND_POSTURE).contains(&self.kind) {
            return Err(CommandError::Kind(self.kind));
        }
        if self.at > AT_NOW {
            return Err(CommandError::At(self.at));
        }
        Ok(())
    }
}

impl Reply {
    /// An accepted command with nothing more to say.
    pub fn accepted(id: u64, status: Status) -> Reply {
        Reply {
            schema: SCHEMA,
            id,
            accepted: ACCEPTED,
            policy: PolicyName::NONE,
            applied_tick: 0,
            applied_ns: 0,
            reason: NO_REASON,
            via: NO_HOST,
            status,
        }
    }

    /// A refused one; a reason that is too long loses its end.
    pub fn refused(id: u64, status: Status, reason: &str) -> Reply {
        Reply { accepted: REFUSED, reason: text::pack(reason), ..Reply::accepted(id, status) }
    }

    /// One of which nobody can say whether it was carried out.
    pub fn unknown(id: u64, status: Status, reason: &str) -> Reply {
        Reply { accepted: UNKNOWN, ..Reply::refused(id, status, reason) }
    }

    /// The machine behind a bridge that it came from.
    pub fn via(&self) -> Option<String> {
        text::host(&self.via)
    }

    /// What a person reads.
    pub fn reason_text(&self) -> String {
        text::unpack(&self.reason)
    }
}

impl Status {
    pub const ZERO: Status = Status {
        boot_id: 0,
        tick: 0,
        phase: 0,
        fault: 0,
        latched_fault: 0,
        latched_ns: 0,
        latched_present: 0,
        plant: PLANT_BUILT_IN,
        equipment: Equipment::UNKNOWN,
        fault_records: 0,
        period_ns: 0,
        pace: PACE_MAX,
        privileged: 0,
        in_loop: PolicyName::NONE,
        applied_tick: 0,
        active: PolicyName::NONE,
        last_good: PolicyName::NONE,
        pinned: 0,
        pin_restored: 0,
        posture: [0.0; MAX_JOINTS],
        posture_s: 0.0,
        imported: 0,
        rollouts_done: 0,
        rollouts_served: 0,
        swaps_applied: 0,
        swaps_torn: 0,
        policies_refused: 0,
        commands_refused: 0,
        rollbacks: 0,
        state_errors: 0,
        spooled: 0,
        spool_full: 0,
        unacknowledged: 0,
        learner_age_ns: u64::MAX,
        learner_mute_ns: u64::MAX,
        learner_waits: 0,
        stalls: 0,
        stall_longest_ns: 0,
        stall_last_ns: 0,
        stall_age_ns: u64::MAX,
        tick_age_ns: 0,
        deadline_misses: 0,
        wakeup_p50_ns: 0,
        wakeup_p99_ns: 0,
        wakeup_max_ns: 0,
        tick_p50_ns: 0,
        tick_p99_ns: 0,
        tick_max_ns: 0,
    };

    /// By a clock, whose deadlines can be missed.
    pub fn is_paced(&self) -> bool {
        self.pace != PACE_MAX
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refuses_unknown_kinds_and_other_builds() {
        let status = Command::new(COMMAND_STATUS, 1);
        assert_eq!(status.validate(), Ok(()));
        assert_eq!(Command { kind: 99, ..status }.validate(), Err(CommandError::Kind(99)));
        assert_eq!(Command { kind: 0, ..status }.validate(), Err(CommandError::Kind(0)));
        assert_eq!(Command { at: 2, ..status }.validate(), Err(CommandError::At(2)));
        let old = Command { schema: 3, ..status };
        assert_eq!(old.validate(), Err(CommandError::Schema { found: 3 }));
    }

    #[test]
    fn a_refusal_has_a_reason() {
        assert_eq!(Reply::refused(1, Status::ZERO, "no").reason_text(), "no");
        assert_eq!(Reply::accepted(1, Status::ZERO).reason_text(), "");
    }
}
