//! The scores from which the settings of the comparison were chosen: every contender with each of its drawn settings.
//!
//! One metric a task (the three skittles are one) and setting; of settings with the same mean over
//! seeds 0 to 39 the first is chosen.

use anyhow::Result;

use super::Sample;
use super::contender::{self, CONTENDERS, N_SETTINGS, TEN_WIDE};
use super::world::{TASKS, Task};

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    for (name, contender) in CONTENDERS.iter().copied() {
        for setting in 0..N_SETTINGS {
            for task in TASKS {
                let mut search =
                    contender::search(contender, setting, TEN_WIDE, seed, task.space());
                let trials = task.run(&mut *search);
                let group = match task {
                    Task::Skittles(_) => "skittles",
                    _ => task.name(),
                };
                let metric = format!("{group}, setting {setting:02}");
                samples.push(Sample::mean(name, &metric, task.score(&trials, &*search)));
            }
        }
    }
    Ok(samples)
}
