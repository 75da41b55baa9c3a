//! `skillet trials`: all trials of a session as a table.

use std::path::Path;

use anyhow::Result;
use learner::store::{Store, TrialRecord};
use serde_json::{Map, Value, json};
use shm_types::episode::{OUTCOME_DROPPED, OUTCOME_EXPLOIT, OUTCOME_TOSSED};

use super::report::open;
use crate::Verdict;
use crate::cli::trials::TrialsArgs;
use crate::output::{print, print_json, write_new};
use crate::session_folder::SessionFolder;

pub fn run(args: &TrialsArgs) -> Result<Verdict> {
    let folder = SessionFolder::open(&args.session)?;
    let store = open(folder.dir(), &folder.database())?;
    let units = Units::of(&store);
    let rows: Vec<Row> = store.trials()?.iter().map(|trial| row(trial, &units)).collect();
    if args.json {
        print_json(&rows.into_iter().map(Map::from_iter).collect::<Vec<_>>())?;
    } else if args.csv == Path::new("-") {
        print(&as_csv(&rows)?)?;
    } else {
        write_new(&args.csv, &as_csv(&rows)?)?;
    }
    Ok(Verdict::Done)
}

/// Units that depend on the task, as endings of column names.
struct Units {
    value: &'static str,
    theta: &'static [&'static str],
}

impl Units {
    fn of(store: &Store) -> Units {
        match store.meta().task.as_str() {
            "skittles" => Units { value: "_m", theta: &["_rad", "_rad_s"] },
            _ => Units { value: "", theta: &[] },
        }
    }
}

type Row = Vec<(String, Value)>;

fn row(trial: &TrialRecord, units: &Units) -> Row {
    let outcome = &trial.outcome;
    let hex = |id: u64| json!(format!("{id:016x}"));
    let mut row: Row = [
        ("rollout", json!(trial.rollout)),
        ("reward", json!(trial.reward)),
        ("success", json!(trial.success())),
        ("set_aside", json!(trial.set_aside)),
        ("fault", json!(trial.fault)),
        ("policy_id", json!(trial.policy_id)),
        ("policy_digest", hex(trial.policy_digest)),
        ("boot_id", hex(trial.boot_id)),
        ("applied_tick", json!(trial.applied_tick)),
        ("n_records", json!(trial.n_records)),
        ("tossed", json!(outcome.has(OUTCOME_TOSSED))),
        ("dropped", json!(outcome.has(OUTCOME_DROPPED))),
        ("exploit", json!(outcome.has(OUTCOME_EXPLOIT))),
    ]
    .map(|(name, value)| (name.to_string(), value))
    .into();
    row.extend(outcome.fields().into_iter().map(|(name, value)| match name {
        "value" => (format!("value{}", units.value), json!(value)),
        _ => (name.to_string(), json!(value)),
    }));
    row.extend(trial.theta.iter().enumerate().map(|(i, value)| {
        let unit = units.theta.get(i).unwrap_or(&"");
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
            other => other.to_string(),
        }))?;
    }
    Ok(String::from_utf8(writer.into_inner()?)?)
}
