//! `skillet replay`: a trial again, from the store alone, compared with what was stored.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use learner::judge::Judge;
use learner::store::{Store, TrialRecord};
use serde_json::json;
use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::measures::Measures;
use shm_types::policy::PolicyMsg;

use super::stored::{best, open};
use crate::Verdict;
use crate::bar::bar;
use crate::cli::record::ReplayArgs;
use crate::config::Config;
use crate::output::{print, print_json};
use crate::record::recorder::Limits;
use crate::record::session::SessionRecorder;
use crate::session_folder::SessionFolder;
use crate::tasks::executor::{Executor, executor};
use crate::{judging, record};

pub fn run(args: &ReplayArgs) -> Result<Verdict> {
    let folder = SessionFolder::open(&args.session)?;
    let config = Config::load(Some(&folder.config_path()))?;
    let store = open(folder.dir(), &folder.database())?;
    let trials = store.trials()?;
    if args.all {
        return all(&store, &config, &trials, args.json);
    }
    let trial = chosen(&args.session, &store, &trials, args.trial)?;
    let rollout = trial.rollout;
    let replayed = Again::of(&store, &config)?.replay(trial)?;
    let default = || folder.dir().join(format!("replay-{rollout}.mcap"));
    let path = write(&config, trial, &replayed, &args.out.clone().unwrap_or_else(default))?;
    let is_same = replayed.is_same(trial);
    if args.json {
        print_json(&json!({ "rollout": rollout, "identical": is_same, "recording": path }))?;
    } else {
        let verdict = if is_same { "identical, bit for bit" } else { "DIFFERENT" };
        print(&format!("trial {rollout}: {verdict}\n{}\n", path.display()))?;
    }
    Ok(if is_same { Verdict::Done } else { Verdict::Negative })
}

/// The trial of rollout `rollout`, or the best one of the session.
///
/// # Errors
/// There is none of that number, or it was not executed.
pub(super) fn chosen<'a>(
    session: &Path,
    store: &Store,
    trials: &'a [TrialRecord],
    rollout: Option<u64>,
) -> Result<&'a TrialRecord> {
    let wishes = store.wishes()?;
    let rollout = rollout.unwrap_or_else(|| best(trials, wishes.last()));
    let trial = trials.iter().find(|trial| trial.rollout == rollout).with_context(|| {
        format!("{}: no trial {rollout}; use 1..={}", session.display(), trials.len())
    })?;
    if !trial.was_executed() {
        bail!(
            "trial {rollout} was not executed: it was refused or set aside, see `skillet trials`"
        );
    }
    Ok(trial)
}

fn all(store: &Store, config: &Config, trials: &[TrialRecord], as_json: bool) -> Result<Verdict> {
    let bar = bar(Some(trials.len() as u64));
    let mut again = Again::of(store, config)?;
    let mut different = Vec::new();
    let mut executed = 0;
    // What was not executed has nothing to be compared with.
    for trial in bar.wrap_iter(trials.iter().filter(|trial| trial.was_executed())) {
        executed += 1;
        if !again.replay(trial)?.is_same(trial) {
            different.push(trial.rollout);
        }
    }
    bar.finish_and_clear();
    if as_json {
        print_json(&json!({ "trials": executed, "different": different }))?;
    } else {
        print(&format!("{executed} trials replayed, {} different\n", different.len()))?;
        for rollout in &different {
            print(&format!("  trial {rollout}\n"))?;
        }
    }
    Ok(if different.is_empty() { Verdict::Done } else { Verdict::Negative })
}

/// A trial that was executed again.
pub struct Replayed {
    pub policy: PolicyMsg,
    measures: Measures,
    success: bool,
    reward: f64,
    fault: u64,
    pub records: Vec<TickRecord>,
    pub period_ns: u64,
}

impl Replayed {
    pub fn is_same(&self, trial: &TrialRecord) -> bool {
        let bits = |measures: &Measures| -> Vec<u64> {
            measures.iter().map(|measure| measure.value.to_bits()).collect()
        };
        self.measures.declared() == trial.measures.declared()
            && bits(&self.measures) == bits(&trial.measures)
            && self.success == trial.own_success
            && self.reward.to_bits() == trial.own_reward.to_bits()
            && self.fault == trial.fault
            && self.records.len() as u64 == trial.n_records
    }

    /// What an episode of it tells.
    pub fn header(&self, trial: &TrialRecord) -> EpisodeHeader {
        EpisodeHeader {
            session: self.policy.session,
            rollout: trial.rollout,
            policy_id: trial.policy_id,
            policy_digest: self.policy.digest,
            period_ns: self.period_ns,
            n_records: self.records.len() as u64,
            fault: self.fault,
            ..EpisodeHeader::default()
        }
    }
}

/// Executes trials again.
pub struct Again<'a> {
    store: &'a Store,
    execute: Box<Executor>,
    judge: Judge,
}

impl Again<'_> {
    pub fn of<'a>(store: &'a Store, config: &Config) -> Result<Again<'a>> {
        let judge = judging::judge(config)?.keeping(&store.meta().measures);
        Ok(Again { store, execute: executor(config)?, judge })
    }

    pub fn replay(&mut self, trial: &TrialRecord) -> Result<Replayed> {
        let policy = self.store.policy(trial.policy_id)?.with_context(|| {
            format!("the store lacks policy {} of trial {}", trial.policy_id, trial.rollout)
        })?;
        let (header, records) = (self.execute)(&policy)?;
        let judged = self.judge.judge_again(&policy, &header, &records, &trial.measures);
        let (measures, success, reward) = judged?;
        let (fault, period_ns) = (header.fault, header.period_ns);
        Ok(Replayed { policy, measures, success, reward, fault, records, period_ns })
    }
}

/// Records a trial that was executed again; returns the file.
pub fn write(
    config: &Config,
    trial: &TrialRecord,
    replayed: &Replayed,
    path: &Path,
) -> Result<PathBuf> {
    let header = replayed.header(trial);
    let limits = Limits { max_bytes: u64::MAX, by_rollout: false, object_always: true };
    let attachments = record::attachments(config)?;
    let mut recorder = SessionRecorder::new(record::scribe(config)?, path, limits, attachments)?;
    recorder.executed(&replayed.policy, &header, &replayed.records)?;
    let mut files = recorder.finish()?;
    Ok(files.swap_remove(0))
}
