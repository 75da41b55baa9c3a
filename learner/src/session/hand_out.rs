//! Which rollout a free cell is asked for: one of its own, one that nobody executes, or a new one.
//!
//! A rollout in flight was given to a cell, durably, before that cell was asked. A learner that resumes may find it
//! executed there, in the spool: until the lease is over, no other cell is asked for it.

use std::collections::BTreeSet;
use std::time::Instant;

use shm_types::policy::PolicyMsg;

use super::link::Link;
use super::{ROLLOUT, Session, SessionError};
use crate::learner::Learner;

/// Rollouts that an earlier run gave to cells of this session.
pub(super) struct Held {
    rollouts: BTreeSet<u64>,
    until: Instant,
}

impl Held {
    pub fn of(learner: &Learner, links: &[Link]) -> Held {
        let is_there = |cell: &str| links.iter().any(|link| link.name() == cell);
        let in_flight = learner.in_flight().map(|policy| policy.rollout);
        let rollouts = in_flight.filter(|&rollout| learner.given_to(rollout).is_some_and(is_there));
        Held { rollouts: rollouts.collect(), until: Instant::now() + ROLLOUT }
    }

    fn has(&self, rollout: u64) -> bool {
        self.rollouts.contains(&rollout) && Instant::now() < self.until
    }
}

impl Session<'_> {
    /// Asks every cell that is free for a rollout; `None` when stopped.
    pub(super) fn hand_out(&mut self, may_ask: bool) -> Result<Option<()>, SessionError> {
        for k in 0..self.links.len() {
            if !self.is_free(k) {
                continue;
            }
            let cell = self.links[k].name().to_string();
            let policy = match self.left_over(k, may_ask) {
                Some(policy) => {
                    let give = |learner: &mut Learner| learner.give(policy.rollout, &cell);
                    match self.stored(give)? {
                        Some(()) => policy,
                        None => return Ok(None),
                    }
                }
                None if may_ask => match self.stored(|learner| learner.another_policy(&cell))? {
                    Some(Some(policy)) => policy,
                    Some(None) => continue, // all of them are asked for
                    None => return Ok(None),
                },
                None => continue,
            };
            self.held.rollouts.remove(&policy.rollout);
            self.links[k].ask(policy)?;
        }
        Ok(Some(()))
    }

    /// A rollout in flight that no cell was asked for, for cell `k`: one that it was given, then one that was
    /// left by its cell. Before people are heard only what must come back first.
    fn left_over(&self, k: usize, may_ask: bool) -> Option<PolicyMsg> {
        let trials = self.learner.trials();
        let is_awaited = |rollout| trials.iter().any(|trial| trial.rollout > rollout);
        let is_asked = |rollout| self.links.iter().any(|link| link.has(rollout));
        let is_open = |rollout| !is_asked(rollout) && (may_ask || is_awaited(rollout));
        let in_flight = self.learner.in_flight().map(|policy| policy.rollout);
        let open: Vec<u64> = in_flight.filter(|&rollout| is_open(rollout)).collect();
        let is_of =
            |k: usize, rollout| self.learner.given_to(rollout) == Some(self.links[k].name());
        // Another cell that is free takes its own in a moment.
        let is_others = |rollout| {
            let mut others = (0..self.links.len()).filter(|&other| other != k);
            others.any(|other| is_of(other, rollout) && self.is_free(other))
        };
        let is_left = |rollout| !self.held.has(rollout) && !is_others(rollout);
        let own = open.iter().find(|&&rollout| is_of(k, rollout));
        let rollout = *own.or_else(|| open.iter().find(|&&rollout| is_left(rollout)))?;
        self.learner.in_flight().find(|policy| policy.rollout == rollout).copied()
    }

    /// Cell `k` can be asked for a rollout. The only one waits for its turn; among several, those are asked that
    /// can execute it at once.
    fn is_free(&self, k: usize) -> bool {
        let link = &self.links[k];
        let is_alone = self.links.len() == 1;
        let has_rested = link.rests_until.is_none_or(|until| Instant::now() >= until);
        let is_open = link.asked.is_none() && link.is_met() && !link.is_retired;
        is_open && (is_alone || (link.is_able() && has_rested))
    }
}
