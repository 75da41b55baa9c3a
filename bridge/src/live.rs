//! What observers on the learner's machine see of a loop that is elsewhere: some of its ticks, policies and outcomes.
//!
//! ```text
//! magic, version, schema | LiveHead | TelemetryTick, PolicyMsg or EpisodeHeader
//! ```
//!
//! All of it may be lost, and nothing waits for it: it goes over a publication of its own, behind everything else.

use shm_types::episode::{EpisodeHeader, MAX_RECORDS};
use shm_types::policy::PolicyMsg;
use shm_types::telemetry::TelemetryTick;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

use crate::message::{MessageError, Prefix};

/// Ticks a second, at most and if nothing else is said. A controller sends its ticks in batches of 20.
pub const MAX_HZ: u64 = 50;

const KIND_TICK: u64 = 1;
const KIND_POLICY: u64 = 2;
const KIND_OUTCOME: u64 = 3;

/// What is said with each.
#[derive(Clone, Copy, Debug, PartialEq, IntoBytes, FromBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct LiveHead {
    /// Start of the bridge: the hub takes nothing from another one than the one that has joined.
    pub bridge: u64,
    /// Ticks a second that it sends at most.
    pub hz: u64,
    kind: u64,
}

/// One thing that was seen.
#[derive(Debug, PartialEq)]
pub enum Live {
    Tick(Box<TelemetryTick>),
    /// It goes into the loop.
    Policy(Box<PolicyMsg>),
    /// A rollout that has ended.
    Outcome(Box<EpisodeHeader>),
}

impl Live {
    pub fn encode(&self, bridge: u64, hz: u64) -> Vec<u8> {
        let (kind, body) = match self {
            Live::Tick(tick) => (KIND_TICK, tick.as_bytes()),
            Live::Policy(policy) => (KIND_POLICY, policy.as_bytes()),
            Live::Outcome(header) => (KIND_OUTCOME, header.as_bytes()),
        };
        [Prefix::OURS.as_bytes(), LiveHead { bridge, hz, kind }.as_bytes(), body].concat()
    }

    /// Reads a message and checks everything of it.
    pub fn decode(bytes: &[u8]) -> Result<(LiveHead, Live), MessageError> {
        let length = MessageError::Length { len: bytes.len() };
        let rest = Prefix::take(bytes)?;
        let Ok((head, rest)) = LiveHead::read_from_prefix(rest) else { return Err(length) };
        if !(1..=MAX_HZ).contains(&head.hz) {
            return Err(MessageError::Value("hz"));
        }
        let live = match head.kind {
            KIND_TICK => {
                let Ok(tick) = TelemetryTick::read_from_bytes(rest) else { return Err(length) };
                if !tick.record.is_finite() {
                    return Err(MessageError::Value("tick"));
                }
                Live::Tick(Box::new(tick))
            }
            KIND_POLICY => {
                let Ok(policy) = PolicyMsg::read_from_bytes(rest) else { return Err(length) };
                policy.validate()?;
                Live::Policy(Box::new(policy))
            }
            KIND_OUTCOME => {
                let Ok(header) = EpisodeHeader::read_from_bytes(rest) else { return Err(length) };
                if header.n_records > MAX_RECORDS as u64 {
                    return Err(MessageError::Value("n_records"));
                }
                EpisodeHeader { n_records: 0, ..header }.validate(&[])?;
                Live::Outcome(Box::new(header))
            }
            _ => return Err(MessageError::Value("kind")),
        };
        Ok((head, live))
    }
}

#[cfg(test)]
mod tests {
    use shm_types::episode::TickRecord;

    use super::*;

    fn all() -> [Live; 3] {
        let record = TickRecord { tick: 7, t_s: 1.0 / 3.0, ..TickRecord::ZERO };
        let header = EpisodeHeader { rollout: 3, n_records: 4000, ..Default::default() };
        [
            Live::Tick(Box::new(TelemetryTick { record, ..TelemetryTick::ZERO })),
            Live::Policy(Box::new(PolicyMsg::of_action(&[0.5, -0.5]).sealed())),
            Live::Outcome(Box::new(header)),
        ]
    }

    #[test]
    fn what_was_seen_comes_back_and_a_cut_one_is_none() {
        for live in all() {
            let bytes = live.encode(9, 50);
            let (head, again) = Live::decode(&bytes).unwrap();
            assert_eq!((head.bridge, head.hz, &again), (9, 50, &live));
            for len in (0..bytes.len()).step_by(5) {
                assert!(Live::decode(&bytes[..len]).is_err(), "cut at {len}");
            }
            assert!(Live::decode(&[bytes, vec![0]].concat()).is_err(), "one byte more");
        }
    }

    #[test]
    fn what_no_observer_must_see_is_refused() {
        let [tick, policy, outcome] = all();
        for hz in [0, MAX_HZ + 1] {
            assert_eq!(Live::decode(&tick.encode(9, hz)), Err(MessageError::Value("hz")));
        }
        let record = TickRecord { t_s: f64::NAN, ..TickRecord::ZERO };
        let endless = Live::Tick(Box::new(TelemetryTick { record, ..TelemetryTick::ZERO }));
        assert_eq!(Live::decode(&endless.encode(9, 1)), Err(MessageError::Value("tick")));
        let mut bytes = policy.encode(9, 1);
        bytes[200] ^= 1;
        assert!(matches!(Live::decode(&bytes), Err(MessageError::Policy(_))), "its digest");
        let header = EpisodeHeader { n_records: 4001, ..Default::default() };
        let long = Live::Outcome(Box::new(header)).encode(9, 1);
        assert_eq!(Live::decode(&long), Err(MessageError::Value("n_records")));
        let mut old = outcome.encode(9, 1);
        old[8] ^= 0xff;
        assert!(matches!(Live::decode(&old), Err(MessageError::Version { .. })));
    }
}
