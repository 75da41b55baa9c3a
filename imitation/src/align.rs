//! Recordings of unequal timing on a common clock, by dynamic time warping.

use nalgebra::DMatrix;
use thiserror::Error;

use crate::recording::{MIN_POINTS, Recording, RecordingError, check_set};

/// Recordings whose durations differ by this factor are not of one movement.
const MAX_DURATION_RATIO: f64 = 10.0;
/// Points of each recording that are warped; clocks in between are interpolated.
const N_COMPARED: usize = 200;
/// Points at each side over which a warp is averaged, of [`N_COMPARED`]. Warping moves in steps, holding
/// one clock or the other, which would show in the velocities.
const N_SMOOTHED: usize = 5;

/// How clocks are brought together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alignment {
    /// Each is stretched evenly to the same duration.
    Linear,
    /// Each is stretched and compressed along its way, so that it is near the medoid at all times.
    Warped,
}

/// Why recordings cannot be aligned.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum AlignError {
    #[error(transparent)]
    Recordings(#[from] RecordingError),
    #[error(
        "{long} takes {long_s:.2} s and {short} only {short_s:.2} s, a tenth or less: cut the recordings to \
         the movement, or leave one out"
    )]
    Durations { long: String, long_s: f64, short: String, short_s: f64 },
}

/// The recordings with the number of points and the period of the medoid, in their order and with their
/// names: point k of each is the same moment of the movement.
///
/// The medoid is the recording with the least sum of warping distances to the others.
pub fn align(recordings: &[Recording], alignment: Alignment) -> Result<Vec<Recording>, AlignError> {
    check_set(recordings)?;
    if let Some((long, short)) = unequal_durations(recordings) {
        return Err(AlignError::Durations {
            long: long.name.clone(),
            long_s: long.duration_s(),
            short: short.name.clone(),
            short_s: short.duration_s(),
        });
    }
    let coarse: Vec<_> = recordings.iter().map(|r| r.resampled(N_COMPARED).points).collect();
    let medoid = medoid(&coarse);
    let n = recordings[medoid].n_points();
    let aligned = |(recording, path): (&Recording, &DMatrix<f64>)| {
        let points = match alignment {
            Alignment::Linear => recording.resampled(n).points,
            Alignment::Warped => {
                let clock = clock(&warp(&coarse[medoid], path), N_COMPARED);
                let scale = (recording.n_points() - 1) as f64 / (N_COMPARED - 1) as f64;
                let places: Vec<f64> =
                    (0..n).map(|k| scale * at(&clock, k as f64 / (n - 1) as f64)).collect();
                recording.sampled(&places)
            }
        };
        let period_s = recordings[medoid].period_s;
        Recording { name: recording.name.clone(), period_s, points }
    };
    Ok(recordings.iter().zip(&coarse).map(aligned).collect())
}

/// The longest and the shortest of the recordings, if the one takes ten times as long as the other.
pub(crate) fn unequal_durations(recordings: &[Recording]) -> Option<(&Recording, &Recording)> {
    let by_duration = |a: &&Recording, b: &&Recording| a.duration_s().total_cmp(&b.duration_s());
    let long = recordings.iter().max_by(by_duration)?;
    let short = recordings.iter().min_by(by_duration)?;
    (long.duration_s() >= MAX_DURATION_RATIO * short.duration_s()).then_some((long, short))
}

/// The mean (d×T) of aligned recordings, of which there is at least one, point by point.
pub fn mean_path(aligned: &[Recording]) -> DMatrix<f64> {
    let sum = aligned.iter().skip(1).fold(aligned[0].points.clone(), |sum, r| sum + &r.points);
    sum / aligned.len() as f64
}

/// The best pairing of the points of two paths.
#[derive(Clone, Debug, PartialEq)]
pub struct Warp {
    /// Sum of the distances of all pairs, in the unit of x.
    pub distance: f64,
    /// Points of the first and of the second path, from (0, 0) to the last of both, in order.
    pub pairs: Vec<(usize, usize)>,
}

/// Dynamic time warping (Sakoe and Chiba 1978) between two paths (d×T and d×T'): the pairing with the
/// least sum of distances, in which either path or both move by one point at a time.
pub fn warp(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Warp {
    let (n, m) = (a.ncols(), b.ncols());
    let mut cost = DMatrix::from_element(n, m, f64::INFINITY);
    for j in 0..m {
        for i in 0..n {
            let before = best_before(&cost, i, j).map_or(0.0, |(i, j)| cost[(i, j)]);
            cost[(i, j)] = before + a.column(i).metric_distance(&b.column(j));
        }
    }
    let mut pairs = vec![(n - 1, m - 1)];
    while let Some(before) = best_before(&cost, pairs[pairs.len() - 1].0, pairs[pairs.len() - 1].1)
    {
        pairs.push(before);
    }
    pairs.reverse();
    Warp { distance: cost[(n - 1, m - 1)], pairs }
}

/// The cheapest pair from which (i, j) is reached; both paths moving where costs are equal.
fn best_before(cost: &DMatrix<f64>, i: usize, j: usize) -> Option<(usize, usize)> {
    match (i, j) {
        (0, 0) => None,
        (0, j) => Some((0, j - 1)),
        (i, 0) => Some((i - 1, 0)),
        (i, j) => {
            let mut best = (i - 1, j - 1);
            for other in [(i - 1, j), (i, j - 1)] {
                if cost[other] < cost[best] {
                    best = other;
                }
            }
            Some(best)
        }
    }
}

/// Where the second path of a warp is at each of the `n` points of the first: the mean of those paired
/// with it, smoothed. It never runs backwards, and both paths begin and end together.
fn clock(warp: &Warp, n: usize) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); n];
    for (i, j) in &warp.pairs {
        sums[*i].0 += *j as f64;
        sums[*i].1 += 1.0;
    }
    let mut places: Vec<f64> = sums.iter().map(|(sum, count)| sum / count).collect();
    places[0] = 0.0;
    places[n - 1] = warp.pairs.last().map_or(0.0, |(_, j)| *j as f64);
    (0..n)
        .map(|k| {
            let reach = N_SMOOTHED.min(k).min(n - 1 - k);
            let around = &places[k - reach..=k + reach];
            around.iter().sum::<f64>() / around.len() as f64
        })
        .collect()
}

/// `values` at a share from 0 to 1 of their length, between neighbours on a line.
fn at(values: &[f64], share: f64) -> f64 {
    let place = share * (values.len() - 1) as f64;
    let k = (place as usize).min(values.len() - 2);
    values[k] + (place - k as f64) * (values[k + 1] - values[k])
}

/// The first recording with the least sum of warping distances to all.
fn medoid(paths: &[DMatrix<f64>]) -> usize {
    let mut sums = vec![0.0; paths.len()];
    for i in 0..paths.len() {
        for j in i + 1..paths.len() {
            let distance = warp(&paths[i], &paths[j]).distance;
            sums[i] += distance;
            sums[j] += distance;
        }
    }
    (1..sums.len()).fold(0, |best, i| if sums[i] < sums[best] { i } else { best })
}

/// A path (d×T, T ≥ 1) as `n` ≥ 2 points (d×n) at equal distances along it, both ends included.
pub fn resampled_by_length(path: &DMatrix<f64>, n: usize) -> DMatrix<f64> {
    let mut lengths = vec![0.0];
    for k in 1..path.ncols() {
        lengths.push(lengths[k - 1] + path.column(k).metric_distance(&path.column(k - 1)));
    }
    let total = lengths[path.ncols() - 1];
    let mut segment = 0;
    let mut points = DMatrix::zeros(path.nrows(), n);
    for (k, mut point) in points.column_iter_mut().enumerate() {
        let length = total * k as f64 / (n - 1) as f64;
        while segment + 2 < path.ncols() && lengths[segment + 1] < length {
            segment += 1;
        }
        let after = (segment + 1).min(path.ncols() - 1);
        let width = lengths[after] - lengths[segment];
        let share = if width > 0.0 { ((length - lengths[segment]) / width).min(1.0) } else { 0.0 };
        point.copy_from(&path.column(segment).lerp(&path.column(after), share));
    }
    points
}

const _: () = assert!(N_COMPARED >= MIN_POINTS);

#[cfg(test)]
mod tests;
