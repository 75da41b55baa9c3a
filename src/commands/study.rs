//! `skillet study`: a table over many seeds.

use std::num::NonZero;

use anyhow::{Result, bail};
use serde_json::json;

use crate::Verdict;
use crate::cli::StudyArgs;
use crate::output::{print, print_json};
use crate::setup;
use crate::signals::{Who, stop_flag};
use crate::stderr::say;
use crate::study::{self, Outcome, Request, STUDIES, Table};

pub fn run(args: &StudyArgs) -> Result<Verdict> {
    let Some(name) = &args.name else {
        match args.json {
            true => print_json(&list_json())?,
            false => print(&list())?,
        }
        return Ok(Verdict::Done);
    };
    let Some(study) = STUDIES.iter().find(|study| study.name == *name) else {
        bail!("unknown study '{name}': use one of\n{}", list());
    };
    let stop = stop_flag(Who::Tool)?;
    if let Some(parent) = args.child {
        setup::end_with_parent(parent)?;
    }
    let threads = args
        .threads
        .map_or_else(|| std::thread::available_parallelism().map_or(1, NonZero::get), NonZero::get);
    let request =
        Request { first_seed: args.first_seed, seeds: args.seeds.get(), threads, out: &args.out };
    match study::run(study, &request, &stop)? {
        Outcome::Table { table, figure } if args.json => print_json(&json!({
            "study": table.study,
            "seeds": table.seeds,
            "first_seed": table.first_seed,
            "rows": table.rows,
            "figure": figure,
        }))?,
        Outcome::Table { table, figure } => {
            print(&format!("{}figure  {}\n", as_text(&table), figure.display()))?;
        }
        Outcome::Figure { figure } if args.json => {
            print_json(&json!({ "study": study.name, "figure": figure }))?;
        }
        Outcome::Figure { figure } => print(&format!("{}\n", figure.display()))?,
        Outcome::Stopped => {
            if args.json {
                print_json(&json!({ "study": study.name, "interrupted": true }))?;
            }
            say("stopped; finished seeds are kept, rerun the command to continue");
            return Ok(Verdict::Negative);
        }
    }
    Ok(Verdict::Done)
}

fn as_text(table: &Table) -> String {
    let last = table.first_seed + table.seeds - 1;
    let mut text = format!(
        "{}: seeds {}–{last}; value [95 % interval]  range over the seeds\n",
        table.study, table.first_seed
    );
    let width = |f: fn(&study::Row) -> &str| {
        table.rows.iter().map(|row| f(row).chars().count()).max().unwrap_or(0)
    };
    let (method, metric) = (width(|row| &row.method), width(|row| &row.metric));
    let number =
        |value: Option<f64>| value.map_or("–".to_string(), |value| format!("{value:.3}"));
    for row in &table.rows {
        let (value, low, high) = (number(row.value), number(row.low95), number(row.high95));
        let (min, max) = (number(row.min), number(row.max));
        text += &format!(
            "{:method$}  {:metric$}  {value:>8}  [{low}, {high}]  {min} to {max}\n",
            row.method, row.metric
        );
    }
    text
}

fn list_json() -> serde_json::Value {
    let object = |study: &study::Study| json!({ "study": study.name, "about": study.about });
    json!({ "studies": STUDIES.iter().map(object).collect::<Vec<_>>() })
}

/// Name and purpose of every study, a line each.
fn list() -> String {
    let line = |study: &study::Study| format!("  {:18} {}\n", study.name, study.about);
    STUDIES.iter().map(line).collect()
}
