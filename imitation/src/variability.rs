//! Stiffness from the variability of demonstrations: stiff where they agree, compliant where they differ.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use thiserror::Error;

use crate::activations::{Activations, Drive};
use crate::align::mean_path;
use crate::attractors::{Attractors, AttractorsError};
use crate::recording::{Recording, RecordingError, check_set};

/// Two recordings differ from their mean along one line at a time: they say nothing of other directions.
pub const MIN_RECORDINGS: usize = 3;
/// The least standard deviation that counts, as a share of the largest.
const RESOLUTION: f64 = 1e-3;

/// Deviations from the mean, relative to the largest coordinate, that are rounding.
const SAME: f64 = 1e-12;

/// How variability becomes attractors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VariabilityOptions {
    pub drive: Drive,
    pub n_components: usize,
    /// σ of an activation relative to the distance between centres.
    pub width_ratio: f64,
    /// Least and largest stiffness in any direction, s⁻².
    pub k_min: f64,
    pub k_max: f64,
    /// κᵛ, s⁻¹.
    pub kappa_v: f64,
}

impl Default for VariabilityOptions {
    /// 8 components over time, 50 to 500 s⁻², critically damped where it is stiffest: κᵛ = 2√k_max,
    /// so that nothing overshoots. They overlap more than those of one stiffness need to: between
    /// attractors of unlike stiffness the path is smooth only where both act.
    fn default() -> VariabilityOptions {
        VariabilityOptions {
            drive: Drive::Time,
            n_components: 8,
            width_ratio: 0.7,
            k_min: 50.0,
            k_max: 500.0,
            kappa_v: 2.0 * 500_f64.sqrt(),
        }
    }
}

/// Why variability gives no stiffness.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum VariabilityError {
    #[error(transparent)]
    Recordings(#[from] RecordingError),
    #[error(transparent)]
    Attractors(#[from] AttractorsError),
    #[error("{found} recordings: stiffness from variability needs at least {MIN_RECORDINGS}")]
    TooFew { found: usize },
    #[error(
        "{name} has {found} points at {found_s} s and {first} has {expected} at {expected_s} s: align them first"
    )]
    NotAligned {
        name: String,
        found: usize,
        found_s: f64,
        first: String,
        expected: usize,
        expected_s: f64,
    },
    #[error(
        "the recordings are all the same: variability says nothing; give them a stiffness instead"
    )]
    NoVariability,
    #[error("k_min = {k_min} and k_max = {k_max}: they must be positive, k_min the smaller")]
    Range { k_min: f64, k_max: f64 },
}

/// Eq. (5) from aligned recordings: stiffnesses Kᵢ of [`stiffnesses`] from the covariances of
/// [`covariances`], and the attractors μᵢ that follow the recordings best with them.
///
/// Coordinates count equally: scale those of unlike units first, so that one unit of each matters as much.
pub fn attractors(
    aligned: &[Recording],
    options: &VariabilityOptions,
) -> Result<Attractors, VariabilityError> {
    check_aligned(aligned)?;
    let VariabilityOptions { drive, n_components, width_ratio, k_min, k_max, kappa_v } = *options;
    let duration_s = aligned[0].duration_s();
    let activations = Activations::spread(drive, n_components, duration_s, width_ratio);
    let K = stiffnesses(&covariances(aligned, &activations)?, k_min, k_max)?;
    Ok(Attractors::fit(aligned, activations, K, kappa_v)?)
}

/// Σᵢ (d×d) of M aligned recordings about their mean x̄(t), where component i is active:
///
/// Σᵢ = Σₜ hᵢ(t) Σₘ [xₘ(t) − x̄(t)][xₘ(t) − x̄(t)]ᵀ / [(M − 1) Σₜ hᵢ(t)].
pub fn covariances(
    aligned: &[Recording],
    activations: &Activations,
) -> Result<Vec<DMatrix<f64>>, VariabilityError> {
    check_aligned(aligned)?;
    let (d, mean) = (aligned[0].dim(), mean_path(aligned));
    let mut sums = vec![(DMatrix::zeros(d, d), 0.0); activations.len()];
    for t in 0..mean.ncols() {
        let misses = aligned.iter().map(|recording| recording.points.column(t) - mean.column(t));
        let scatter = misses.fold(DMatrix::zeros(d, d), |sum, miss| sum + &miss * miss.transpose());
        let h = activations.at(aligned[0].time_s(t));
        for ((sum, weight), h) in sums.iter_mut().zip(h.iter()) {
            *sum += &scatter * *h;
            *weight += h;
        }
    }
    let points = aligned.iter().map(|recording| &recording.points);
    let same = points.clone().map(|points| (points - &mean).amax()).fold(0.0, f64::max);
    if same <= SAME * points.map(|points| points.amax()).fold(0.0, f64::max) {
        return Err(VariabilityError::NoVariability);
    }
    let degrees = (aligned.len() - 1) as f64;
    let least = f64::MIN_POSITIVE;
    Ok(sums.into_iter().map(|(sum, weight)| sum / (degrees * f64::max(weight, least))).collect())
}

/// Kᵢ (d×d, s⁻²) with the eigenvectors of Σᵢ, and eigenvalues inverse to the standard deviations σ along
/// them,
///
/// k = √(k_min k_max) σ̄/σ, limited to [k_min, k_max],
///
/// where σ̄ is the geometric mean over all components and directions.
///
/// Stiffness inverse to σ is what an optimal controller has that pays for deviations by Σ⁻¹ and for its
/// accelerations: for ẍ = u with the cost x²/σ² + r u² the gain is 1/(σ√r). Kronander and Billard (2013)
/// also let stiffness fall with the standard deviation.
///
/// Departure: Calinon et al. (2010) map eigenvalues of Σᵢ⁻¹ linearly so that the largest and the least
/// become k_max and k_min. The largest of a few inverse variances is mostly chance, yet it sets all others, and
/// demonstrations that vary equally everywhere would still be spread over the whole range. Here they get
/// √(k_min k_max) throughout.
pub fn stiffnesses(
    covariances: &[DMatrix<f64>],
    k_min: f64,
    k_max: f64,
) -> Result<Vec<DMatrix<f64>>, VariabilityError> {
    if !(k_min > 0.0 && k_min <= k_max && k_max.is_finite()) {
        return Err(VariabilityError::Range { k_min, k_max });
    }
    let eigen: Vec<_> = covariances.iter().map(|S| SymmetricEigen::new(S.clone())).collect();
    let deviation = |variance: f64| variance.max(0.0).sqrt();
    let largest = eigen.iter().map(|e| deviation(e.eigenvalues.max())).fold(0.0, f64::max);
    if largest == 0.0 {
        return Err(VariabilityError::NoVariability);
    }
    let resolved = |variance: f64| deviation(variance).max(RESOLUTION * largest);
    let logs =
        eigen.iter().flat_map(|e| e.eigenvalues.iter().map(|variance| resolved(*variance).ln()));
    let n = covariances.len() * covariances[0].nrows();
    let middle = (logs.sum::<f64>() / n as f64).exp();
    let stiffness =
        |variance: f64| ((k_min * k_max).sqrt() * middle / resolved(variance)).clamp(k_min, k_max);
    Ok(eigen
        .iter()
        .map(|e| {
            let values: DVector<f64> = e.eigenvalues.map(stiffness);
            let K = &e.eigenvectors * DMatrix::from_diagonal(&values) * e.eigenvectors.transpose();
            (&K + K.transpose()) / 2.0
        })
        .collect())
}

fn check_aligned(recordings: &[Recording]) -> Result<(), VariabilityError> {
    check_set(recordings)?;
    let first = &recordings[0];
    let fits = |other: &&Recording| {
        other.n_points() == first.n_points() && other.period_s == first.period_s
    };
    if let Some(other) = recordings.iter().find(|other| !fits(other)) {
        return Err(VariabilityError::NotAligned {
            name: other.name.clone(),
            found: other.n_points(),
            found_s: other.period_s,
            first: first.name.clone(),
            expected: first.n_points(),
            expected_s: first.period_s,
        });
    }
    if recordings.len() < MIN_RECORDINGS {
        return Err(VariabilityError::TooFew { found: recordings.len() });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
