//! What happened on all hosts so far.

use std::collections::BTreeMap;
use std::time::Duration;

use super::super::tally::RoleTally;
use super::books::Books;
use super::fleet::Part;
use super::script::Kill;
use super::wan::{Counts, Cut};
use super::witness::Alone;

/// A cut that lasts longer outlives the lease of a rollout.
const LEASE: Duration = Duration::from_secs(30);

#[derive(Clone, Debug, Default)]
pub struct NetTally {
    parts: BTreeMap<&'static str, RoleTally>,
    pub kills: BTreeMap<&'static str, u64>,
    /// Cuts of less and of more than a lease, and how many of all were in one direction only.
    pub short_cuts: u64,
    pub long_cuts: u64,
    pub one_way: u64,
    pub cut_for: Duration,
    pub alone: Alone,
    pub books: Books,
    /// Sessions that were resumed after the end for episodes that were still in a spool, and how many of these are there
    /// nevertheless.
    pub resumed: u64,
    pub in_spools: u64,
    pub packets: Counts,
}

impl NetTally {
    pub fn part(&mut self, part: Part) -> &mut RoleTally {
        self.parts.entry(part.name()).or_default()
    }

    pub fn parts(&self) -> impl Iterator<Item = (&'static str, &RoleTally)> {
        self.parts.iter().map(|(name, tally)| (*name, tally))
    }

    pub fn killed(&mut self, kill: Kill) {
        *self.kills.entry(kill.name()).or_default() += 1;
    }

    pub fn was_cut(&mut self, cut: Cut, lasted: Duration) {
        *(if lasted > LEASE { &mut self.long_cuts } else { &mut self.short_cuts }) += 1;
        self.one_way += u64::from(cut != Cut::Both);
        self.cut_for += lasted;
    }

    pub fn line(&self, sessions: u64, trials: u64) -> String {
        let kills: u64 = self.kills.values().sum();
        format!(
            "{kills} kills, {} cuts ({} beyond a lease), {sessions} sessions done, {trials} trials in this one; {} cells \
             seen going on alone",
            self.short_cuts + self.long_cuts,
            self.long_cuts,
            self.alone.went_on,
        )
    }
}
