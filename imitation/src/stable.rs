//! Fields that come to rest at the end of the recordings from everywhere, with proof.
//!
//! [`fit`] learns ẋ = Σᵢ hᵢ(x) Aᵢ (x − x*) from recordings that share their end, x*: Eq. (2) with position as
//! its input and velocity as its output. What it searches through are only fields that have a [`Certificate`].
//!
//! ```
//! use imitation::{Recording, stable};
//! use nalgebra::{DMatrix, DVector};
//!
//! // Two arcs (m) in the plane at 100 Hz that end together.
//! let arc = |name: &str, radius: f64| {
//!     let points = DMatrix::from_fn(2, 200, |c, k| {
//!         let u = k as f64 / 199.0;
//!         let angle = std::f64::consts::PI * (1.0 - u * u * (3.0 - 2.0 * u));
//!         if c == 0 { radius * (angle.cos() - 1.0) } else { radius * angle.sin() }
//!     });
//!     Recording::new(name, 0.01, points)
//! };
//! let recordings = [arc("a", 0.2)?, arc("b", 0.22)?];
//! let options = stable::StableOptions { n_components: 4, ..Default::default() };
//! let field = stable::fit(&recordings, &options, 1)?;
//!
//! // From anywhere the motion ends where the recordings do: V falls at this rate at least, 1/s.
//! assert!(field.certificate.check(&field.systems)? > 0.0);
//! let path = field.motion(&DVector::from_vec(vec![0.3, 0.5]), 20.0, 0.01);
//! assert!((path.column(path.ncols() - 1) - &field.certificate.target).norm() < 1e-3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod certificate;
mod course;
mod field;
mod fitting;
mod lbfgs;
mod metric;
mod objective;
mod parameters;
mod samples;

use nalgebra::{DMatrix, DVector};
use thiserror::Error;

pub use certificate::{Certificate, CertificateError};
use course::{Course, N_POINTS};

use crate::gmm::GmmError;
use crate::integrate;
use crate::recording::{Recording, RecordingError, check_set};
use crate::systems::{Systems, SystemsError};

/// How a field is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StableOptions {
    /// K.
    pub n_components: usize,
    /// Fits from different mixtures; the best is kept.
    pub n_starts: usize,
    /// λ (1/s): the motion driven as ẍ = λ(f(x) − ẋ) is certified too for this λ and every larger one.
    /// Infinite: only ẋ = f(x) is.
    pub damping: f64,
    /// What the motion back to the recordings from places around them weighs beside the motion along them.
    /// 0 leaves to chance what the field does where nothing was recorded.
    pub return_weight: f64,
    /// How far a certified motion may have to stay away from a recording, as a share of its extent.
    pub max_departure: f64,
}

impl Default for StableOptions {
    fn default() -> StableOptions {
        StableOptions {
            n_components: 7,
            n_starts: 3,
            damping: 40.0,
            return_weight: 1.0,
            max_departure: 0.25,
        }
    }
}

/// A field with its proof.
#[derive(Clone, Debug, PartialEq)]
pub struct StableField {
    /// Eq. (2): ẋ = Σᵢ hᵢ(x)[Aᵢx + bᵢ].
    pub systems: Systems,
    pub certificate: Certificate,
}

/// Why recordings give no stable field.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum StableError {
    #[error(transparent)]
    Recordings(#[from] RecordingError),
    #[error("{name} never moves: leave it out")]
    NeverMoves { name: String },
    #[error("K = 0 components: a field needs at least one")]
    NoComponents,
    #[error(
        "the damping is {damping} 1/s: over movements of {duration_s:.2} s it must be above {needed:.2}"
    )]
    Damping { damping: f64, duration_s: f64, needed: f64 },
    #[error(
        "K = {k} components in {d} coordinates need {needed} points: while moving the recordings have {found}; \
         take fewer components, record more often, or record the movement again"
    )]
    TooFewPoints { k: usize, d: usize, needed: usize, found: usize },
    #[error(
        "{name} leads away from its end from {from_s:.2} s to {to_s:.2} s: a certified field would miss it by \
         {departure:.3} there, {share:.0} % of its extent; begin it later, cut it into two movements, or drive it by time"
    )]
    NoCertificate { name: String, from_s: f64, to_s: f64, departure: f64, share: f64 },
    #[error("numbers overflow: give the recordings in m, rad or another usual unit")]
    Overflow,
    #[error("no mixture fits the recordings: {0}")]
    Mixture(GmmError),
    #[error("the fit is no field: {0}")]
    Systems(SystemsError),
    #[error("the fit has no certificate: {0}")]
    Certificate(CertificateError),
}

// No `#[from]`: the text holds the cause, and a chain would repeat it.

impl From<GmmError> for StableError {
    fn from(error: GmmError) -> Self {
        StableError::Mixture(error)
    }
}

impl From<SystemsError> for StableError {
    fn from(error: SystemsError) -> Self {
        StableError::Systems(error)
    }
}

impl From<CertificateError> for StableError {
    fn from(error: CertificateError) -> Self {
        StableError::Certificate(error)
    }
}

/// Learns a field from recordings that share their end; x* is the mean of their ends.
///
/// All coordinates count alike: scale them so that equal numbers matter equally, if their units differ.
/// The same recordings, options and seed give the same field; each start takes time in proportion to the
/// recordings.
///
/// Seeks, among fields that have a certificate, the one whose motions from the recordings' starts and from
/// places along them follow the recordings in space, and whose velocities are theirs. A recording that
/// comes nearer to its end and leaves again, in the measure of every P, cannot be followed all the way.
pub fn fit(
    recordings: &[Recording],
    options: &StableOptions,
    seed: u64,
) -> Result<StableField, StableError> {
    check_set(recordings)?;
    let courses: Vec<Course> = recordings
        .iter()
        .map(|recording| {
            Course::new(recording)
                .ok_or_else(|| StableError::NeverMoves { name: recording.name.clone() })
        })
        .collect::<Result<_, _>>()?;
    check_counts(&courses, recordings, options)?;
    let ends: DVector<f64> =
        recordings.iter().map(|r| r.points.column(r.n_points() - 1).clone_owned()).sum();
    let target = ends / recordings.len() as f64;

    let scaled = fitting::Scaled::new(&courses, seed);
    for (course, departures) in courses.iter().zip(scaled.departures()) {
        check_departures(course, &departures, options.max_departure)?;
    }
    let (systems, P) = scaled.fit(options, &target, seed)?;
    let certificate = Certificate { P, target };
    certificate.check(&systems)?;
    Ok(StableField { systems, certificate })
}

/// Each component has a centre, d directions about it and a velocity to learn.
fn check_counts(
    courses: &[Course],
    recordings: &[Recording],
    options: &StableOptions,
) -> Result<(), StableError> {
    let k = options.n_components;
    if k == 0 {
        return Err(StableError::NoComponents);
    }
    let d = recordings[0].dim();
    let found = courses
        .iter()
        .zip(recordings)
        .map(|(course, recording)| {
            let moving_s = course.times_s[N_POINTS - 1] - course.times_s[0];
            (moving_s / recording.period_s).round() as usize + 1
        })
        .sum();
    let needed = k * (2 * d + 1);
    if found < needed { Err(StableError::TooFewPoints { k, d, needed, found }) } else { Ok(()) }
}

/// Whether a course is followed by a certified motion that stays as near to each of its points.
fn check_departures(course: &Course, departures: &[f64], max: f64) -> Result<(), StableError> {
    let extent = course.extent();
    let worst = (0..N_POINTS).fold(0, |w, k| if departures[k] > departures[w] { k } else { w });
    let departure = departures[worst];
    if departure <= max * extent {
        return Ok(());
    }
    let is_away = |k: &usize| departures[*k] > 0.0;
    let from = (0..=worst).rev().take_while(is_away).last().unwrap_or(worst);
    let to = (worst..N_POINTS).take_while(is_away).last().unwrap_or(worst);
    Err(StableError::NoCertificate {
        name: course.name.clone(),
        from_s: course.times_s[from],
        to_s: course.times_s[to],
        departure,
        share: 100.0 * departure / extent,
    })
}

impl StableField {
    /// f(x) (d) at `x` (d).
    pub fn velocity(&self, x: &DVector<f64>) -> DVector<f64> {
        self.systems.output(x, x)
    }

    /// The path (d×T) of ẋ = f(x) from `start`, a point each `period_s` (s) over `duration_s` (s).
    pub fn motion(&self, start: &DVector<f64>, duration_s: f64, period_s: f64) -> DMatrix<f64> {
        integrate::first_order(start, duration_s, period_s, |_, x| self.velocity(x))
    }

    /// The path (d×T) of ẍ = λ(f(x) − ẋ) from rest at `start`, with λ = `damping` (1/s): what a passive
    /// controller of that damping does with the field (Kronander and Billard 2016).
    pub fn driven(
        &self,
        start: &DVector<f64>,
        damping: f64,
        duration_s: f64,
        period_s: f64,
    ) -> DMatrix<f64> {
        integrate::from_rest(start, duration_s, period_s, |_, x, xd| {
            (self.velocity(x) - xd) * damping
        })
    }
}

#[cfg(test)]
mod tests;
