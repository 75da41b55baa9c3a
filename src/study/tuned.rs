//! What the study `tune` chose: for each contender the number of its settings for each task, by the
//! mean score over seeds 0 to 39.

use super::comparison::Task;

/// Name of the contender; settings for the landscape, the landscape in its box, the skittles.
const CHOSEN: [(&str, [u64; 3]); 9] = [
    ("random", [0, 0, 0]),
    ("PoWER", [0, 0, 0]),
    ("CEM", [0, 0, 0]),
    ("PI2-CMA", [0, 0, 0]),
    ("RWR", [0, 0, 0]),
    ("REINFORCE", [0, 0, 0]),
    ("eNAC", [0, 0, 0]),
    ("CMA-ES", [0, 0, 0]),
    ("CMA-ES restarts", [0, 0, 0]),
];

/// The number of the settings of a contender.
pub fn setting(name: &str, task: Task) -> u64 {
    let (_, settings) = CHOSEN.iter().find(|(other, _)| *other == name).expect("all are tuned");
    match task {
        Task::Landscape => settings[0],
        Task::LandscapeBox => settings[1],
        Task::Skittles(_) => settings[2],
    }
}
