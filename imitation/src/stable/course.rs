//! The course of a recording in space: where it goes, at what speed, whatever its clock.

use nalgebra::{DMatrix, DVector};

use crate::recording::Recording;

/// Points of a course.
pub(super) const N_POINTS: usize = 400;
/// Speeds below these shares of the fastest are rest before, and after, the movement.
const STARTED: f64 = 0.1;
const ENDED: f64 = 0.02;

/// A recording between its rests, at equal distances along its path, moved so that it ends in the origin.
///
/// A field has one velocity at a place and leaves none that it rests at, so that the rest before a movement
/// is none of its business.
#[derive(Clone, Debug)]
pub(super) struct Course {
    pub name: String,
    /// d×[`N_POINTS`].
    pub points: DMatrix<f64>,
    /// Speed at each point.
    pub speeds: Vec<f64>,
    /// Time of each point in the recording, s.
    pub times_s: Vec<f64>,
}

impl Course {
    /// `None` if the recording never moves.
    pub fn new(recording: &Recording) -> Option<Course> {
        let speeds: Vec<f64> = recording.velocities().column_iter().map(|v| v.norm()).collect();
        let fastest = speeds.iter().copied().fold(0.0, f64::max);
        let moves = fastest > 0.0;
        if !moves {
            return None;
        }
        let start = speeds.iter().position(|speed| *speed > STARTED * fastest)?;
        let end = speeds.iter().rposition(|speed| *speed > ENDED * fastest)? + 1;
        let last = recording.n_points() - 1;
        let kept: Vec<usize> = (start..end).chain((end <= last).then_some(last)).collect();
        let point = |k: usize| recording.points.column(k) - recording.points.column(last);

        let mut lengths = vec![0.0];
        for pair in kept.windows(2) {
            lengths.push(lengths[lengths.len() - 1] + (point(pair[1]) - point(pair[0])).norm());
        }
        let places = equal_steps(&lengths, N_POINTS)?;
        let mut points = DMatrix::zeros(recording.dim(), N_POINTS);
        for (mut column, (k, share)) in points.column_iter_mut().zip(&places) {
            column.copy_from(&point(kept[*k]).lerp(&point(kept[k + 1]), *share));
        }
        let between = |values: &dyn Fn(usize) -> f64| {
            let value = |(k, share): &(usize, f64)| {
                (1.0 - share) * values(kept[*k]) + share * values(kept[k + 1])
            };
            places.iter().map(value).collect()
        };
        Some(Course {
            name: recording.name.clone(),
            points,
            speeds: between(&|k| speeds[k]),
            times_s: between(&|k| recording.time_s(k)),
        })
    }

    /// The diagonal of the box about it.
    pub fn extent(&self) -> f64 {
        let width = |row: usize| self.points.row(row).max() - self.points.row(row).min();
        DVector::from_fn(self.points.nrows(), |row, _| width(row)).norm()
    }
}

/// Segment and share of it for each of `n` equal steps along a path with these cumulated lengths.
fn equal_steps(lengths: &[f64], n: usize) -> Option<Vec<(usize, f64)>> {
    let total = lengths.last().copied().filter(|total| *total > 0.0)?;
    let mut segment = 0;
    let step = |k: usize| {
        let length = total * k as f64 / (n - 1) as f64;
        while segment + 2 < lengths.len() && lengths[segment + 1] < length {
            segment += 1;
        }
        let width = lengths[segment + 1] - lengths[segment];
        let share = if width > 0.0 { (length - lengths[segment]) / width } else { 0.0 };
        (segment, share.clamp(0.0, 1.0))
    };
    Some((0..n).map(step).collect())
}

/// The direction (unit vectors, d×T) of a path, of which single points may jitter or coincide: differences
/// of neighbours, averaged over 2 % of the path.
pub(super) fn directions(path: &DMatrix<f64>) -> DMatrix<f64> {
    let last = path.ncols() - 1;
    let reach = (path.ncols() / 100).max(1);
    let mut found = DMatrix::zeros(path.nrows(), path.ncols());
    for (k, mut column) in found.column_iter_mut().enumerate() {
        // The sum of the differences between neighbours is that of the ends.
        let way = path.column((k + reach).min(last)) - path.column(k.saturating_sub(reach));
        column.copy_from(&(&way / way.norm().max(f64::MIN_POSITIVE)));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rest for a second, 1 m along x in a second of even speed, rest for another.
    fn line() -> Recording {
        let points = DMatrix::from_fn(2, 301, |c, k| {
            let u = ((k as f64 - 100.0) / 100.0).clamp(0.0, 1.0);
            if c == 0 { 2.0 + u } else { 0.5 }
        });
        Recording::new("line", 0.01, points).unwrap()
    }

    #[test]
    fn a_course_has_no_rests_and_ends_in_the_origin() {
        let course = Course::new(&line()).unwrap();
        assert!((course.times_s[0] - 1.0).abs() < 0.03, "{}", course.times_s[0]);
        assert!((course.points[(0, 0)] + 1.0).abs() < 0.03);
        assert_eq!(course.points.column(N_POINTS - 1).norm(), 0.0);
        assert!((course.speeds[N_POINTS / 2] - 1.0).abs() < 1e-9);
        assert!((course.extent() - 1.0).abs() < 0.03);
        let directions = directions(&course.points);
        assert!(directions.column_iter().all(|u| (u[0] - 1.0).abs() < 1e-9));
    }

    #[test]
    fn what_never_moves_has_no_course() {
        let still = Recording::new("still", 0.01, DMatrix::from_element(3, 50, 0.25)).unwrap();
        assert!(Course::new(&still).is_none());
    }
}
