//! Words that every view uses for the state of a loop.

use shm_types::command::{PACE_MAX, PACE_PLANT, Status};

use super::Model;
use crate::record::bridged::Bridged;

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

/// The bridge that what is seen has passed, if it has.
pub fn way(model: &Model) -> Option<String> {
    match (&model.bridged, model.vitals.via()) {
        (Some(Bridged { host, hz }), _) => {
            Some(format!("through the bridge to {host}, {hz} Hz, not every tick"))
        }
        (None, Some(host)) => Some(format!("through the bridge to {host}")),
        (None, None) => None,
    }
}
