//! Which program judges, and from which rollout on: in the session's diary.

use super::Learner;
use crate::error::LearnerError;
use crate::store::{Store, StoreError};

/// Kind of the event.
const KIND: &str = "judge";

impl Learner {
    /// Writes down the program that judges from here on, where it is another one than before.
    pub(super) fn follow_judge(&mut self) -> Result<(), LearnerError> {
        let Some(identity) = self.judge.identity() else { return Ok(()) };
        let before = judged_by(&self.store)?;
        if before.as_ref() == Some(&identity) {
            return Ok(());
        }
        let next = self.trials.len() as u64 + 1;
        if let Some(before) = before {
            tracing::warn!(
                "the judge has changed: rollouts from {next} on are judged by {identity}, those before by \
                 {before}"
            );
        }
        Ok(self.store.record_event(KIND, &format!("from rollout {next} on: {identity}"))?)
    }
}

/// The program that judged a session last, in the words of its identity; `None` if there was none.
pub fn judged_by(store: &Store) -> Result<Option<String>, StoreError> {
    let events = store.events()?;
    let last = events.iter().rev().find(|event| event.kind == KIND);
    Ok(last.and_then(|event| Some(event.text.split_once(": ")?.1.to_string())))
}
