//! What the study `tune` chose: for each contender the number of its settings for each task, by the
//! mean score over seeds 0 to 39.

use super::comparison::Task;

/// Name of the contender; settings for the landscape, the landscape in its box, the skittles.
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

/// The number of the settings of a contender.
pub fn setting(name: &str, task: Task) -> u64 {
    let (_, settings) = CHOSEN.iter().find(|(other, _)| *other == name).expect("all are tuned");
    match task {
        Task::Landscape => settings[0],
        Task::LandscapeBox => settings[1],
        Task::Skittles(_) => settings[2],
    }
}
