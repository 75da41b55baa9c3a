//! `skillet policy modes | forbid | allow | export`: choose among the modes of a session.

use std::fs::File;
use std::path::Path;

use anyhow::{Context, Result, bail};
use learner::modes::{ModeReport, Prefer, choose, forbidden_by};
use learner::store::Store;
use nalgebra::DVector;
use search::Mode;
use serde_json::json;
use shm_types::policy::PolicyMsg;

use crate::Verdict;
use crate::cli::PreferArg;
use crate::config::Config;
use crate::judging;
use crate::output::{print, print_json};
use crate::report::ModeRow;
use crate::resume::resume;
use crate::session_folder::SessionFolder;
use crate::stderr::say;

/// Modes move while a session goes on, so that one place may come to forbid them all.
const ALL_FORBIDDEN: &str =
    "every mode is forbidden; run `skillet policy allow SESSION MODE` to allow one";

/// A session at rest, and which mode it prefers.
struct Found {
    store: Store,
    modes: Vec<(ModeReport, PolicyMsg)>,
    prefer: Prefer,
    /// A learner at work writes the same tables.
    _lock: File,
}

impl Found {
    fn open(session: &Path, prefer: Option<PreferArg>) -> Result<Found> {
        let folder = SessionFolder::open(session)?;
        let lock = folder.lock()?;
        let config = Config::load(Some(&folder.config_path()))?;
        let name = || format!("session {}", folder.dir().display());
        let mut store = Store::resume(&folder.database()).with_context(name)?;
        if !store.has_current_modes().with_context(name)? {
            // Its learner was killed: what it had found follows from the trials.
            drop(store);
            // Nothing is judged.
            let judge = judging::judge(&config)?;
            resume(&folder, &config, judge, say)?.modes().with_context(name)?;
            store = Store::resume(&folder.database()).with_context(name)?;
        }
        let modes = with_policies(&store).with_context(name)?;
        let prefer = prefer.map_or(config.learner.prefer, Into::into);
        Ok(Found { store, modes, prefer, _lock: lock })
    }

    fn answer(&self) -> Option<usize> {
        answer_of(&self.modes, self.prefer)
    }

    fn numbered(&self, number: usize) -> Result<&(ModeReport, PolicyMsg)> {
        let found = self.modes.iter().find(|(report, _)| report.number == number);
        found.with_context(|| {
            format!("mode {number}: this session has modes 1 to {}", self.modes.len())
        })
    }

    /// Number and mean of a mode as named on the command line.
    fn named(&self, mode: &str) -> Result<(usize, DVector<f64>)> {
        let number = mode.parse().ok().with_context(|| {
            format!("mode '{mode}': give its number, as in `skillet policy modes SESSION`")
        })?;
        Ok((number, self.numbered(number)?.0.mode.mean.clone()))
    }
}

fn with_policies(store: &Store) -> Result<Vec<(ModeReport, PolicyMsg)>> {
    let with_policy = |(report, id): (ModeReport, u64)| {
        let policy = store.policy(id)?;
        let number = report.number;
        Ok((report, policy.with_context(|| format!("mode {number}: its policy {id} is missing"))?))
    };
    store.mode_reports()?.into_iter().map(with_policy).collect()
}

/// The modes that a session holds, as in `list` with JSON.
pub fn summary(store: &Store, prefer: Prefer) -> Result<Vec<serde_json::Value>> {
    let modes = store.mode_reports()?;
    let answer = answer_of(&modes, prefer);
    Ok(modes.iter().map(|(report, id)| row(report, *id, answer)).collect())
}

/// The modes that a session holds, for its report: also while its learner is at work.
pub fn rows(store: &Store, prefer: Prefer) -> Result<Vec<ModeRow>> {
    let modes = store.mode_reports()?;
    let answer = answer_of(&modes, prefer);
    let row = |(report, policy_id): (ModeReport, u64)| ModeRow {
        policy_id,
        film: None,
        is_answer: answer == Some(report.number),
        number: report.number,
        n_trials: report.n_trials,
        best: report.best,
        tolerance: report.tolerance,
        forbidden: report.forbidden,
        mode: report.mode,
    };
    Ok(modes.into_iter().map(row).collect())
}

/// Number of the mode to use.
fn answer_of<Policy>(modes: &[(ModeReport, Policy)], prefer: Prefer) -> Option<usize> {
    choose(modes.iter().map(|(report, _)| report), prefer).map(|report| report.number)
}

fn remark(report: &ModeReport, answer: Option<usize>) -> &'static str {
    match (answer == Some(report.number), report.forbidden) {
        (true, _) => "selected",
        (_, true) => "forbidden",
        _ => "",
    }
}

pub fn list(session: &Path, prefer: Option<PreferArg>, as_json: bool) -> Result<Verdict> {
    let found = Found::open(session, prefer)?;
    let answer = found.answer();
    if as_json {
        let row =
            |(report, policy): &(ModeReport, PolicyMsg)| row(report, policy.policy_id, answer);
        let rows: Vec<_> = found.modes.iter().map(row).collect();
        print_json(&json!({ "session": session, "modes": rows }))?;
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
    text += "tolerance: expected reward under execution noise, the same for all modes\n";
    print(&text)?;
    Ok(Verdict::Done)
}

fn row(report: &ModeReport, policy_id: u64, answer: Option<usize>) -> serde_json::Value {
    json!({
        "mode": report.number,
        "prior": report.mode.prior,
        "trials": report.n_trials,
        "best_reward": report.best.map(|(_, reward)| reward),
        "best_rollout": report.best.map(|(rollout, _)| rollout),
        "tolerance": report.tolerance,
        "policy_id": policy_id,
        "forbidden": report.forbidden,
        "selected": answer == Some(report.number),
    })
}

pub fn forbid(session: &Path, mode: &str, as_json: bool) -> Result<Verdict> {
    let mut found = Found::open(session, None)?;
    let (number, mean) = found.named(mode)?;
    let modes: Vec<Mode> = found.modes.iter().map(|(report, _)| report.mode.clone()).collect();
    let gone = forbidden_by(&mean, &modes);
    let stays = |(report, _): &&(ModeReport, PolicyMsg)| {
        !report.forbidden && !gone.contains(&(report.number - 1))
    };
    if !found.modes.iter().any(|mode| stays(&mode)) {
        let others = found.modes.iter().map(|(report, _)| report.number);
        let others: Vec<usize> = others.filter(|other| *other != number).collect();
        let name = session.display();
        match others.first() {
            None => bail!(
                "mode {number} is the only mode of session {name}; without it no policy would be left: \
                 nothing changed"
            ),
            Some(other) => bail!(
                "mode {number} is the last allowed mode of session {name}: nothing changed. \
                 Allow another one first, as in `skillet policy allow {name} {other}`"
            ),
        }
    }
    found.store.forbid(&mean)?;
    selected(found, as_json)
}

pub fn allow(session: &Path, mode: &str, as_json: bool) -> Result<Verdict> {
    let mut found = Found::open(session, None)?;
    let (number, _) = found.named(mode)?;
    found.store.allow(number)?;
    selected(found, as_json)
}

/// Says which mode is selected after a change.
fn selected(mut found: Found, as_json: bool) -> Result<Verdict> {
    found.modes = with_policies(&found.store)?;
    let Some(number) = found.answer() else { bail!(ALL_FORBIDDEN) };
    let policy = found.numbered(number)?.1.policy_id;
    let forbidden = found.modes.iter().map(|(report, _)| report);
    let forbidden: Vec<usize> =
        forbidden.filter(|report| report.forbidden).map(|report| report.number).collect();
    if as_json {
        print_json(&json!({ "mode": number, "policy_id": policy, "forbidden": forbidden }))?;
    } else {
        print(&format!("selected: mode {number}, policy {policy}\n"))?;
    }
    Ok(Verdict::Done)
}

/// The policy of a mode, else of the preferred one.
pub fn answer(session: &Path, prefer: Option<PreferArg>, mode: Option<usize>) -> Result<PolicyMsg> {
    let found = Found::open(session, prefer)?;
    let Some(number) = mode.or_else(|| found.answer()) else {
        bail!(ALL_FORBIDDEN);
    };
    let (report, policy) = found.numbered(number)?;
    if report.forbidden {
        let name = session.display();
        bail!("mode {number} is forbidden; run `skillet policy allow {name} {number}` to allow it");
    }
    Ok(*policy)
}
