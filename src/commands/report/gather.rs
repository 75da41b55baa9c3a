//! What a report shows of a session: from its folder, and from rollouts executed again.

use std::fs;
use std::path::Path;

use anyhow::Result;
use learner::judge::Judge;
use learner::store::{CellRecord, Store, TrialRecord};
use learner::wish::Wishes;
use rt_controller::disk::timing_file::{LoopTiming, TimingFile};
use shm_types::measures::Measures;
use shm_types::policy::PolicyMsg;

use super::films::Projector;
use super::{robustness, write_file};
use crate::commands::stored::{best, open};
use crate::commands::{modes, replay, trials};
use crate::config::Config;
use crate::provenance;
use crate::report::{
    Film, LinkTo, ModeRow, Origin, Pictures, ReportData, Robustness, Session, Term, TrialRow,
    follows_tip,
};
use crate::session_folder::SessionFolder;
use crate::{judging, setup};

/// Trials as a table, and the shown rollout as a recording, beside the page.
const TABLE: &str = "trials.csv";
const RECORDING: &str = "rollout.mcap";
/// Modes that are shown in motion.
const MODES_IN_MOTION: usize = 6;

/// How much a report may execute again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Effort {
    /// The rollouts that are shown.
    Quick,
    /// The selected policy in other worlds, too, which takes some seconds.
    Whole,
}

/// All of one session. Tables and recordings are written into `dir`.
pub fn session(
    folder: &SessionFolder,
    notes: &[(String, String)],
    effort: Effort,
    dir: &Path,
) -> Result<ReportData> {
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
    let shown = trials.iter().find(|trial| trial.rollout == learnt_rollout);
    let learnt = match shown {
        Some(trial) => store.policy(trial.policy_id)?.unwrap_or(initial),
        None => initial,
    };
    let mut projector = Projector::new(&store, &config, &trials);
    let (film, replayed) = projector.film(learnt_rollout)?;
    let object = if follows_tip(&film.path) { "" } else { object };
    let look = projector.look(&config, replayed.is_some());
    let recorded = shown.zip(replayed.as_ref());
    let files = files(folder, dir, recorded, &config)?;
    let modes = modes_in_motion(modes::rows(&store, config.learner.prefer)?, &mut projector)?;
    Ok(ReportData {
        task: store.meta().task.clone(),
        session: folder.name(),
        seed: store.meta().learner.seed,
        config_toml: store.meta().config_toml.clone(),
        initial,
        learnt,
        learnt_rollout,
        // Rollout 1 executes the initial policy itself.
        initial_path: projector.path(1)?,
        film,
        look,
        demonstrations: setup::demonstrations_of(&config),
        learnt_measures: shown.map_or(Measures::NONE, |trial| trial.measures),
        notes: [wishes_text(&wishes), cells_text(&store.cells()?), notes.to_vec()].concat(),
        robustness: robustness(&config, &store, &modes, &learnt, effort, folder.dir()),
        modes,
        timing: timing(&folder.timing(0)),
        pictures: (task.pictures)(&config),
        tip,
        object,
        success: config.success()?,
        terms: judging::judge(&config).map_or_else(
            |_| Vec::new(),
            |judge| terms(&judge.keeping(&store.meta().measures), &trials),
        ),
        trials: trials.iter().map(trial_row).collect(),
        origin: origin(folder),
        files,
    })
}

/// Several sessions, as much of each as a page of all of them shows. Links lead from `dir` to their own reports.
pub fn sessions(folders: &[SessionFolder], dir: &Path) -> Result<Vec<Session>> {
    let session = |folder: &SessionFolder| -> Result<Session> {
        let config = Config::load(Some(&folder.config_path()))?;
        let store = open(folder.dir(), &folder.database())?;
        let page = folder.report_dir().join("index.html");
        let page = page.is_file().then(|| relative(dir, &page)).flatten();
        Ok(Session {
            name: folder.name(),
            task: store.meta().task.clone(),
            seed: store.meta().learner.seed,
            settings: settings(&config)?,
            success: config.success()?,
            trials: store.trials()?.iter().map(trial_row).collect(),
            origin: origin(folder),
            page,
        })
    };
    folders.iter().map(session).collect()
}

/// What tells kinds of sessions from each other: the configuration without its seed and where its files lie.
fn settings(config: &Config) -> Result<String> {
    let mut config = config.clone();
    (config.learner.seed, config.learner.rollouts) = (0, 0);
    (config.task.demonstration, config.plant.arm) = (None, None);
    config.to_toml()
}

/// The way from a folder to a file, where both exist.
fn relative(from: &Path, to: &Path) -> Option<String> {
    fs::create_dir_all(from).ok()?;
    let (from, to) = (from.canonicalize().ok()?, to.canonicalize().ok()?);
    let common = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    let up = from.components().skip(common).map(|_| "..".to_owned());
    let down = to.components().skip(common).map(|c| c.as_os_str().to_string_lossy().into_owned());
    Some(up.chain(down).collect::<Vec<_>>().join("/"))
}

fn trial_row(trial: &TrialRecord) -> TrialRow {
    TrialRow {
        rollout: trial.rollout,
        theta: trial.theta.clone(),
        reward: trial.reward,
        success: trial.success,
        is_mean: trial.is_mean,
        measures: trial.measures,
        fault: trial.fault,
    }
}

/// What each summand of the reward was in every trial; fewer than two say nothing.
fn terms(judge: &Judge, trials: &[TrialRecord]) -> Vec<Term> {
    let mut terms: Vec<Term> = Vec::new();
    for (i, trial) in trials.iter().enumerate() {
        for (name, value) in judge.terms(&trial.measures) {
            let k = terms.iter().position(|term| term.name == name).unwrap_or_else(|| {
                terms.push(Term { name, values: vec![0.0; trials.len()] });
                terms.len() - 1
            });
            terms[k].values[i] = value;
        }
    }
    if terms.len() < 2 { Vec::new() } else { terms }
}

/// The best rollout of each of the first modes, as it moved.
fn modes_in_motion(mut modes: Vec<ModeRow>, projector: &mut Projector) -> Result<Vec<ModeRow>> {
    if modes.len() > 1 {
        for row in modes.iter_mut().take(MODES_IN_MOTION) {
            if let Some((rollout, _)) = row.best {
                let (film, _) = projector.film(rollout)?;
                row.film = Some(film).filter(|film: &Film| film.path.len() > 1);
            }
        }
    }
    Ok(modes)
}

/// The policy that `skillet policy export` writes, in other worlds.
fn robustness(
    config: &Config,
    store: &Store,
    modes: &[ModeRow],
    learnt: &PolicyMsg,
    effort: Effort,
    session: &Path,
) -> Result<Robustness, String> {
    let pictures = config.task().map(|task| (task.pictures)(config));
    if !pictures.is_ok_and(|pictures| matches!(pictures, Pictures::Toss)) {
        return Err("this task has no other worlds to try its policy in.".into());
    }
    if config.plant.is_external() {
        return Err("the plant of the session is another process.".into());
    }
    if effort == Effort::Quick {
        return Err(format!(
            "run `skillet report {}` to measure it; it takes some seconds.",
            session.display()
        ));
    }
    let selected = modes.iter().find(|row| row.is_answer);
    let of_mode = selected.and_then(|row| {
        let policy = store.policy(row.policy_id).ok().flatten()?;
        Some((
            policy,
            format!("the selected policy, {}, the mean of mode {}", row.policy_id, row.number),
        ))
    });
    let (policy, name) =
        of_mode.unwrap_or_else(|| (*learnt, format!("the policy of rollout {}", learnt.rollout)));
    robustness::measure(config, &policy, name).map_err(|error| format!("{error:#}."))
}

/// Writes the table of all trials and, if it was executed again, the shown rollout as a recording.
fn files(
    folder: &SessionFolder,
    dir: &Path,
    recorded: Option<(&TrialRecord, &replay::Replayed)>,
    config: &Config,
) -> Result<Vec<LinkTo>> {
    write_file(&dir.join(TABLE), &trials::csv_of(folder)?)?;
    let mut files = vec![LinkTo::new("all trials, CSV", TABLE)];
    // Recordings replace none.
    drop(fs::remove_file(dir.join(RECORDING)));
    if let Some((trial, replayed)) = recorded {
        replay::write(config, trial, replayed, &dir.join(RECORDING))?;
        files.push(LinkTo::new(format!("rollout {}, MCAP", trial.rollout), RECORDING));
    }
    let whole = folder.dir().join("recording.mcap");
    if let Some(way) = whole.is_file().then(|| relative(dir, &whole)).flatten() {
        files.push(LinkTo::new("all rollouts, MCAP", way));
    }
    Ok(files)
}

/// Where the session comes from. A damaged file must not prevent the report.
fn origin(folder: &SessionFolder) -> Origin {
    let runs = provenance::read(&folder.provenance()).map_err(|error| format!("{error:#}"));
    Origin { runs }
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
