//! `skillet trials`: all trials of a session as a table.

use std::path::Path;

use anyhow::Result;
use learner::judge::Declared;
use learner::store::{CellRecord, TrialRecord, equipment_of};
use serde_json::{Map, Value, json};
use shm_types::equipment::DIGEST_SHOWN;
use shm_types::measures::TRUTH;

use super::stored::open;
use crate::Verdict;
use crate::cli::trials::TrialsArgs;
use crate::fields;
use crate::output::{print, print_json, write_new};
use crate::session_folder::SessionFolder;
use crate::tasks;

pub fn run(args: &TrialsArgs) -> Result<Verdict> {
    let folder = SessionFolder::open(&args.session)?;
    let rows = rows(&folder)?;
    if args.json {
        let trials: Vec<Map<_, _>> = rows.into_iter().map(Map::from_iter).collect();
        print_json(&json!({ "session": folder.dir(), "trials": trials }))?;
    } else if args.csv == Path::new("-") {
        print(&as_csv(&rows)?)?;
    } else {
        write_new(&args.csv, &as_csv(&rows)?)?;
    }
    Ok(Verdict::Done)
}

/// All trials of a session as CSV.
pub fn csv_of(folder: &SessionFolder) -> Result<String> {
    as_csv(&rows(folder)?)
}

fn rows(folder: &SessionFolder) -> Result<Vec<Row>> {
    let store = open(folder.dir(), &folder.database())?;
    let (measures, task) = (&store.meta().measures, tasks::find(&store.meta().task));
    // One of another program's tasks has none that is known here.
    let units = task.map_or(&[][..], |task| task.action_units);
    let are_rated = store.meta().learner.people.takes_ratings();
    let trials = store.trials()?;
    let has_cells = trials.iter().any(|trial| !trial.cell.is_empty());
    let cells = store.cells()?;
    let cells = if has_cells || cells.len() > 1 { Some(&cells[..]) } else { None };
    let columns = Columns { are_rated, has_cells, cells, measures, units };
    Ok(trials.iter().map(|trial| row(trial, &columns)).collect())
}

type Row = Vec<(String, Value)>;

/// What the trials of a session have beside what all trials have.
struct Columns<'a> {
    are_rated: bool,
    /// A cell of some name executed them.
    has_cells: bool,
    /// What the cells drove, if that may differ from trial to trial.
    cells: Option<&'a [CellRecord]>,
    measures: &'a Declared,
    units: &'a [&'a str],
}

/// A measure that was not taken is null, in CSV nothing.
fn row(trial: &TrialRecord, columns: &Columns<'_>) -> Row {
    let Columns { are_rated, has_cells, cells, measures, units } = *columns;
    let hex = |id: u64| json!(fields::id(id));
    let mut row: Row = [
        ("rollout", json!(trial.rollout)),
        ("reward", json!(trial.reward)),
        ("success", json!(trial.success)),
        ("set_aside", json!(trial.set_aside)),
        ("fault_code", json!(trial.fault)),
        ("policy_id", json!(trial.policy_id)),
        ("policy_digest", hex(trial.policy_digest)),
        ("boot_id", hex(trial.boot_id)),
        ("applied_tick", json!(trial.applied_tick)),
        ("n_records", json!(trial.n_records)),
    ]
    .map(|(name, value)| (name.to_string(), value))
    .into();
    if has_cells {
        // Which cell executed it, and how many trials were known when it was proposed.
        row.push(("cell".into(), json!(trial.cell)));
        row.push(("asked_after".into(), json!(trial.asked_after)));
    }
    if let Some(cells) = cells {
        let drove = equipment_of(cells, &trial.cell, trial.told).filter(|_| trial.was_executed());
        row.push(("arm".into(), json!(drove.map(|drove| &drove.arm))));
        let digest = drove.map(|drove| drove.urdf_sha256.get(..DIGEST_SHOWN).unwrap_or_default());
        row.push(("arm_urdf".into(), json!(digest)));
        row.push(("plant".into(), json!(drove.map(|drove| &drove.plant))));
    }
    if are_rated {
        // What people say of it, and what it would be worth without them.
        row.push(("rating".into(), json!(trial.rating)));
        row.push(("own_reward".into(), json!(trial.own_reward)));
    }
    // Two columns of one name are one too many: a judge's program measures `reward` and `success`.
    let is_taken = |name: &str| row.iter().any(|(column, _)| column == name);
    let column = |name: &str| if is_taken(name) { format!("judge_{name}") } else { name.into() };
    let measured: Row = measures
        .iter()
        .map(|(name, unit)| match (trial.measures.get(name), unit.as_str()) {
            (Some(value), TRUTH) => (column(name), json!(value != 0.0)),
            (value, _) => (column(name), json!(value)),
        })
        .collect();
    row.extend(measured);
    row.extend(trial.theta.iter().enumerate().map(|(i, value)| {
        let unit = units.get(i).unwrap_or(&"");
        (format!("theta_{}{unit}", i + 1), json!(value))
    }));
    row
}

fn as_csv(rows: &[Row]) -> Result<String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    if let Some(first) = rows.first() {
        writer.write_record(first.iter().map(|(name, _)| name))?;
    }
    for row in rows {
        writer.write_record(row.iter().map(|(_, value)| match value {
            Value::String(text) => text.clone(),
            Value::Null => String::new(),
            other => other.to_string(),
        }))?;
    }
    Ok(String::from_utf8(writer.into_inner()?)?)
}
