//! The account of one session: every rollout is a trial once, every episode that a controller made durable was learnt
//! or is known to be a second execution, and everything comes out again bit for bit.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};
use learner::LearnerError;
use learner::store::{Store, TrialRecord};
use serde_json::Value;

use super::super::ledger::{Durable, durable_in, log_lines, time_of};
use super::fleet::Fleet;
use crate::config::Config;
use crate::judging;
use crate::resume::resume;
use crate::session_folder::SessionFolder;

/// What a learner logs when a lease is over, when it starts, and of each trial.
const LEASE_OVER: &str = "reassigned to another cell";
const STARTED: &str = "learner ready";
const TRIAL: &str = "\"trial\"";

#[derive(Clone, Debug, Default)]
pub struct Books {
    pub sessions: u64,
    /// Trials stored.
    pub learnt: u64,
    /// Rollouts with an episode that a controller made durable.
    pub produced: u64,
    /// Durable episodes of a rollout beyond its first one, in another cell: its lease was over, or the learner that had
    /// asked was killed, and the one after it asked another cell.
    pub again_after_lease: u64,
    pub again_after_restart: u64,
    /// The same for no reason that is known.
    pub again_for_nothing: u64,
    /// Durable episodes of a rollout beyond its first one, in the same cell.
    pub doubled: u64,
    /// Durable, but not learnt; and numbers below the last that are no trial.
    pub lost: u64,
    /// Learnt from another cell or another start of its controller than one that made it durable.
    pub foreign: u64,
    /// Leases that were over, and starts of learners beyond the first.
    pub leases: u64,
    pub restarts: u64,
    /// Trials that were executed again, and those that came out otherwise.
    pub replayed: u64,
    pub different: u64,
    /// Sessions whose search does not propose the same again.
    pub not_reproduced: u64,
}

/// What is in the logs and the store of one session.
struct Evidence {
    /// By rollout: cell, start of its controller and time, the earliest first.
    durable: BTreeMap<u64, Vec<(u64, Durable)>>,
    /// In the order in which they were told.
    trials: Vec<TrialRecord>,
    /// When each trial was told, as far as the log has it.
    told: BTreeMap<u64, String>,
    leases: BTreeSet<u64>,
    n_leases: u64,
    starts: Vec<String>,
}

impl Books {
    pub fn add(&mut self, other: &Books) {
        for (sum, more) in [
            (&mut self.sessions, other.sessions),
            (&mut self.learnt, other.learnt),
            (&mut self.produced, other.produced),
            (&mut self.again_after_lease, other.again_after_lease),
            (&mut self.again_after_restart, other.again_after_restart),
            (&mut self.again_for_nothing, other.again_for_nothing),
            (&mut self.doubled, other.doubled),
            (&mut self.lost, other.lost),
            (&mut self.foreign, other.foreign),
            (&mut self.leases, other.leases),
            (&mut self.restarts, other.restarts),
            (&mut self.replayed, other.replayed),
            (&mut self.different, other.different),
            (&mut self.not_reproduced, other.not_reproduced),
        ] {
            *sum += more;
        }
    }

    /// The books of session `number`, once everything has come to rest.
    pub fn of(fleet: &Fleet, number: u64) -> Result<Books> {
        let folder = fleet.session(number);
        let mut books = Evidence::of(fleet, number)?.balance();
        (books.replayed, books.different) = replay(&folder)?;
        books.not_reproduced = u64::from(!is_reproduced(&folder)?);
        Ok(books)
    }
}

impl Evidence {
    fn of(fleet: &Fleet, number: u64) -> Result<Evidence> {
        let store = Store::open(&fleet.session(number).join("session.db"))?;
        let session = store.meta().session_id;
        let mut durable = BTreeMap::<u64, Vec<(u64, Durable)>>::new();
        for (k, cell) in fleet.cells.iter().enumerate() {
            let episodes = durable_in(&cell.dir.join("controller.log"))?;
            for episode in episodes.into_iter().filter(|episode| episode.session == session) {
                durable.entry(episode.rollout).or_default().push((k as u64 + 1, episode));
            }
        }
        for episodes in durable.values_mut() {
            episodes.sort_by(|(_, a), (_, b)| a.at.cmp(&b.at));
        }
        let log = fleet.learner_dir(number).join("learner.log");
        let told = log_lines(&log, TRIAL)?;
        let told = told
            .iter()
            .filter_map(|line| Some((line["fields"]["rollout"].as_u64()?, time_of(line))));
        let leases = log_lines(&log, LEASE_OVER)?;
        let mut trials = store.trials()?;
        trials.sort_by_key(|trial| trial.told);
        Ok(Evidence {
            durable,
            trials,
            told: told.collect(),
            leases: leases.iter().filter_map(rollout_in_words).collect(),
            n_leases: leases.len() as u64,
            starts: log_lines(&log, STARTED)?.iter().map(time_of).collect(),
        })
    }

    fn balance(&self) -> Books {
        let learnt: BTreeMap<u64, &TrialRecord> =
            self.trials.iter().map(|trial| (trial.rollout, trial)).collect();
        let last = learnt.keys().next_back().copied().unwrap_or(0);
        let missing = (1..=last).filter(|rollout| !learnt.contains_key(rollout)).count();
        // A controller that was killed between the disk and its log said nothing.
        let silent = learnt.keys().filter(|rollout| !self.durable.contains_key(rollout)).count();
        let lost = self.durable.keys().filter(|rollout| !learnt.contains_key(rollout)).count();
        let mut books = Books {
            sessions: 1,
            learnt: self.trials.len() as u64,
            produced: (self.durable.len() + silent) as u64,
            lost: (lost + missing) as u64,
            leases: self.n_leases,
            restarts: self.starts.len().saturating_sub(1) as u64,
            ..Books::default()
        };
        for (rollout, episodes) in &self.durable {
            let trial = learnt.get(rollout).copied();
            let mut cells = BTreeSet::new();
            for (place, (cell, episode)) in episodes.iter().enumerate() {
                let is_new = cells.insert(*cell);
                match (place, is_new) {
                    (0, _) => {}
                    (_, false) => books.doubled += 1,
                    _ if self.leases.contains(rollout) => books.again_after_lease += 1,
                    _ if self.was_restarted(trial, &episode.at) => books.again_after_restart += 1,
                    _ => books.again_for_nothing += 1,
                }
            }
            books.foreign += u64::from(trial.is_some_and(|trial| {
                let is_it = |(cell, episode): &(u64, Durable)| {
                    trial.cell == cell.to_string() && trial.boot_id == episode.boot_id
                };
                !episodes.iter().any(is_it)
            }));
        }
        books
    }

    /// A learner has started between the moment when the rollout of `trial` was proposed and `at`.
    fn was_restarted(&self, trial: Option<&TrialRecord>, at: &str) -> bool {
        let known = trial.map_or(0, |trial| trial.asked_after as usize);
        let told = self.trials[..known].iter().rev();
        let asked = told.filter_map(|trial| self.told.get(&trial.rollout)).next();
        let asked = asked.map_or("", |at| at);
        self.starts.iter().skip(1).any(|start| asked <= start.as_str() && start.as_str() <= at)
    }
}

/// The number in "rollout 7 did not come back".
fn rollout_in_words(line: &Value) -> Option<u64> {
    let message = line["fields"]["message"].as_str()?;
    message.split("rollout ").nth(1)?.split(' ').next()?.parse().ok()
}

/// How many trials `skillet replay` has executed again, and how many of them differ.
fn replay(session: &Path) -> Result<(u64, u64)> {
    let program = std::env::current_exe().context("finding this executable")?;
    let mut command = Command::new(program);
    command.arg("replay").arg(session).args(["--all", "--json"]);
    let output = command.output().context("starting `skillet replay`")?;
    let said: Value = serde_json::from_slice(&output.stdout).with_context(|| {
        format!("`skillet replay` said {}", String::from_utf8_lossy(&output.stderr).trim())
    })?;
    let counts = said["trials"].as_u64().zip(said["different"].as_array());
    let (trials, different) = counts.with_context(|| format!("`skillet replay` said {said}"))?;
    Ok((trials, different.len() as u64))
}

/// The search, told the stored trials again, makes the same proposals.
fn is_reproduced(session: &Path) -> Result<bool> {
    let folder = SessionFolder::open(session)?;
    let config = Config::load(Some(&folder.config_path()))?;
    let judge = judging::of_session(&config, &folder)?;
    match resume(&folder, &config, judge, |_| {}) {
        Ok(_) => Ok(true),
        Err(error) if is_astray(&error) => Ok(false),
        Err(error) => Err(error),
    }
}

fn is_astray(error: &anyhow::Error) -> bool {
    matches!(error.downcast_ref(), Some(LearnerError::NotReproduced { .. }))
}

#[cfg(test)]
mod tests {
    use search::trial::Trial;
    use shm_types::measures::Measures;

    use super::*;

    fn trial(rollout: u64, cell: u64, boot_id: u64) -> TrialRecord {
        let (theta, measured) = (nalgebra::DVector::zeros(1), Vec::new());
        let trial = Trial { rollout, theta, reward: 0.0, success: false, measured };
        let cell = cell.to_string();
        TrialRecord { boot_id, cell, ..TrialRecord::of(trial, Measures::NONE) }
    }

    fn durable(rollout: u64, boot_id: u64, at: &str) -> Durable {
        Durable { session: 1, rollout, boot_id, at: at.into() }
    }

    fn evidence(durable: Vec<(u64, Durable)>) -> Evidence {
        let mut by_rollout = BTreeMap::<u64, Vec<(u64, Durable)>>::new();
        for (cell, episode) in durable {
            by_rollout.entry(episode.rollout).or_default().push((cell, episode));
        }
        let told = [(1, "02".to_string()), (2, "04".into()), (3, "06".into())];
        Evidence {
            durable: by_rollout,
            trials: vec![trial(1, 1, 7), trial(2, 2, 8), trial(3, 1, 7)],
            told: told.into(),
            leases: BTreeSet::new(),
            n_leases: 0,
            starts: vec!["00".into()],
        }
    }

    fn good() -> Vec<(u64, Durable)> {
        vec![(1, durable(1, 7, "01")), (2, durable(2, 8, "03")), (1, durable(3, 7, "05"))]
    }

    #[test]
    fn each_rollout_is_a_trial_once() {
        let books = evidence(good()).balance();
        assert_eq!((books.learnt, books.produced), (3, 3));
        assert_eq!(
            (books.lost, books.doubled, books.foreign, books.again_for_nothing),
            (0, 0, 0, 0)
        );
        let silent = evidence(good()[..2].iter().map(copy).collect()).balance();
        assert_eq!(silent.produced, 3, "one died before it could say so");
    }

    fn copy((cell, episode): &(u64, Durable)) -> (u64, Durable) {
        (*cell, durable(episode.rollout, episode.boot_id, &episode.at))
    }

    #[test]
    fn a_second_execution_must_have_a_reason() {
        let with = |cell, at: &str| {
            let mut all = good();
            all.push((cell, durable(2, 9, at)));
            evidence(all)
        };
        assert_eq!(with(1, "05").balance().again_for_nothing, 1);
        assert_eq!(with(2, "05").balance().doubled, 1, "in the same cell");
        let mut leased = with(1, "05");
        leased.leases.insert(2);
        assert_eq!(leased.balance().again_after_lease, 1);
        // Rollout 2 was proposed when trial 1 was known, at 02.
        for (start, is_reason) in [("01", 0), ("03", 1), ("06", 0)] {
            let mut restarted = with(1, "05");
            restarted.starts.push(start.into());
            assert_eq!(restarted.balance().again_after_restart, is_reason, "at {start}");
        }
    }

    #[test]
    fn what_is_lost_or_from_elsewhere_shows() {
        let mut all = good();
        all.push((1, durable(4, 7, "07")));
        assert_eq!(evidence(all).balance().lost, 1, "never learnt");
        let mut all = good();
        all[1].0 = 1;
        assert_eq!(evidence(all).balance().foreign, 1, "of another cell");
        let mut gap = evidence(good());
        gap.trials.remove(1);
        assert_eq!(gap.balance().lost, 2, "a number that is no trial, and its episode");
    }
}
