//! `skillet report`: figures and one HTML page of a session.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use learner::path::{PathRow, unwrapped};
use learner::store::{CellRecord, Store, TrialRecord};
use learner::summary::Summary;
use learner::wish::{Wish, Wishes};
use rt_controller::disk::timing_file::{LoopTiming, TimingFile};
use serde_json::json;
use shm_types::measures::Measures;

use super::modes;
use crate::Verdict;
use crate::cli::ReportArgs;
use crate::config::Config;
use crate::output::{print, print_json};
use crate::report::{self, ReportData, TrialRow};
use crate::session_folder::SessionFolder;

pub fn run(args: &ReportArgs) -> Result<Verdict> {
    let folder = SessionFolder::open(&args.session)?;
    let page = write(&folder, &[])?;
    if args.json {
        print_json(&json!({ "report": page }))?;
    } else {
        print(&format!("{}\n", page.display()))?;
    }
    Ok(Verdict::Done)
}

/// Writes `report/index.html` and the figures beside it; returns the page.
pub fn write(folder: &SessionFolder, notes: &[(String, String)]) -> Result<PathBuf> {
    let data = gather(folder, notes)?;
    let dir = folder.report_dir();
    let write = |name: &str, text: &str| -> Result<PathBuf> {
        let path = dir.join(name);
        fs::write(&path, text)
            .with_context(|| format!("{}: cannot write the report", path.display()))?;
        Ok(path)
    };
    fs::create_dir_all(&dir)
        .with_context(|| format!("{}: cannot create the report folder", dir.display()))?;
    for (stem, svg) in report::figures(&data) {
        let name = format!("{stem}.svg");
        match svg {
            Some(svg) => drop(write(&name, &svg)?),
            // One of an earlier report would be taken for this one's.
            None => drop(fs::remove_file(dir.join(name))),
        }
    }
    write("index.html", &report::render(&data))
}

fn gather(folder: &SessionFolder, notes: &[(String, String)]) -> Result<ReportData> {
    let config = Config::load(Some(&folder.config_path()))?;
    let task = config.task()?;
    let (tip, object) = match task.arm() {
        Ok(arm) => (arm.solids)(&config).names(),
        Err(_) => ("", ""),
    };
    let store = open(folder.dir(), &folder.database())?;
    let trials = store.trials()?;
    let initial = store.initial_policy()?;
    let wishes = store.wishes()?;
    let learnt_rollout = best(&trials, wishes.last());
    let learnt = match trials.iter().find(|trial| trial.rollout == learnt_rollout) {
        Some(trial) => store.policy(trial.policy_id)?.unwrap_or(initial),
        None => initial,
    };
    let measures_of = |rollout| trials.iter().find(|t| t.rollout == rollout).map(|t| t.measures);
    let path = |rollout| -> Result<Vec<PathRow>> {
        let rows = store.path(rollout)?.unwrap_or_default();
        let is_vector = store.meta().learner.orientation.is_vector();
        Ok(if is_vector { rows } else { unwrapped(rows) })
    };
    Ok(ReportData {
        task: store.meta().task.clone(),
        session: folder.name(),
        seed: store.meta().learner.seed,
        config_toml: store.meta().config_toml.clone(),
        initial,
        learnt,
        learnt_rollout,
        // Rollout 1 executes the initial policy itself.
        initial_path: path(1)?,
        learnt_path: path(learnt_rollout)?,
        learnt_measures: measures_of(learnt_rollout).unwrap_or(Measures::NONE),
        notes: [wishes_text(&wishes), cells_text(&store.cells()?), notes.to_vec()].concat(),
        modes: modes::rows(&store, config.learner.prefer)?,
        timing: timing(&folder.timing(0)),
        pictures: (task.pictures)(&config),
        tip,
        object,
        success: config.success()?.unwrap_or("success"),
        trials: trials
            .iter()
            .map(|trial| TrialRow {
                rollout: trial.rollout,
                theta: trial.theta.clone(),
                reward: trial.reward,
                success: trial.success,
                is_mean: trial.is_mean,
                measures: trial.measures,
                fault: trial.fault,
            })
            .collect(),
    })
}

/// The loop's timing. A damaged file must not prevent the report.
fn timing(path: &Path) -> Result<Vec<LoopTiming>, String> {
    match TimingFile::read(path) {
        Ok(Some(file)) => Ok(file.loops().to_vec()),
        Ok(None) => Err(format!(
            "the session has no {}: none of its controllers has ended cleanly yet.",
            name_of(path)
        )),
        Err(error) => Err(format!("{}: {error}; delete it to count later runs.", name_of(path))),
    }
}

fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// What was wished for, and from when on.
fn wishes_text(wishes: &Wishes) -> Vec<(String, String)> {
    let row = |(rollout, text): (u64, &str)| {
        let text = if text.is_empty() { "anything that succeeds" } else { text };
        (format!("condition from rollout {rollout} on"), text.to_string())
    };
    wishes.texts().map(row).collect()
}

/// What the cells drove, and from which trial on.
fn cells_text(cells: &[CellRecord]) -> Vec<(String, String)> {
    let row = |row: &CellRecord| {
        let name = match row.cell.as_str() {
            "" => "arm and plant".to_string(),
            cell => format!("cell {cell}"),
        };
        let since = match row.since {
            0 | 1 => String::new(),
            since => format!(", after {} trials", since - 1),
        };
        (name, format!("{}{since}", row.describe()))
    };
    cells.iter().map(row).collect()
}

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
