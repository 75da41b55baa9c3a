//! `skillet study`: a table over many seeds.

use std::num::NonZero;

use anyhow::{Result, bail};

use crate::Verdict;
use crate::cli::StudyArgs;
use crate::output::{print, print_json};
use crate::setup;
use crate::study::{self, STUDIES, Table};

pub fn run(args: &StudyArgs) -> Result<Verdict> {
    let Some(study) = STUDIES.iter().find(|study| study.name == args.name) else {
        let names: Vec<&str> = STUDIES.iter().map(|study| study.name).collect();
        bail!("study '{}' is not known: use one of {}", args.name, names.join(", "));
    };
    let stop = setup::stop_flag()?;
    let threads = args
        .threads
        .map_or_else(|| std::thread::available_parallelism().map_or(1, NonZero::get), NonZero::get);
    let table = study::table(study, args.first_seed, args.seeds.get(), threads, &args.out, &stop)?;
    let Some(table) = table else {
        eprintln!("stopped; the seeds that are done are kept, the same command goes on");
        return Ok(Verdict::Negative);
    };
    if args.json {
        print_json(&table)?;
    } else {
        print(&as_text(&table))?;
    }
    Ok(Verdict::Done)
}

fn as_text(table: &Table) -> String {
    let last = table.first_seed + table.seeds - 1;
    let mut text = format!("{}: seeds {}–{last}\n", table.study, table.first_seed);
    let width = |f: fn(&study::Row) -> &str| {
        table.rows.iter().map(|row| f(row).chars().count()).max().unwrap_or(0)
    };
    let (method, metric) = (width(|row| &row.method), width(|row| &row.metric));
    let number =
        |value: Option<f64>| value.map_or("–".to_string(), |value| format!("{value:.3}"));
    for row in &table.rows {
        let (value, low, high) = (number(row.value), number(row.low95), number(row.high95));
        text += &format!(
            "{:method$}  {:metric$}  {value:>8}  [{low}, {high}]\n",
            row.method, row.metric
        );
    }
    text
}
