//! `skillet soak`: three cells that learn while everything happens to them.
//!
//! In one cell both services are killed at random instants, start-up included; in another only the
//! learner is, while its controller lives on and is watched for leaks. In the third the plant is a
//! process of its own and is killed, too: the controller must then hold the arm until it is re-armed.
//! Policies are swapped in, observers come and go. Whatever happened, a session must be that of an
//! undisturbed run, bit for bit, and every episode that was durable must have been learnt, once.

mod cell;
mod chaos;
mod footprint;
mod ledger;
pub mod net;
mod operator;
mod ordeal;
mod process;
mod summary;
mod tally;

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread::ScopedJoinHandle;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};

use crate::cli::PaceArg;
use crate::stderr::say;
use cell::SoakCell;
use chaos::Chaos;
use ordeal::Ordeal;
pub use summary::Summary;
use tally::{Tally, locked};

const PROGRESS: Duration = Duration::from_secs(10);

/// What to do, and for how long.
#[derive(Clone, Debug)]
pub struct Plan {
    /// As long as the kills take when absent.
    pub time: Option<Duration>,
    /// Kills of each kind, in each cell.
    pub kills: Option<u64>,
    pub rollouts: u64,
    pub seed: u64,
    pub pace: PaceArg,
    pub dir: PathBuf,
}

/// A cell, and what has happened in it.
type Soaked = (SoakCell, Mutex<Tally>);

/// Runs until the time is over, the kills are done or `stop` is set.
pub fn run(plan: &Plan, stop: &AtomicBool) -> Result<Summary> {
    let mut cells: Vec<Soaked> = Vec::new();
    for ordeal in Ordeal::ALL {
        cells.push((SoakCell::create(plan, ordeal)?, Mutex::default()));
    }
    let over = AtomicBool::new(false);
    let start = Instant::now();
    let results: Vec<Result<()>> = std::thread::scope(|scope| {
        let mut threads = Vec::new();
        for (i, (cell, tally)) in cells.iter().enumerate() {
            let seed = cells.len() as u64 * plan.seed + i as u64;
            let over = &over;
            threads.push(scope.spawn(move || {
                let result = Chaos::new(cell, seed, over, tally).run();
                // One that failed ends the others, too.
                over.store(over.load(Ordering::Relaxed) || result.is_err(), Ordering::Relaxed);
                result
            }));
        }
        watch(plan, stop, &over, &cells, start);
        let join = |thread: ScopedJoinHandle<'_, Result<()>>| {
            thread.join().ok().context("a cell's thread panicked")?
        };
        threads.into_iter().map(join).collect()
    });
    let wall = start.elapsed();
    let left_over = cells.iter().flat_map(|(cell, _)| cell.left_over()).collect();
    let end = |(cell, tally): Soaked| {
        (cell.ordeal, tally.into_inner().unwrap_or_else(PoisonError::into_inner))
    };
    Ok(Summary {
        wall,
        cells: cells.into_iter().map(end).collect(),
        failures: results.into_iter().filter_map(|r| r.err().map(|e| format!("{e:#}"))).collect(),
        left_over,
    })
}

/// Says how it goes, and when it is enough.
fn watch(plan: &Plan, stop: &AtomicBool, over: &AtomicBool, cells: &[Soaked], start: Instant) {
    let mut next_line = start + PROGRESS;
    while !over.load(Ordering::Relaxed) {
        let has = |n| cells.iter().all(|(cell, tally)| locked(tally).has_enough(cell.ordeal, n));
        let is_late = plan.time.is_some_and(|time| start.elapsed() >= time);
        if plan.kills.is_some_and(has) || is_late || stop.load(Ordering::Relaxed) {
            over.store(true, Ordering::Relaxed);
        }
        if Instant::now() >= next_line {
            next_line += PROGRESS;
            let minutes = start.elapsed().as_secs_f64() / 60.0;
            let line = |(cell, tally): &Soaked| {
                format!("\n  {:<8} {}", cell.ordeal.name(), locked(tally).line())
            };
            let lines: String = cells.iter().map(line).collect();
            say(&format!("{minutes:.1} min{lines}"));
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    say("ending: the sessions under way are finished undisturbed");
}
