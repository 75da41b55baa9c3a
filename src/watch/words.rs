//! Words that every view uses for the state of a loop.

use shm_types::command::{PACE_MAX, PACE_PLANT, Status};

const PHASES: [&str; 4] = ["idle", "approach", "execute", "settle"];

pub fn phase(number: u32) -> &'static str {
    PHASES.get(number as usize).copied().unwrap_or("unknown")
}

/// What paces the loop, and its priority.
pub fn pace(status: &Status) -> &'static str {
    match (status.pace, status.privileged) {
        (PACE_MAX, _) => "full speed",
        (PACE_PLANT, 1) => "the plant's pace, SCHED_FIFO",
        (PACE_PLANT, _) => "the plant's pace, no priority",
        (_, 1) => "real time, SCHED_FIFO",
        (_, _) => "real time, no priority",
    }
}
