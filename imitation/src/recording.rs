//! A demonstrated movement: positions at a uniform rate.

use nalgebra::DMatrix;
use thiserror::Error;

/// Fewer points than this are no movement: velocities need five neighbours.
pub const MIN_POINTS: usize = 10;

/// A movement in d coordinates (of any unit: m, rad, joints) at T times, all periods equal.
///
/// [`Recording::new`] checks the values; code that changes a field must keep them valid.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// What messages call it, for example the file it came from.
    pub name: String,
    /// Time between two points, s.
    pub period_s: f64,
    /// One point a column: d×T, T ≥ [`MIN_POINTS`].
    pub points: DMatrix<f64>,
}

/// Why a recording, or a set of them, cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum RecordingError {
    #[error("{name}: {found} points: a movement needs at least {MIN_POINTS}")]
    TooFewPoints { name: String, found: usize },
    #[error("{name}: the points have no coordinates")]
    NoCoordinates { name: String },
    #[error("{name}: the period is {period_s} s: it must be positive and finite")]
    Period { name: String, period_s: f64 },
    /// Points and coordinates are counted from 1.
    #[error("{name}: coordinate {coordinate} of point {point} is not finite")]
    NotFinite { name: String, point: usize, coordinate: usize },
    #[error("there are no recordings: give at least one")]
    NoRecordings,
    #[error(
        "{name} has {found} coordinates and {first} has {expected}: give recordings of the same coordinates"
    )]
    UnequalCoordinates { name: String, found: usize, first: String, expected: usize },
}

impl Recording {
    /// The checked recording. `points` is d×T; `period_s` in s.
    pub fn new(
        name: impl Into<String>,
        period_s: f64,
        points: DMatrix<f64>,
    ) -> Result<Recording, RecordingError> {
        let name = name.into();
        if points.nrows() == 0 {
            return Err(RecordingError::NoCoordinates { name });
        }
        if points.ncols() < MIN_POINTS {
            return Err(RecordingError::TooFewPoints { name, found: points.ncols() });
        }
        if !(period_s > 0.0 && period_s.is_finite()) {
            return Err(RecordingError::Period { name, period_s });
        }
        if let Some(i) = points.iter().position(|x| !x.is_finite()) {
            let (point, coordinate) = (i / points.nrows() + 1, i % points.nrows() + 1);
            return Err(RecordingError::NotFinite { name, point, coordinate });
        }
        Ok(Recording { name, period_s, points })
    }

    /// d.
    pub fn dim(&self) -> usize {
        self.points.nrows()
    }

    /// T.
    pub fn n_points(&self) -> usize {
        self.points.ncols()
    }

    /// Time from the first to the last point, s.
    pub fn duration_s(&self) -> f64 {
        (self.n_points() - 1) as f64 * self.period_s
    }

    /// Time of point `k` (from 0) after the first, s.
    pub fn time_s(&self, k: usize) -> f64 {
        k as f64 * self.period_s
    }

    /// ẋ (d×T) by the derivative of the parabola fitted to five neighbouring points,
    ///
    /// ẋₖ = (−2xₖ₋₂ − xₖ₋₁ + xₖ₊₁ + 2xₖ₊₂) / 10h.
    ///
    /// Beyond its ends the movement is held: it starts and ends at rest.
    pub fn velocities(&self) -> DMatrix<f64> {
        self.stencil([-2.0, -1.0, 0.0, 1.0, 2.0]) / (10.0 * self.period_s)
    }

    /// ẍ (d×T) by the second derivative of the same parabola,
    ///
    /// ẍₖ = (2xₖ₋₂ − xₖ₋₁ − 2xₖ − xₖ₊₁ + 2xₖ₊₂) / 7h².
    pub fn accelerations(&self) -> DMatrix<f64> {
        self.stencil([2.0, -1.0, -2.0, -1.0, 2.0]) / (7.0 * self.period_s * self.period_s)
    }

    fn stencil(&self, weights: [f64; 5]) -> DMatrix<f64> {
        let last = self.n_points() as isize - 1;
        DMatrix::from_fn(self.dim(), self.n_points(), |c, k| {
            let at = |j: isize| self.points[(c, (k as isize + j).clamp(0, last) as usize)];
            (-2..=2).zip(weights).map(|(j, weight)| weight * at(j)).sum()
        })
    }

    /// The same movement in the same time with `n` ≥ [`MIN_POINTS`] points.
    pub fn resampled(&self, n: usize) -> Recording {
        assert!(n >= MIN_POINTS, "a recording has at least {MIN_POINTS} points");
        let step = (self.n_points() - 1) as f64 / (n - 1) as f64;
        let places: Vec<f64> = (0..n).map(|k| k as f64 * step).collect();
        Recording {
            name: self.name.clone(),
            period_s: self.duration_s() / (n - 1) as f64,
            points: self.sampled(&places),
        }
    }

    /// The movement at `places`, in points from 0 to T − 1 (d×n): on a cubic Hermite curve with the
    /// slopes of the neighbours, which has no kinks. Places beyond the ends give the ends.
    pub fn sampled(&self, places: &[f64]) -> DMatrix<f64> {
        let last = self.n_points() - 1;
        let x = |c: usize, k: usize| self.points[(c, k)];
        let slope = |c: usize, k: usize| {
            let (before, after) = (k.saturating_sub(1), (k + 1).min(last));
            (x(c, after) - x(c, before)) / (after - before) as f64
        };
        DMatrix::from_fn(self.dim(), places.len(), |c, j| {
            let place = places[j].clamp(0.0, last as f64);
            let k = (place as usize).min(last - 1);
            let u = place - k as f64;
            let (u2, u3) = (u * u, u * u * u);
            (2.0 * u3 - 3.0 * u2 + 1.0) * x(c, k)
                + (u3 - 2.0 * u2 + u) * slope(c, k)
                + (3.0 * u2 - 2.0 * u3) * x(c, k + 1)
                + (u3 - u2) * slope(c, k + 1)
        })
    }
}

/// Whether there are recordings and all have the same number of coordinates, which is returned.
pub fn check_set(recordings: &[Recording]) -> Result<usize, RecordingError> {
    let first = recordings.first().ok_or(RecordingError::NoRecordings)?;
    match recordings.iter().find(|other| other.dim() != first.dim()) {
        None => Ok(first.dim()),
        Some(other) => Err(RecordingError::UnequalCoordinates {
            name: other.name.clone(),
            found: other.dim(),
            first: first.name.clone(),
            expected: first.dim(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parabola(n: usize, period_s: f64) -> Recording {
        let points = DMatrix::from_fn(2, n, |c, k| {
            let t = k as f64 * period_s;
            if c == 0 { 1.0 + 2.0 * t + 3.0 * t * t } else { -t }
        });
        Recording::new("parabola", period_s, points).unwrap()
    }

    #[test]
    fn derivatives_are_exact_for_a_parabola_away_from_the_ends() {
        let recording = parabola(20, 0.01);
        let (velocities, accelerations) = (recording.velocities(), recording.accelerations());
        for k in 2..18 {
            assert!((velocities[(0, k)] - (2.0 + 6.0 * k as f64 * 0.01)).abs() < 1e-10);
            assert!((velocities[(1, k)] + 1.0).abs() < 1e-10);
            assert!((accelerations[(0, k)] - 6.0).abs() < 1e-8);
        }
        assert!(velocities[(1, 0)].abs() < 0.6, "the movement starts at rest");
    }

    #[test]
    fn resampling_keeps_the_ends_the_duration_and_the_curve() {
        let recording = parabola(20, 0.1);
        let finer = recording.resampled(77);
        assert!((finer.duration_s() - recording.duration_s()).abs() < 1e-12);
        assert_eq!(finer.points.column(0), recording.points.column(0));
        assert!((finer.points.column(76) - recording.points.column(19)).amax() < 1e-12);
        for k in 5..70 {
            let t = finer.time_s(k);
            assert!((finer.points[(0, k)] - (1.0 + 2.0 * t + 3.0 * t * t)).abs() < 1e-9);
        }
        assert_eq!(recording.resampled(20).points, recording.points);
    }

    #[test]
    fn what_is_no_recording_is_refused_with_its_name_and_place() {
        let made = |period_s, points| Recording::new("second.csv", period_s, points);
        let ok = DMatrix::from_element(2, 10, 0.5);
        assert!(made(0.01, ok.clone()).is_ok());
        let mut broken = ok.clone();
        broken[(1, 6)] = f64::NAN;
        let messages = [
            made(0.01, DMatrix::zeros(2, 9)),
            made(0.01, DMatrix::zeros(0, 20)),
            made(0.0, ok.clone()),
            made(f64::INFINITY, ok),
            made(0.01, broken),
        ]
        .map(|result| result.unwrap_err().to_string());
        assert!(messages.iter().all(|message| message.starts_with("second.csv: ")));
        assert_eq!(messages[4], "second.csv: coordinate 2 of point 7 is not finite");
    }

    #[test]
    fn a_set_needs_recordings_of_equal_coordinates() {
        let wide = Recording::new("wide", 0.01, DMatrix::zeros(3, 10)).unwrap();
        assert_eq!(check_set(&[]), Err(RecordingError::NoRecordings));
        assert_eq!(check_set(&[parabola(10, 0.1), parabola(30, 0.2)]), Ok(2));
        let error = check_set(&[parabola(10, 0.1), wide]).unwrap_err().to_string();
        assert!(error.starts_with("wide has 3 coordinates and parabola has 2"), "{error}");
    }
}
