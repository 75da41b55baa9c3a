//! `skillet study`: many seeds in this process, tables with intervals, the paper's figures.

mod drift;
mod landscape;
mod literal;
mod runner;
mod sample;
mod statistics;

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
        name: "landscape",
        version: 1,
        about: "mixture searches on the landscape of Sec. 4.2",
        run_seed: landscape::run_seed,
    },
    Study {
        name: "drift",
        version: 1,
        about: "a landscape that moves halfway: mixture searches with and without a memory",
        run_seed: drift::run_seed,
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
