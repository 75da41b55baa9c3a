//! The answer to a turn: what is durable, what the learner asks for, and how it is.
//!
//! ```text
//! magic, version, schema | AnswerHead | PolicyMsg   (where there is a newer one than the cell has)
//! ```

use shm_types::SCHEMA;
use shm_types::episode::Ack;
use shm_types::policy::PolicyMsg;
use shm_types::telemetry::Heartbeat;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

use crate::turn::{MessageError, Prefix, Seen};

/// Values of [`AnswerHead::verdict`]: the turn had no episode.
pub const VERDICT_NONE: u64 = 0;
/// The learner has acknowledged the episode.
pub const VERDICT_DURABLE: u64 = 1;
/// The learner has asked for a rollout again, so that the controller sends what it executed.
pub const VERDICT_ASKED_AGAIN: u64 = 2;
/// The learner has not acknowledged it so far. Hand it in again.
pub const VERDICT_PENDING: u64 = 3;
/// The learner works on another session. The episode stays where the controller keeps it.
pub const VERDICT_FOREIGN: u64 = 4;

/// The longest answer, bytes.
pub const MAX_ANSWER: usize =
    size_of::<Prefix>() + size_of::<AnswerHead>() + size_of::<PolicyMsg>();

/// What a hub says in every answer.
#[derive(Clone, Copy, Debug, PartialEq, IntoBytes, FromBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct AnswerHead {
    /// `VERDICT_*`, of the episode in the turn.
    pub verdict: u64,
    /// Session of the learner, or 0 while it has said nothing.
    pub session: u64,
    /// 1: the learner is heard.
    pub learner_is_there: u64,
    /// Its newest heartbeat; `schema` 0 before the first.
    pub learner: Heartbeat,
    /// Its newest acknowledgement; `schema` 0 before the first.
    pub ack: Ack,
    /// What the cell has seen with this answer.
    pub seen: Seen,
    /// 1: a policy follows.
    pub has_policy: u64,
}

/// An answer that was received and checked.
#[derive(Debug, PartialEq)]
pub struct Answer {
    pub head: AnswerHead,
    pub policy: Option<Box<PolicyMsg>>,
}

impl AnswerHead {
    pub fn encode(&self, policy: Option<&PolicyMsg>) -> Vec<u8> {
        let head = AnswerHead { has_policy: u64::from(policy.is_some()), ..*self };
        let mut bytes = Vec::with_capacity(MAX_ANSWER);
        bytes.extend_from_slice(Prefix::OURS.as_bytes());
        bytes.extend_from_slice(head.as_bytes());
        bytes.extend(policy.iter().flat_map(|policy| policy.as_bytes()));
        bytes
    }
}

impl Answer {
    /// Reads an answer and checks everything of it, the policy with its digest.
    pub fn decode(bytes: &[u8]) -> Result<Answer, MessageError> {
        let length = MessageError::Length { len: bytes.len() };
        let rest = Prefix::take(bytes)?;
        let Ok((head, rest)) = AnswerHead::read_from_prefix(rest) else { return Err(length) };
        let is_ours = |schema: u64| schema == 0 || schema == SCHEMA;
        if !is_ours(head.ack.schema) || !is_ours(head.learner.schema) {
            return Err(MessageError::Schema { found: head.ack.schema.max(head.learner.schema) });
        }
        if !head.learner.equipment.is_valid() {
            return Err(MessageError::Text);
        }
        let policy = match head.has_policy {
            0 if rest.is_empty() => None,
            1 => {
                let Ok(policy) = PolicyMsg::read_from_bytes(rest) else { return Err(length) };
                policy.validate()?;
                Some(Box::new(policy))
            }
            _ => return Err(length),
        };
        Ok(Answer { head, policy })
    }

    pub fn ack(&self) -> Option<Ack> {
        (self.head.ack.schema == SCHEMA).then_some(self.head.ack)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn head() -> AnswerHead {
        AnswerHead {
            verdict: VERDICT_DURABLE,
            session: 3,
            learner_is_there: 1,
            learner: Heartbeat { schema: SCHEMA, boot_id: 1, counter: 2, ..Heartbeat::NONE },
            ack: Ack { schema: SCHEMA, session: 3, durable_rollout: 1, rollout: 1, success: 1 },
            seen: Seen { hub: 1, policy: 2, ack: 3 },
            has_policy: 0,
        }
    }

    #[test]
    fn an_answer_comes_back_and_a_cut_one_is_none() {
        assert_eq!(Answer::decode(&head().encode(None)), Ok(Answer { head: head(), policy: None }));
        let policy = PolicyMsg::of_action(&[0.5, -0.5]).sealed();
        let bytes = head().encode(Some(&policy));
        assert_eq!(*Answer::decode(&bytes).unwrap().policy.unwrap(), policy);
        for len in (0..bytes.len()).step_by(7) {
            assert!(Answer::decode(&bytes[..len]).is_err(), "cut at {len}");
        }
    }

    #[test]
    fn a_policy_that_was_changed_on_the_way_is_refused() {
        let policy = PolicyMsg::of_action(&[0.5, -0.5]).sealed();
        let changed = PolicyMsg { duration_s: 2.0, ..policy };
        assert!(matches!(
            Answer::decode(&head().encode(Some(&changed))),
            Err(MessageError::Policy(_))
        ));
    }
}
