//! Every method on the worlds of Sec. 4.2, 200 trials each. What tells methods apart is whether they
//! are told a box: without one the landscape has to be crossed from a corner.

use anyhow::Result;
use search::{Method, SearchConfig, build};

use super::Sample;
use super::contender::{self, CONTENDERS, TEN_WIDE};
use super::world::{TASKS, Task};

/// Methods of ours, with their default settings.
const OURS: [(&str, Method); 3] = [
    ("algorithm 1", Method::Algorithm1),
    ("tempered", Method::Tempered),
    ("regions", Method::Regions),
];

/// What the study `tune` chose, by the mean score over seeds 0 to 39. Name of the contender; settings for the landscape, the landscape in its box, the skittles.
const CHOSEN: [(&str, [u64; 3]); 9] = [
    ("random", [15, 0, 0]),
    ("PoWER", [24, 24, 26]),
    ("CEM", [7, 7, 14]),
    ("PI2-CMA", [2, 14, 4]),
    ("RWR", [37, 9, 17]),
    ("REINFORCE", [17, 23, 16]),
    ("eNAC", [9, 7, 27]),
    ("CMA-ES", [14, 20, 0]),
    ("CMA-ES restarts", [15, 20, 31]),
];

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    for task in TASKS {
        // Regions fill a box: without one they have nothing to do.
        let fits =
            |(_, method): &(&str, Method)| task != Task::Landscape || *method != Method::Regions;
        let ours = OURS.into_iter().filter(fits).map(|(name, method)| {
            let config = SearchConfig { method, ..SearchConfig::default() };
            (name, build(&config, seed, task.space()))
        });
        let others = CONTENDERS.iter().map(|&(name, contender)| {
            let chosen = setting(name, task);
            (name, contender::search(contender, chosen, TEN_WIDE, seed, task.space()))
        });
        for (name, mut search) in ours.chain(others) {
            let trials = task.run(&mut *search);
            samples.extend(task.samples(name, &trials, &*search));
        }
    }
    Ok(samples)
}

/// The number of the settings of a contender.
fn setting(name: &str, task: Task) -> u64 {
    let (_, settings) = CHOSEN.iter().find(|(other, _)| *other == name).expect("all are tuned");
    match task {
        Task::Landscape => settings[0],
        Task::LandscapeBox => settings[1],
        Task::Skittles(_) => settings[2],
    }
}
