//! Checks of a set of recordings before anything is learnt from them.

mod crossing;

use nalgebra::{DVector, DVectorView};
use thiserror::Error;

use crate::align::unequal_durations;
use crate::recording::Recording;

/// A recording stands still where it moves by less than [`STILL_PATH`] of its extent within this share of
/// its duration: a tenth of the rate of an even movement.
const STILL_TIME: f64 = 0.05;
const STILL_PATH: f64 = 0.005;
/// The share of its duration a recording may stand still.
const MAX_STILL: f64 = 0.5;
/// Extent, relative to the largest coordinate, below which nothing moved.
const NO_EXTENT: f64 = 1e-9;
/// Distance of an end from the middle of all ends, as a share of the mean extent, that is too far.
const MAX_END_MISS: f64 = 0.1;

/// What a movement is to be driven by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DrivenBy {
    Time,
    /// Position: ẋ is a function of x.
    State,
}

/// What is wrong with a set of recordings.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Problem {
    #[error("{name} never moves: leave it out")]
    NeverMoves { name: String },
    #[error(
        "{name} stands still for {share:.0} % of its time, longest from {from_s:.2} s to {to_s:.2} s: cut it to the movement"
    )]
    StandsStill { name: String, share: f64, from_s: f64, to_s: f64 },
    #[error(
        "{name} ends {distance:.3} away from where the others end, {share:.0} % of the extent of the \
         movements: leave it out, or record it again"
    )]
    EndsElsewhere { name: String, distance: f64, share: f64 },
    #[error(
        "{long} takes {long_s:.2} s and {short} only {short_s:.2} s: cut the longer one to the movement, or leave one out"
    )]
    UnequalDurations { long: String, long_s: f64, short: String, short_s: f64 },
    #[error(
        "{} come within {distance:.3} of each other, moving in directions {angle_deg:.0}° apart: a movement \
         that is driven by position can have only one direction there; drive it by time", crossing_places(.first, *.first_s, .second, *.second_s)
    )]
    Crosses {
        first: String,
        first_s: f64,
        second: String,
        second_s: f64,
        distance: f64,
        angle_deg: f64,
    },
}

fn crossing_places(first: &str, first_s: f64, second: &str, second_s: f64) -> String {
    if first == second {
        format!("{first} at {first_s:.2} s and at {second_s:.2} s")
    } else {
        format!("{first} at {first_s:.2} s and {second} at {second_s:.2} s")
    }
}

/// Everything that is wrong with the recordings, which have equal numbers of coordinates; empty if they can
/// be learnt from. Lengths are in the unit of the recordings.
pub fn problems(recordings: &[Recording], driven_by: DrivenBy) -> Vec<Problem> {
    let mut problems: Vec<Problem> = recordings.iter().filter_map(stands_still).collect();
    problems.extend(unequal_durations(recordings).map(|(long, short)| Problem::UnequalDurations {
        long: long.name.clone(),
        long_s: long.duration_s(),
        short: short.name.clone(),
        short_s: short.duration_s(),
    }));
    // Where nothing moves there is no extent to compare with.
    let moves = |recording: &&Recording| extent(recording) > 0.0;
    let moving: Vec<&Recording> = recordings.iter().filter(moves).collect();
    problems.extend(ends_elsewhere(&moving));
    if driven_by == DrivenBy::State {
        problems.extend(crossing::find(&moving));
    }
    problems
}

/// The diagonal of the box around a recording; 0 if it is nothing beside the numbers themselves.
fn extent(recording: &Recording) -> f64 {
    let ranges = recording.points.row_iter().map(|row| row.max() - row.min());
    let diagonal = ranges.map(|range| range * range).sum::<f64>().sqrt();
    if diagonal > NO_EXTENT * recording.points.amax() { diagonal } else { 0.0 }
}

fn stands_still(recording: &Recording) -> Option<Problem> {
    let extent = extent(recording);
    let name = recording.name.clone();
    if extent == 0.0 {
        return Some(Problem::NeverMoves { name });
    }
    let n = recording.n_points();
    let window = ((n as f64 * STILL_TIME).ceil() as usize).max(1);
    let point = |k: usize| recording.points.column(k);
    let is_still = |k: usize| (point(k + window) - point(k)).norm() < STILL_PATH * extent;
    let still: Vec<bool> = (0..n - window).map(is_still).collect();
    let share = still.iter().filter(|still| **still).count() as f64 / still.len() as f64;
    if share <= MAX_STILL {
        return None;
    }
    let (from, to) = longest_run(&still);
    Some(Problem::StandsStill {
        name,
        share: 100.0 * share,
        from_s: recording.time_s(from),
        to_s: recording.time_s(to + window),
    })
}

/// First and last index of the longest run of `true`, of which there is one.
fn longest_run(flags: &[bool]) -> (usize, usize) {
    let (mut longest, mut start) = ((0, 0), 0);
    for (k, flag) in flags.iter().enumerate() {
        if !flag {
            start = k + 1;
        } else if k - start >= longest.1 - longest.0 {
            longest = (start, k);
        }
    }
    longest
}

/// Those that end too far from the middle of all ends: the median in each coordinate, which one that is
/// far away does not move.
fn ends_elsewhere(recordings: &[&Recording]) -> Vec<Problem> {
    let Some(first) = recordings.first() else { return Vec::new() };
    let middle = DVector::from_fn(first.dim(), |c, _| {
        median(recordings.iter().map(|recording| last(recording)[c]).collect())
    });
    let extents: f64 = recordings.iter().map(|recording| extent(recording)).sum();
    let mean_extent = extents / recordings.len() as f64;
    let elsewhere = |recording: &&Recording| {
        let distance = (last(recording) - &middle).norm();
        let share = distance / mean_extent;
        let name = recording.name.clone();
        (share > MAX_END_MISS).then_some(Problem::EndsElsewhere {
            name,
            distance,
            share: 100.0 * share,
        })
    };
    recordings.iter().filter_map(elsewhere).collect()
}

fn last(recording: &Recording) -> DVectorView<'_, f64> {
    recording.points.column(recording.n_points() - 1)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    (values[(n - 1) / 2] + values[n / 2]) / 2.0
}

#[cfg(test)]
mod tests;
