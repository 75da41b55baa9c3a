//! Places that movements pass in opposing directions.

use nalgebra::{DMatrix, DVectorView};

use super::{Problem, extent};
use crate::recording::Recording;

/// Points of each recording that are compared.
const N_COMPARED: usize = 300;
/// Places closer than this share of the extent are one place.
const NEAR: f64 = 0.02;
/// A recording passes a place twice only if it goes this many times [`NEAR`] away in between: a sharp
/// bend does not.
const AWAY: f64 = 3.0;
/// Slower than this share of the highest speed of a recording, a direction means little.
const SLOW: f64 = 0.1;
/// The share of its duration at either end that counts as an end.
const END: f64 = 0.05;

/// A recording in places with a direction each.
struct Course<'a> {
    recording: &'a Recording,
    points: DMatrix<f64>,
    velocities: DMatrix<f64>,
    period_s: f64,
    /// Where it moves, and neither starts nor ends.
    inner: Vec<usize>,
}

impl Course<'_> {
    fn new(recording: &Recording) -> Course<'_> {
        let compared = recording.resampled(N_COMPARED.min(recording.n_points()));
        let velocities = compared.velocities();
        let speeds: Vec<f64> = velocities.column_iter().map(|v| v.norm()).collect();
        let highest = speeds.iter().copied().fold(0.0, f64::max);
        let n = speeds.len();
        let ends = (n as f64 * END).ceil() as usize;
        let inner = (ends..n - ends).filter(|k| speeds[*k] > SLOW * highest).collect();
        let period_s = compared.period_s;
        Course { recording, points: compared.points, velocities, period_s, inner }
    }

    /// The first point after `k` that is further than `distance` from it.
    fn leaves(&self, k: usize, distance: f64) -> usize {
        let here = self.points.column(k);
        let is_away = |l: &usize| self.points.column(*l).metric_distance(&here) > distance;
        (k..self.points.ncols()).find(is_away).unwrap_or(self.points.ncols())
    }
}

/// The pair of places within [`NEAR`] that are passed in the most opposing directions, if those are more than
/// a right angle apart.
pub fn find(recordings: &[&Recording]) -> Option<Problem> {
    let extents: f64 = recordings.iter().map(|recording| extent(recording)).sum();
    let near = NEAR * extents / recordings.len() as f64;
    let courses: Vec<Course> = recordings.iter().map(|recording| Course::new(recording)).collect();
    let mut worst: Option<(f64, Problem)> = None;
    for (i, a) in courses.iter().enumerate() {
        for (j, b) in courses.iter().enumerate().skip(i) {
            for &k in &a.inner {
                let first = if i == j { a.leaves(k, AWAY * near) } else { 0 };
                for &l in b.inner.iter().filter(|l| **l >= first) {
                    let distance = a.points.column(k).metric_distance(&b.points.column(l));
                    if distance > near {
                        continue;
                    }
                    let cosine = cosine(&a.velocities.column(k), &b.velocities.column(l));
                    if cosine < worst.as_ref().map_or(0.0, |(cosine, _)| *cosine) {
                        worst = Some((cosine, problem((a, k), (b, l), distance, cosine)));
                    }
                }
            }
        }
    }
    worst.map(|(_, problem)| problem)
}

fn cosine(a: &DVectorView<f64>, b: &DVectorView<f64>) -> f64 {
    a.dot(b) / (a.norm() * b.norm())
}

fn problem(
    (a, k): (&Course, usize),
    (b, l): (&Course, usize),
    distance: f64,
    cosine: f64,
) -> Problem {
    Problem::Crosses {
        first: a.recording.name.clone(),
        first_s: k as f64 * a.period_s,
        second: b.recording.name.clone(),
        second_s: l as f64 * b.period_s,
        distance,
        angle_deg: cosine.clamp(-1.0, 1.0).acos().to_degrees(),
    }
}
