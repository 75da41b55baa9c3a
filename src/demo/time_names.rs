//! Which names of columns mean a time.

use super::names::{self, unit};

/// Whole names of a time, the more particular ones first.
const NAMES: [&str; 19] = [
    "t",
    // rostopic: when it was measured, before when it was received.
    "field header stamp",
    "time",
    "timestamp",
    "time stamp",
    "stamp",
    "header stamp",
    "time from start",
    "elapsed time",
    "time elapsed",
    "elapsed",
    "relative time",
    "rel time",
    "sim time",
    "robot time",
    "log time",
    "record time",
    "clock",
    "epoch",
];
/// A name that ends so is one, too, if there is no better one.
const ENDINGS: [&str; 3] = ["header stamp", "timestamp", "time stamp"];

/// How well a name fits; the lowest fits best.
pub fn rank(words: &[String]) -> Option<usize> {
    let name = words.join(" ");
    if let Some(rank) = NAMES.iter().position(|known| *known == name) {
        return Some(rank);
    }
    let ending = ENDINGS.iter().position(|ending| name.ends_with(ending));
    if let Some(rank) = ending {
        return Some(NAMES.len() + rank);
    }
    // A column called `seconds`.
    let is_unit = words.len() == 1 && unit(names::TIME, &name).is_some();
    is_unit.then_some(NAMES.len() + ENDINGS.len())
}

/// The name of a time; a bare unit is none here, for it may stand in a row of units.
pub fn is_name(words: &[String]) -> bool {
    rank(words).is_some_and(|rank| rank < NAMES.len() + ENDINGS.len())
}
