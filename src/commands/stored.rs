//! What commands about a session begin with: its database, and which of its rollouts is shown.

use std::path::Path;

use anyhow::{Context, Result};
use learner::store::{Store, TrialRecord};
use learner::summary::Summary;
use learner::wish::Wish;

/// The rollout shown as "learnt": the best success as it is wished for now, or the best reward when there is
/// none.
pub fn best(trials: &[TrialRecord], wish: Option<&Wish>) -> u64 {
    let is_as_wished = |t: &&TrialRecord| wish.is_none_or(|wish| wish.holds(&t.measures));
    let caught: Vec<TrialRecord> =
        trials.iter().filter(|t| t.judged_success).filter(is_as_wished).cloned().collect();
    let candidates = if caught.is_empty() { trials } else { &caught };
    Summary::of(candidates).best_rollout.unwrap_or(1)
}

/// Opens the session's database; the error names the session.
pub fn open(dir: &Path, database: &Path) -> Result<Store> {
    Store::open(database).with_context(|| format!("session {}", dir.display()))
}
