//! `skillet soak`: two cells that learn while everything happens to them.
//!
//! In one cell both services are killed at random instants, start-up included; in the other only the
//! learner is, while its controller lives on and is watched for leaks. Policies are swapped in,
//! observers come and go. Whatever happened, a session must be that of an undisturbed run, bit for
//! bit, and every episode that was durable must have been learnt, once.

mod cell;
mod chaos;
mod footprint;
mod ledger;
mod process;
mod summary;

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};

use crate::cli::PaceArg;
use crate::stderr::say;
use cell::SoakCell;
use chaos::{Chaos, Tally};
pub use summary::Summary;

const PROGRESS: Duration = Duration::from_secs(10);

/// What to do, and for how long.
#[derive(Clone, Debug)]
pub struct Plan {
    pub time: Duration,
    /// Of each role, in the cell where both are killed.
    pub kills: Option<u64>,
    pub rollouts: u64,
    pub seed: u64,
    pub pace: PaceArg,
    pub dir: PathBuf,
}

/// Runs until the time is over, the kills are done or `stop` is set.
pub fn run(plan: &Plan, stop: &AtomicBool) -> Result<Summary> {
    let both = SoakCell::create(plan, "both")?;
    let learner = SoakCell::create(plan, "learner")?;
    let tallies = [Mutex::new(Tally::default()), Mutex::new(Tally::default())];
    let over = AtomicBool::new(false);
    let start = Instant::now();
    let results = std::thread::scope(|scope| {
        let cells = [(&both, true), (&learner, false)];
        let threads = [0, 1].map(|i| {
            let (over, tally) = (&over, &tallies[i]);
            let (cell, kills_controller) = cells[i];
            scope.spawn(move || {
                let seed = 2 * plan.seed + i as u64;
                let result = Chaos::new(cell, kills_controller, seed, over, tally).run();
                // One that failed ends the other, too.
                over.store(over.load(Ordering::Relaxed) || result.is_err(), Ordering::Relaxed);
                result
            })
        });
        watch(plan, stop, &over, &tallies, start);
        threads.map(|thread| thread.join().ok().context("a cell's thread panicked")?)
    });
    let wall = start.elapsed();
    let [both_tally, learner_tally] =
        tallies.map(|tally| tally.into_inner().unwrap_or_else(|broken| broken.into_inner()));
    let left_over = [both.left_over(), learner.left_over()].concat();
    Ok(Summary {
        wall,
        cells: [("both", both_tally), ("learner", learner_tally)],
        failures: results.into_iter().filter_map(|r| r.err().map(|e| format!("{e:#}"))).collect(),
        left_over,
    })
}

/// Says how it goes, and when it is enough.
fn watch(
    plan: &Plan,
    stop: &AtomicBool,
    over: &AtomicBool,
    tallies: &[Mutex<Tally>; 2],
    start: Instant,
) {
    let snapshot = |i: usize| match tallies[i].lock() {
        Ok(tally) => tally.clone(),
        Err(broken) => broken.into_inner().clone(),
    };
    let mut next_line = start + PROGRESS;
    while !over.load(Ordering::Relaxed) {
        let both = snapshot(0);
        let enough = plan.kills.is_some_and(|n| both.controller.kills.min(both.learner.kills) >= n);
        if enough || start.elapsed() >= plan.time || stop.load(Ordering::Relaxed) {
            over.store(true, Ordering::Relaxed);
        }
        if Instant::now() >= next_line {
            next_line += PROGRESS;
            let (minutes, line) = (start.elapsed().as_secs_f64() / 60.0, snapshot(1).line());
            let both = both.line();
            say(&format!("{minutes:5.1} min  both: {both}\n           learner: {line}"));
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    say("ending: the sessions under way are finished undisturbed");
}
