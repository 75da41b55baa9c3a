//! What happened in a cell so far.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::footprint::Footprint;
use super::ledger::Ledger;
use super::ordeal::{Kill, Ordeal, Role, kill_name};

/// What was done to a role, and how it came back.
#[derive(Clone, Debug, Default)]
pub struct RoleTally {
    pub kills: u64,
    /// Kills within the first moments after the start.
    pub at_start: u64,
    /// From a start until the service did its work: a controller answers, a plant is let in, a learner
    /// has its controller.
    pub restarts: Vec<Duration>,
}

/// Attempts to re-arm.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rearms {
    pub accepted: u64,
    /// The cause was still there, or a moment ago.
    pub refused: u64,
}

impl Rearms {
    pub fn add(&mut self, other: Rearms) {
        self.accepted += other.accepted;
        self.refused += other.refused;
    }
}

#[derive(Clone, Debug, Default)]
pub struct Tally {
    roles: BTreeMap<Role, RoleTally>,
    /// What was killed at once, start-up apart.
    pub kills: BTreeMap<Kill, u64>,
    /// From the kill of a plant until the controller's status said that the arm is held.
    pub holds: Vec<Duration>,
    pub rearms: Rearms,
    pub swaps: u64,
    pub observers: u64,
    /// Processes that watched, stalled or not, and were killed.
    pub observers_killed: u64,
    pub sessions: u64,
    /// Sessions that are not those of an undisturbed run.
    pub different: u64,
    pub ledger: Ledger,
    /// Footprint of a controller that is never killed.
    pub footprint: Footprint,
}

/// What a thread that panicked has counted stays valid.
pub fn locked(tally: &Mutex<Tally>) -> MutexGuard<'_, Tally> {
    tally.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Tally {
    pub fn role(&mut self, role: Role) -> &mut RoleTally {
        self.roles.entry(role).or_default()
    }

    pub fn of(&self, role: Role) -> RoleTally {
        self.roles.get(&role).cloned().unwrap_or_default()
    }

    /// Every kill of `ordeal` has happened `n` times.
    pub fn has_enough(&self, ordeal: Ordeal, n: u64) -> bool {
        ordeal.kills().iter().all(|kill| self.kills.get(kill).is_some_and(|found| *found >= n))
    }

    /// As "3 controller, 2 controller+plant".
    pub fn kills_in_words(&self) -> String {
        let kinds = self.kills.iter().map(|(kill, n)| format!("{n} {}", kill_name(kill)));
        let words = kinds.collect::<Vec<_>>().join(", ");
        if words.is_empty() { "none".into() } else { words }
    }

    pub fn line(&self) -> String {
        format!(
            "kills: {}; {} swaps, {} sessions, {} trials, {} different",
            self.kills_in_words(),
            self.swaps,
            self.sessions,
            self.ledger.learnt,
            self.different
        )
    }
}
