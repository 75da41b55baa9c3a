//! The episode: what one rollout did, as a slice of tick records behind a header.

#[cfg(feature = "transport")]
use iceoryx2::prelude::ZeroCopySend;
use thiserror::Error;
use zerocopy::{FromBytes, IntoBytes};

use crate::equipment::Equipment;
use crate::measures::{Measures, MeasuresError};
use crate::policy::PolicyName;
use crate::text::{self, NO_REASON, REASON_LEN};
use crate::{MAX_JOINTS, SCHEMA, TASK_DIM};

/// Longest rollout, in ticks: 4 s at 1 kHz.
pub const MAX_RECORDS: usize = 4000;

/// Bits of [`TickRecord::flags`].
pub const FLAG_IN_CONTACT: u32 = 1;
pub const FLAG_TORQUE_CLIPPED: u32 = 2;
pub const FLAG_RATE_LIMITED: u32 = 4;
pub const FLAG_NEAR_JOINT_LIMIT: u32 = 8;
pub const FLAG_NEAR_SPEED_LIMIT: u32 = 16;
/// The policy of before a swap still fades out.
pub const FLAG_BLENDING: u32 = 32;

/// Values of [`EpisodeHeader::fault`] that make an episode no trial: the policy was not executed, or
/// not it alone.
pub const FAULT_APPROACH_TIMEOUT: u64 = 6;
pub const FAULT_POLICY_REFUSED: u64 = 7;
/// Another policy was swapped in during the rollout: it tells nothing about either.
pub const FAULT_SWAPPED: u64 = 8;
/// The host could not hold the period; nothing the policy did.
pub const FAULT_OVERRUN: u64 = 9;

/// Hardware faults: they latch, and the rollout is repeated after a re-arm.
pub const FAULT_MEASUREMENT_NOT_FINITE: u64 = 1;
pub const FAULT_MEASUREMENT_STALE: u64 = 10;
pub const FAULT_MEASUREMENT_INCONSISTENT: u64 = 11;
pub const FAULT_UNEXPECTED_FORCE: u64 = 12;
/// A person's doing, which latches like a fault.
pub const FAULT_HELD: u64 = 14;
pub const MACHINE_FAULTS: [u64; 5] = [
    FAULT_MEASUREMENT_NOT_FINITE,
    FAULT_MEASUREMENT_STALE,
    FAULT_MEASUREMENT_INCONSISTENT,
    FAULT_UNEXPECTED_FORCE,
    FAULT_HELD,
];

message! {
    /// One tick of a rollout. Wall-clock timing is not in here: records of equal rollouts are
    /// equal bit for bit.
    pub struct TickRecord as "skillet/TickRecord/1" {
        /// Tick of the controller since its start.
        pub tick: u64,
        /// Phase of the rollout: 0 Idle, 1 Approach, 2 Execute, 3 Settle.
        pub phase: u32,
        /// 0, or why the tick fell back to damped gravity hold.
        pub fault: u32,
        /// Time since the start of Execute, s (0 before).
        pub t_s: f64,
        /// Joint positions rad, speeds rad/s, commanded torques N·m.
        pub q: [f64; MAX_JOINTS],
        pub qd: [f64; MAX_JOINTS],
        pub tau: [f64; MAX_JOINTS],
        /// Task coordinates x and ẋ of the pan: m, rad (rotation vector), world frame.
        pub x: [f64; TASK_DIM],
        pub xd: [f64; TASK_DIM],
        /// Σ hᵢ μᵢ.
        pub attractor: [f64; TASK_DIM],
        /// Tracked object: position m and unit quaternion (w, i, j, k), world frame.
        pub object_position: [f64; 3],
        pub object_quaternion: [f64; 4],
        /// `FLAG_*`.
        pub flags: u32,
        pub reserved: u32,
    }
}

message! {
    /// User header of an episode.
    pub struct EpisodeHeader as "skillet/EpisodeHeader/5" {
        pub schema: u64,
        /// Start of the controller that ran it; with `rollout` it names the episode.
        pub boot_id: u64,
        pub session: u64,
        pub rollout: u64,
        pub policy_id: u64,
        /// Echo of [`crate::policy::PolicyMsg::digest`].
        pub policy_digest: u64,
        /// First tick of Execute: when the policy took effect.
        pub applied_tick: u64,
        /// When that tick began on the monotonic clock, ns.
        pub applied_ns: u64,
        /// Time between two records, ns.
        pub period_ns: u64,
        /// Records in use, from the start of the slice.
        pub n_records: u64,
        /// First fault of the rollout, or 0.
        pub fault: u64,
        /// Why the policy was refused, where it was; see [`crate::text`].
        pub reason: [u8; REASON_LEN],
        /// What only the plant could measure; the rest follows from the records.
        pub measures: Measures,
        /// What executed it.
        pub equipment: Equipment,
    }
}

message! {
    /// Learner → controller: what is durable. A learner with several cells has rollouts in flight elsewhere
    /// that are older than the newest one of this cell.
    pub struct Ack as "skillet/Ack/3" {
        pub schema: u64,
        pub session: u64,
        /// Every rollout of `session` up to this one.
        pub durable_rollout: u64,
        /// And this one, the newest that this cell executed; 0 before the first.
        pub rollout: u64,
        /// 1: that one was a success, as it was judged. Only the learner knows.
        pub success: u64,
    }
}

/// Why an episode was refused.
#[derive(Debug, Error, PartialEq)]
pub enum EpisodeError {
    #[error(
        "schema {found:#x} instead of {SCHEMA:#x}: controller and learner are different builds; restart both from one"
    )]
    Schema { found: u64 },
    #[error(
        "n_records is {n_records}, but the slice holds {len}: the controller is broken or hostile; episode ignored"
    )]
    Length { n_records: u64, len: usize },
    #[error(transparent)]
    Measures(#[from] MeasuresError),
    #[error("record {record} holds a value that is not finite; episode ignored")]
    Record { record: usize },
    #[error("the reason of a refusal is not text; episode ignored")]
    Reason,
    #[error("the name of its task, arm or plant is not text; episode ignored")]
    Equipment,
}

impl TickRecord {
    pub const ZERO: TickRecord = TickRecord {
        tick: 0,
        phase: 0,
        fault: 0,
        t_s: 0.0,
        q: [0.0; MAX_JOINTS],
        qd: [0.0; MAX_JOINTS],
        tau: [0.0; MAX_JOINTS],
        x: [0.0; TASK_DIM],
        xd: [0.0; TASK_DIM],
        attractor: [0.0; TASK_DIM],
        object_position: [0.0; 3],
        object_quaternion: [1.0, 0.0, 0.0, 0.0],
        flags: 0,
        reserved: 0,
    };

    pub fn is_finite(&self) -> bool {
        let joints = self.q.iter().chain(&self.qd).chain(&self.tau);
        let task = self.x.iter().chain(&self.xd).chain(&self.attractor);
        let object = self.object_position.iter().chain(&self.object_quaternion);
        self.t_s.is_finite() && joints.chain(task).chain(object).all(|value| value.is_finite())
    }
}

impl Default for TickRecord {
    fn default() -> Self {
        Self::ZERO
    }
}

impl Default for EpisodeHeader {
    fn default() -> Self {
        EpisodeHeader {
            schema: SCHEMA,
            boot_id: 0,
            session: 0,
            rollout: 0,
            policy_id: 0,
            policy_digest: 0,
            applied_tick: 0,
            applied_ns: 0,
            period_ns: 0,
            n_records: 0,
            fault: 0,
            reason: NO_REASON,
            measures: Measures::NONE,
            equipment: Equipment::UNKNOWN,
        }
    }
}

impl Ack {
    /// What stands for a learner that has sent nothing yet.
    pub const NONE: Ack = Ack { schema: 0, session: 0, durable_rollout: 0, rollout: 0, success: 0 };

    /// This rollout is durable, by what is acknowledged here.
    pub fn covers(&self, session: u64, rollout: u64) -> bool {
        self.session == session && (rollout <= self.durable_rollout || rollout == self.rollout)
    }
}

impl EpisodeHeader {
    /// The policy that was executed, and as which rollout.
    pub fn name(&self) -> PolicyName {
        PolicyName {
            session: self.session,
            rollout: self.rollout,
            policy_id: self.policy_id,
            digest: self.policy_digest,
        }
    }

    /// Appends header and records in use to `bytes`.
    pub fn write(&self, records: &[TickRecord], bytes: &mut Vec<u8>) {
        let n_records = (self.n_records as usize).min(records.len());
        bytes.extend_from_slice(self.as_bytes());
        bytes.extend_from_slice(records[..n_records].as_bytes());
    }

    /// What [`EpisodeHeader::write`] has written, unchecked; `None` if `bytes` are no header with whole records.
    pub fn read(bytes: &[u8]) -> Option<(EpisodeHeader, Vec<TickRecord>)> {
        let (header, rest) = EpisodeHeader::read_from_prefix(bytes).ok()?;
        let is_whole = rest.len().is_multiple_of(size_of::<TickRecord>());
        let mut records = vec![TickRecord::ZERO; rest.len() / size_of::<TickRecord>()];
        is_whole.then(|| records.as_mut_bytes().copy_from_slice(rest))?;
        Some((header, records))
    }

    /// Checks header and records, and returns the records in use.
    pub fn validate<'a>(
        &self,
        records: &'a [TickRecord],
    ) -> Result<&'a [TickRecord], EpisodeError> {
        if self.schema != SCHEMA {
            return Err(EpisodeError::Schema { found: self.schema });
        }
        if !text::is_valid(&self.reason) {
            return Err(EpisodeError::Reason);
        }
        if !self.equipment.is_valid() {
            return Err(EpisodeError::Equipment);
        }
        let used = usize::try_from(self.n_records)
            .ok()
            .and_then(|n| records.get(..n))
            .ok_or(EpisodeError::Length { n_records: self.n_records, len: records.len() })?;
        self.measures.validate()?;
        match used.iter().position(|record| !record.is_finite()) {
            Some(record) => Err(EpisodeError::Record { record }),
            None => Ok(used),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refuses_what_a_receiver_must_not_use() {
        let mut records = vec![TickRecord::ZERO; 3];
        let header = EpisodeHeader { n_records: 2, ..Default::default() };
        assert_eq!(header.validate(&records).map(<[_]>::len), Ok(2));

        let long = EpisodeHeader { n_records: 4, ..header };
        assert_eq!(long.validate(&records), Err(EpisodeError::Length { n_records: 4, len: 3 }));
        let foreign = EpisodeHeader { schema: 7, ..header };
        assert_eq!(foreign.validate(&records), Err(EpisodeError::Schema { found: 7 }));
        let mut unmeasured = header;
        unmeasured.measures.n = 1;
        let error = EpisodeError::Measures(MeasuresError::Name(String::new()));
        assert_eq!(unmeasured.validate(&records), Err(error));
        let mut muttered = header;
        muttered.reason[7] = b'x';
        assert_eq!(muttered.validate(&records), Err(EpisodeError::Reason));
        let mut nameless = header;
        nameless.equipment.plant[0] = 0xff;
        assert_eq!(nameless.validate(&records), Err(EpisodeError::Equipment));
        records[1].tau[6] = f64::INFINITY;
        assert_eq!(header.validate(&records), Err(EpisodeError::Record { record: 1 }));
    }
}
