//! The answer to a turn: what is durable, what the learner asks for, and how it is.
//!
//! ```text
//! magic, version, schema | AnswerHead | PolicyMsg   (where there is a newer one than the cell has)
//!                                     | Command     (where a tool has one for the cell's controller)
//! ```

use shm_types::SCHEMA;
use shm_types::command::Command;
use shm_types::policy::PolicyMsg;
use shm_types::telemetry::Heartbeat;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

use crate::acks::Acks;
use crate::command::check_command;
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
    size_of::<Prefix>() + size_of::<AnswerHead>() + size_of::<PolicyMsg>() + size_of::<Command>();

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
    /// What it has acknowledged.
    pub acks: Acks,
    /// What the cell has seen with this answer.
    pub seen: Seen,
    /// 1: somebody looks at the loop from there.
    pub watched: u64,
    /// 1: a policy follows.
    pub has_policy: u64,
    /// The number of the command that follows, or 0.
    pub command: u64,
}

/// An answer that was received and checked.
#[derive(Debug, PartialEq)]
pub struct Answer {
    pub head: AnswerHead,
    pub policy: Option<Box<PolicyMsg>>,
    pub command: Option<Box<Command>>,
}

impl AnswerHead {
    /// The answer as bytes; `command` has its number.
    pub fn encode(&self, policy: Option<&PolicyMsg>, command: Option<(u64, &Command)>) -> Vec<u8> {
        let has_policy = u64::from(policy.is_some());
        let number = command.map_or(0, |(number, _)| number);
        let head = AnswerHead { has_policy, command: number, ..*self };
        let mut bytes = Vec::with_capacity(MAX_ANSWER);
        bytes.extend_from_slice(Prefix::OURS.as_bytes());
        bytes.extend_from_slice(head.as_bytes());
        bytes.extend(policy.iter().flat_map(|policy| policy.as_bytes()));
        bytes.extend(command.iter().flat_map(|(_, command)| command.as_bytes()));
        bytes
    }
}

impl Answer {
    /// Reads an answer and checks everything of it, policies with their digests.
    pub fn decode(bytes: &[u8]) -> Result<Answer, MessageError> {
        let length = MessageError::Length { len: bytes.len() };
        let rest = Prefix::take(bytes)?;
        let Ok((head, rest)) = AnswerHead::read_from_prefix(rest) else { return Err(length) };
        let mut schemas = head.acks.schemas().chain([head.learner.schema]);
        if let Some(found) = schemas.find(|schema| ![0, SCHEMA].contains(schema)) {
            return Err(MessageError::Schema { found });
        }
        if !head.learner.equipment.is_valid() {
            return Err(MessageError::Text);
        }
        let (policy, rest) = match head.has_policy {
            0 => (None, rest),
            1 => {
                let Ok((policy, rest)) = PolicyMsg::read_from_prefix(rest) else {
                    return Err(length);
                };
                policy.validate()?;
                (Some(Box::new(policy)), rest)
            }
            _ => return Err(length),
        };
        let command = match head.command {
            0 if rest.is_empty() => None,
            0 => return Err(length),
            _ => {
                let Ok(command) = Command::read_from_bytes(rest) else { return Err(length) };
                check_command(&command)?;
                Some(Box::new(command))
            }
        };
        Ok(Answer { head, policy, command })
    }
}

#[cfg(test)]
mod tests {
    use shm_types::command::{COMMAND_HOLD, COMMAND_STOP};
    use shm_types::episode::Ack;

    use super::*;

    fn head() -> AnswerHead {
        let mut acks = Acks::NONE;
        acks.take(Ack { schema: SCHEMA, session: 3, durable_rollout: 1, rollout: 1, success: 1 });
        AnswerHead {
            verdict: VERDICT_DURABLE,
            session: 3,
            learner_is_there: 1,
            learner: Heartbeat { schema: SCHEMA, boot_id: 1, counter: 2, ..Heartbeat::NONE },
            acks,
            seen: Seen { hub: 1, policy: 2, ack: 3 },
            watched: 1,
            has_policy: 0,
            command: 0,
        }
    }

    #[test]
    fn an_answer_comes_back_and_a_cut_one_is_none() {
        let bare = Answer::decode(&head().encode(None, None));
        assert_eq!(bare, Ok(Answer { head: head(), policy: None, command: None }));
        let policy = PolicyMsg::of_action(&[0.5, -0.5]).sealed();
        let hold = Command::new(COMMAND_HOLD, 7);
        let bytes = head().encode(Some(&policy), Some((3, &hold)));
        let answer = Answer::decode(&bytes).unwrap();
        assert_eq!((*answer.policy.unwrap(), *answer.command.unwrap()), (policy, hold));
        assert_eq!((answer.head.command, bytes.len()), (3, MAX_ANSWER));
        assert_eq!(
            *Answer::decode(&head().encode(None, Some((3, &hold)))).unwrap().command.unwrap(),
            hold
        );
        for len in (0..bytes.len()).step_by(7) {
            assert!(Answer::decode(&bytes[..len]).is_err(), "cut at {len}");
        }
    }

    #[test]
    fn a_policy_that_was_changed_on_the_way_is_refused() {
        let policy = PolicyMsg::of_action(&[0.5, -0.5]).sealed();
        let changed = PolicyMsg { duration_s: 2.0, ..policy };
        assert!(matches!(
            Answer::decode(&head().encode(Some(&changed), None)),
            Err(MessageError::Policy(_))
        ));
    }

    #[test]
    fn a_command_that_is_not_for_other_machines_is_refused() {
        let stop = Command::new(COMMAND_STOP, 7);
        let bytes = head().encode(None, Some((1, &stop)));
        assert_eq!(Answer::decode(&bytes), Err(MessageError::Value("kind")));
    }
}
