//! `skillet policy modes | forbid | export`: choosing among what a session has found.

use std::path::Path;

use anyhow::{Context, Result, bail};
use learner::Learner;
use learner::modes::{ModeReport, Prefer, assess, choose};
use learner::store::{Store, TrialRecord};
use serde_json::json;
use shm_types::policy::PolicyMsg;

use crate::Verdict;
use crate::cli::PreferArg;
use crate::config::Config;
use crate::output::{print, print_json};
use crate::report::ModeRow;
use crate::session_folder::SessionFolder;
use crate::setup;

/// A session at rest, and which mode it prefers.
struct Found {
    learner: Learner,
    modes: Vec<(ModeReport, PolicyMsg)>,
    prefer: Prefer,
}

impl Found {
    fn open(session: &Path, prefer: Option<PreferArg>) -> Result<Found> {
        let folder = SessionFolder::open(session)?;
        // A learner at work writes the same tables.
        let _lock = folder.lock()?;
        let config = Config::load(Some(&folder.config_path()))?;
        let name = || format!("session {}", folder.dir().display());
        let demonstrations = setup::check(&config)?;
        let mut learner =
            Learner::resume(folder.dir(), &config.task.name, &config.learner, &demonstrations)
                .with_context(name)?;
        let modes = learner.modes().with_context(name)?;
        let prefer = prefer.map_or(config.learner.prefer, Into::into);
        Ok(Found { learner, modes, prefer })
    }

    fn answer(&self) -> Option<usize> {
        choose(self.modes.iter().map(|(report, _)| report), self.prefer).map(|r| r.number)
    }

    fn numbered(&self, number: usize) -> Result<&(ModeReport, PolicyMsg)> {
        let found = self.modes.iter().find(|(report, _)| report.number == number);
        found.with_context(|| {
            format!("mode {number}: this session has modes 1 to {}", self.modes.len())
        })
    }
}

/// The modes of a session, as in `list` with JSON.
pub fn summary(session: &Path) -> Result<Vec<serde_json::Value>> {
    let found = Found::open(session, None)?;
    let answer = found.answer();
    Ok(found.modes.iter().map(|mode| row(mode, answer)).collect())
}

/// The modes that a session holds, for its report: also while its learner is at work.
pub fn rows(store: &Store, prefer: Prefer) -> Result<Vec<ModeRow>> {
    let modes = store.modes()?;
    if modes.is_empty() {
        return Ok(Vec::new());
    }
    let trials = store.trials()?;
    let told: Vec<_> = trials.iter().filter(|t| !t.set_aside).map(TrialRecord::trial).collect();
    let forbidden = store.forbidden()?;
    let thetas = told.iter().map(|trial| &trial.theta).chain(&forbidden);
    let mut dims = modes.iter().map(|mode| &mode.mean).chain(thetas).map(|theta| theta.len());
    if dims.next().is_some_and(|dim| dims.any(|other| other != dim)) {
        bail!("its modes and its trials do not have the same parameters: the database is damaged");
    }
    let reports = assess(&modes, &told, &forbidden);
    let answer = choose(&reports, prefer).map(|report| report.number);
    let row = |report: ModeReport| ModeRow {
        is_answer: answer == Some(report.number),
        number: report.number,
        n_trials: report.n_trials,
        best: report.best,
        tolerance: report.tolerance,
        forbidden: report.forbidden,
        mode: report.mode,
    };
    Ok(reports.into_iter().map(row).collect())
}

fn remark(report: &ModeReport, answer: Option<usize>) -> &'static str {
    match (answer == Some(report.number), report.forbidden) {
        (true, _) => "the answer",
        (_, true) => "forbidden",
        _ => "",
    }
}

pub fn list(session: &Path, prefer: Option<PreferArg>, as_json: bool) -> Result<Verdict> {
    let found = Found::open(session, prefer)?;
    let answer = found.answer();
    if as_json {
        let rows: Vec<_> = found.modes.iter().map(|mode| row(mode, answer)).collect();
        print_json(&rows)?;
        return Ok(Verdict::Done);
    }
    let mut text = "mode  prior  trials  best reward  at rollout  tolerance  policy\n".to_string();
    for (report, policy) in &found.modes {
        let number = |value: Option<f64>| value.map_or("–".into(), |value| format!("{value:.4}"));
        let best = report.best;
        text += &format!(
            "{:4}  {:5.3}  {:6}  {:>11}  {:>10}  {:>9}  {}  {}\n",
            report.number,
            report.mode.prior,
            report.n_trials,
            number(best.map(|(_, reward)| reward)),
            best.map_or("–".into(), |(rollout, _)| rollout.to_string()),
            number(report.tolerance),
            policy.policy_id,
            remark(report, answer)
        );
    }
    text += "tolerance: expected reward when executed with the noise common to the modes\n";
    print(&text)?;
    Ok(Verdict::Done)
}

fn row((report, policy): &(ModeReport, PolicyMsg), answer: Option<usize>) -> serde_json::Value {
    json!({
        "mode": report.number,
        "prior": report.mode.prior,
        "trials": report.n_trials,
        "best_reward": report.best.map(|(_, reward)| reward),
        "best_rollout": report.best.map(|(rollout, _)| rollout),
        "tolerance": report.tolerance,
        "policy_id": policy.policy_id,
        "forbidden": report.forbidden,
        "answer": answer == Some(report.number),
    })
}

pub fn forbid(session: &Path, mode: &str) -> Result<Verdict> {
    let mut found = Found::open(session, None)?;
    if mode == "none" {
        found.learner.allow_all()?;
    } else {
        let number = mode.parse().with_context(|| {
            format!("mode '{mode}': give its number in `policy modes`, or none")
        })?;
        let report = found.numbered(number)?.0.clone();
        found.learner.forbid(&report)?;
    }
    found.modes = found.learner.modes()?;
    match found.answer() {
        Some(number) => {
            let policy = found.numbered(number)?.1.policy_id;
            print(&format!("the answer is mode {number}, policy {policy}\n"))?;
            Ok(Verdict::Done)
        }
        None => {
            eprintln!("every mode is forbidden; `skillet policy forbid SESSION none` allows them");
            Ok(Verdict::Negative)
        }
    }
}

/// The policy of a mode, else of the preferred one.
pub fn answer(session: &Path, prefer: Option<PreferArg>, mode: Option<usize>) -> Result<PolicyMsg> {
    let found = Found::open(session, prefer)?;
    let Some(number) = mode.or_else(|| found.answer()) else {
        bail!("every mode is forbidden; `skillet policy forbid SESSION none` allows them");
    };
    let (report, policy) = found.numbered(number)?;
    if report.forbidden {
        bail!("mode {number} is forbidden; `skillet policy forbid SESSION none` allows it");
    }
    Ok(*policy)
}
