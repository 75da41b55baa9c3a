//! `skillet session`: the sessions of a folder, and one of them.

use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::{Context, Result};
use learner::store::{Glance, SessionMeta, Store, StoreError};
use learner::summary::Summary;
use serde_json::{Value, json};

use super::modes;
use super::stored::open;
use crate::cli::session::{SessionArgs, SessionVerb};
use crate::config::Config;
use crate::output::{print, print_json};
use crate::session_folder::SessionFolder;
use crate::{Verdict, early};

pub fn run(args: &SessionArgs) -> Result<Verdict> {
    match &args.verb {
        SessionVerb::List { dir, json } => list(dir, *json),
        SessionVerb::Show { session, json } => show(session, *json),
    }
}

fn list(dir: &Path, as_json: bool) -> Result<Verdict> {
    let mut rows = sessions(dir)?.into_iter().map(Row::of).collect::<Vec<_>>();
    rows.sort_by(|a, b| b.changed.cmp(&a.changed).then_with(|| a.name.cmp(&b.name)));
    if as_json {
        let rows: Vec<Value> = rows.iter().map(Row::json).collect();
        print_json(&json!({ "dir": dir, "sessions": rows }))?;
    } else if rows.is_empty() {
        print(&format!(
            "no session in {}; `skillet learn TASK` or `skillet cell up NAME` starts one\n",
            dir.display()
        ))?;
    } else {
        print(&table(&rows))?;
    }
    Ok(Verdict::Done)
}

/// The session folders in `dir`; without the folder there is none.
fn sessions(dir: &Path) -> Result<Vec<SessionFolder>> {
    let entries = match std::fs::read_dir(dir) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => {
            return Err(error)
                .with_context(|| format!("{}: cannot list the folder", dir.display()));
        }
    };
    let folders = entries.flatten().map(|entry| SessionFolder::at(&entry.path()));
    Ok(folders.filter(|folder| folder.has_session()).collect())
}

struct Row {
    name: String,
    path: PathBuf,
    rollouts: Option<u64>,
    is_in_use: bool,
    changed: Option<SystemTime>,
    found: Result<Glance, String>,
}

impl Row {
    fn of(folder: SessionFolder) -> Row {
        let config = Config::load(Some(&folder.config_path())).ok();
        Row {
            name: folder.name(),
            path: folder.dir().to_path_buf(),
            rollouts: config.as_ref().map(|config| config.learner.rollouts),
            is_in_use: folder.is_in_use(),
            changed: changed(&folder),
            found: glance(&folder, config.as_ref()),
        }
    }

    fn json(&self) -> Value {
        let found = self.found.as_ref().ok();
        json!({
            "session": self.path,
            "task": found.map(|found| &found.task),
            "seed": found.map(|found| found.seed),
            "trials": found.map(|found| found.trials),
            "rollouts": self.rollouts,
            "successes": found.map(|found| found.successes),
            "best_reward": found.and_then(|found| found.best_reward),
            "in_use": self.is_in_use,
            "changed_unix_s": self.changed.and_then(unix_s),
            "problem": self.found.as_ref().err(),
        })
    }
}

/// Before the first proposal is stored there is no database.
fn glance(folder: &SessionFolder, config: Option<&Config>) -> Result<Glance, String> {
    let database = folder.database();
    match (Glance::of(&database), config) {
        (Ok(Some(found)), _) => Ok(found),
        (Ok(None), _) => whole(&database).map_err(|error| error.to_string()),
        (Err(StoreError::Missing { .. }), Some(config)) if !Store::exists(&database) => {
            Ok(Glance {
                task: config.task.name.clone(),
                seed: config.learner.seed,
                trials: 0,
                successes: 0,
                best_reward: None,
            })
        }
        (Err(StoreError::Format { found, .. }), _) => {
            Err(format!("format {found}; `skillet session show` converts it"))
        }
        (Err(error), _) => Err(error.to_string()),
    }
}

/// The glance at a session whose trials were rated by people.
fn whole(database: &Path) -> Result<Glance, StoreError> {
    let store = Store::open(database)?;
    let summary = Summary::of(&store.trials()?);
    Ok(Glance {
        task: store.meta().task.clone(),
        seed: store.meta().learner.seed,
        trials: summary.trials,
        successes: summary.successes,
        best_reward: summary.best_rollout.map(|_| summary.best_reward),
    })
}

/// When the session was last written.
fn changed(folder: &SessionFolder) -> Option<SystemTime> {
    let log = folder.database().with_extension("db-wal");
    let files = [folder.database(), log, folder.config_path()];
    files.iter().filter_map(|file| std::fs::metadata(file).ok()?.modified().ok()).max()
}

fn unix_s(time: SystemTime) -> Option<u64> {
    Some(time.duration_since(UNIX_EPOCH).ok()?.as_secs())
}

fn table(rows: &[Row]) -> String {
    let width = rows.iter().map(|row| row.name.chars().count()).max().unwrap_or(0).max(7);
    let mut text = format!(
        "{:<width$}  task            seed  trials     successes  best reward  changed\n",
        "session"
    );
    for row in rows {
        text += &format!("{:<width$}  ", row.name);
        text += &match &row.found {
            Err(problem) => format!("{problem}\n"),
            Ok(found) => {
                let of = row.rollouts.map_or("–".into(), |rollouts| rollouts.to_string());
                let best = found.best_reward.map_or("–".into(), |best| format!("{best:.3}"));
                let changed = match (row.is_in_use, row.changed) {
                    (true, _) => "learning now".into(),
                    (false, Some(changed)) => ago(changed.elapsed().unwrap_or_default()),
                    (false, None) => "–".into(),
                };
                format!(
                    "{:<14}  {:>4}  {:<9}  {:>9}  {best:>11}  {changed}\n",
                    found.task,
                    found.seed,
                    format!("{}/{of}", found.trials),
                    found.successes,
                )
            }
        };
    }
    text
}

fn ago(age: Duration) -> String {
    match age.as_secs() {
        s @ 0..120 => format!("{s} s ago"),
        s @ 120..7200 => format!("{} min ago", s / 60),
        s @ 7200..172_800 => format!("{} h ago", s / 3600),
        s => format!("{} days ago", s / 86400),
    }
}

fn show(session: &Path, as_json: bool) -> Result<Verdict> {
    let folder = SessionFolder::open(session)?;
    let config = Config::load(Some(&folder.config_path()))?;
    let store = open(folder.dir(), &folder.database())?;
    let summary = Summary::of(&store.trials()?);
    if as_json {
        let modes = modes::summary(&store, config.learner.prefer)?;
        print_json(&details(&folder, &config, store.meta(), &summary, &modes))?;
    } else {
        let n_modes = store.mode_reports()?.len();
        print(&text(&folder, &config, store.meta(), &summary, n_modes))?;
    }
    Ok(Verdict::Done)
}

fn details(
    folder: &SessionFolder,
    config: &Config,
    meta: &SessionMeta,
    summary: &Summary,
    modes: &[Value],
) -> Value {
    json!({
        "session": folder.dir(),
        "session_id": format!("{:016x}", meta.session_id),
        "task": meta.task,
        "seed": meta.learner.seed,
        "method": meta.learner.search.method,
        "trials": summary.trials,
        "rollouts": config.learner.rollouts,
        "successes": summary.successes,
        "first_success": summary.first_success,
        "success_last20": summary.success_last20,
        "best_reward": summary.best_rollout.map(|_| summary.best_reward),
        "best_rollout": summary.best_rollout,
        "faults": summary.faults,
        "set_aside": summary.set_aside,
        "ended_early": early::by_reason(&summary.ended_early),
        "modes": modes,
        "in_use": folder.is_in_use(),
        "changed_unix_s": changed(folder).and_then(unix_s),
    })
}

fn text(
    folder: &SessionFolder,
    config: &Config,
    meta: &SessionMeta,
    summary: &Summary,
    n_modes: usize,
) -> String {
    let (dir, trials, rollouts) = (folder.dir().display(), summary.trials, config.learner.rollouts);
    let learning = if folder.is_in_use() { ", learning now" } else { "" };
    let mut text = format!(
        "task         {}, seed {}\ntrials       {trials} of {rollouts}{learning}\n",
        meta.task, meta.learner.seed
    );
    text += &match summary.first_success {
        Some(first) => format!(
            "successes    {}, the first at rollout {first}; {:.0} % of the last 20\n",
            summary.successes,
            100.0 * summary.success_last20
        ),
        None => "successes    none\n".to_string(),
    };
    if let Some(rollout) = summary.best_rollout {
        text += &format!("best reward  {:.3} at rollout {rollout}\n", summary.best_reward);
    }
    if let Some(early) = early::sentence(&early::by_reason(&summary.ended_early)) {
        text += &format!("faults       {early}\n");
    }
    text + &format!(
        "modes        {n_modes}\n\
         next         skillet report {dir}\n             skillet policy list {dir} --best 5\n"
    )
}
