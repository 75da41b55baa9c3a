//! `skillet study`: many seeds in this process, tables with intervals, the paper's figures.

mod cmaes;
mod comparison;
mod contender;
mod landscape;
mod literal;
mod niching;
mod runner;
mod sample;
mod skittles;
mod statistics;
mod tune;
mod tuned;

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use anyhow::{Context, Result};
use serde::Serialize;

pub use sample::Sample;
pub use statistics::Row;

/// A study that has a table: what one seed does.
pub struct Study {
    pub name: &'static str,
    /// Raised whenever the same seed gives other numbers than before.
    pub version: u32,
    pub about: &'static str,
    pub run_seed: fn(u64) -> Result<Vec<Sample>>,
}

/// Every study, in the order of `--help`.
pub const STUDIES: &[Study] = &[
    Study {
        name: "literal",
        version: 1,
        about: "Algorithm 1 as printed, on the landscape of Sec. 4.2",
        run_seed: literal::run_seed,
    },
    Study {
        name: "comparison",
        version: 1,
        about: "every method with tuned settings, on landscape and skittles",
        run_seed: comparison::run_seed,
    },
    Study {
        name: "tune",
        version: 1,
        about: "the settings drawn for each method of the comparison",
        run_seed: tune::run_seed,
    },
    Study {
        name: "niching",
        version: 1,
        about: "all optima of the CEC 2013 functions F1 to F10",
        run_seed: niching::run_seed,
    },
];

/// The table of a study.
#[derive(Debug, Serialize)]
pub struct Table {
    pub study: String,
    pub seeds: u64,
    pub first_seed: u64,
    pub rows: Vec<Row>,
}

/// Runs `seeds` seeds from `first_seed` on; `None` when stopped before the last.
pub fn table(
    study: &Study,
    first_seed: u64,
    seeds: u64,
    threads: usize,
    out: &std::path::Path,
    stop: &AtomicBool,
) -> Result<Option<Table>> {
    std::fs::create_dir_all(out)
        .with_context(|| format!("{}: cannot create the folder", out.display()))?;
    let results: PathBuf = out.join(format!("{}.jsonl", study.name));
    let plan = runner::Plan {
        study: study.name,
        version: study.version,
        seeds: first_seed..first_seed + seeds,
        threads,
        results,
        run_seed: &study.run_seed,
    };
    let Some(samples) = runner::run(&plan, stop)? else { return Ok(None) };
    let rows = statistics::rows(&samples);
    Ok(Some(Table { study: study.name.into(), seeds, first_seed, rows }))
}
