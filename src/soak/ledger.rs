//! Account of all episodes: the controllers' logs against the session's store.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result};
use learner::store::{Store, TrialRecord};
use serde_json::Value;

/// Log message of a controller when an episode is durable; see `rt-controller/src/disk/spool.rs`.
const DURABLE: &str = "episode is durable";

/// Episodes of the sessions of one cell.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ledger {
    /// Trials stored.
    pub learnt: u64,
    /// Rollouts with an episode that a controller made durable.
    pub produced: u64,
    /// Durable episodes of a rollout beyond its first one.
    pub duplicated: u64,
    /// Durable, but not learnt.
    pub lost: u64,
    /// Learnt from another start of the controller than the one that made it durable.
    pub foreign: u64,
}

impl Ledger {
    pub fn add(&mut self, other: &Ledger) {
        self.learnt += other.learnt;
        self.produced += other.produced;
        self.duplicated += other.duplicated;
        self.lost += other.lost;
        self.foreign += other.foreign;
    }

    /// The ledger of the session in `folder`; `log` is that of all the cell's controllers.
    pub fn of(folder: &Path, log: &Path) -> Result<Ledger> {
        let store = Store::open(&folder.join("session.db"))?;
        let durable = durable_episodes(log, store.meta().session_id)?;
        Ok(Ledger::balance(&durable, &store.trials()?))
    }

    fn balance(durable: &BTreeMap<u64, Vec<u64>>, trials: &[TrialRecord]) -> Ledger {
        let learnt: BTreeMap<u64, u64> = trials.iter().map(|t| (t.rollout, t.boot_id)).collect();
        // A controller that was killed between the disk and its log said nothing.
        let silent = learnt.keys().filter(|rollout| !durable.contains_key(rollout)).count();
        let foreign = |(rollout, boots): &(&u64, &Vec<u64>)| {
            learnt.get(rollout).is_some_and(|boot| !boots.contains(boot))
        };
        Ledger {
            learnt: trials.len() as u64,
            produced: (durable.len() + silent) as u64,
            duplicated: durable.values().map(|boots| boots.len() as u64 - 1).sum(),
            lost: durable.keys().filter(|rollout| !learnt.contains_key(rollout)).count() as u64,
            foreign: durable.iter().filter(foreign).count() as u64,
        }
    }
}

/// Boot ids by rollout.
fn durable_episodes(log: &Path, session_id: u64) -> Result<BTreeMap<u64, Vec<u64>>> {
    let mut durable = BTreeMap::<u64, Vec<u64>>::new();
    for episode in durable_in(log)?.into_iter().filter(|episode| episode.session == session_id) {
        durable.entry(episode.rollout).or_default().push(episode.boot_id);
    }
    Ok(durable)
}

/// An episode that a controller made durable, by its log.
pub struct Durable {
    pub session: u64,
    pub rollout: u64,
    pub boot_id: u64,
    /// As the log has it: times of one length, which sort as text.
    pub at: String,
}

/// Everything that the controllers of a cell made durable.
pub fn durable_in(log: &Path) -> Result<Vec<Durable>> {
    let lines = log_lines(log, DURABLE)?;
    let durable = |line: &Value| {
        let field = |name: &str| line["fields"][name].as_u64();
        let (session, rollout, boot_id) = (field("session")?, field("rollout")?, field("boot_id")?);
        Some(Durable { session, rollout, boot_id, at: time_of(line) })
    };
    Ok(lines.iter().filter_map(durable).collect())
}

/// The lines of a log whose message contains `words`.
pub fn log_lines(log: &Path, words: &str) -> Result<Vec<Value>> {
    let text = std::fs::read_to_string(log).with_context(|| format!("{}", log.display()))?;
    // The last line of a process that was killed may be torn.
    let found = text.lines().filter(|line| line.contains(words));
    Ok(found.filter_map(|line| serde_json::from_str(line).ok()).collect())
}

pub fn time_of(line: &Value) -> String {
    line["timestamp"].as_str().unwrap_or_default().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use search::trial::Trial;
    use shm_types::measures::Measures;

    fn trial(rollout: u64, boot_id: u64) -> TrialRecord {
        let (theta, measured) = (nalgebra::DVector::zeros(1), Vec::new());
        let trial = Trial { rollout, theta, reward: 0.0, success: false, measured };
        TrialRecord { boot_id, ..TrialRecord::of(trial, Measures::NONE) }
    }

    #[test]
    fn the_books_show_what_was_lost_made_twice_or_taken_from_elsewhere() {
        let trials = [trial(1, 7), trial(2, 7), trial(3, 8)];
        let durable = |list: &[(u64, &[u64])]| -> BTreeMap<u64, Vec<u64>> {
            list.iter().map(|(rollout, boots)| (*rollout, boots.to_vec())).collect()
        };
        let good = Ledger::balance(&durable(&[(1, &[7]), (2, &[7])]), &trials);
        assert_eq!((good.learnt, good.produced), (3, 3), "one died before it could say so");
        assert_eq!((good.lost, good.duplicated, good.foreign), (0, 0, 0));
        let bad = Ledger::balance(&durable(&[(1, &[7, 8]), (2, &[6]), (4, &[8])]), &trials);
        assert_eq!((bad.lost, bad.duplicated, bad.foreign), (1, 1, 1));
    }
}
