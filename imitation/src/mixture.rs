//! A Gaussian mixture: density and responsibilities.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::gaussian::{Gaussian, log_sum_exp, normalised};
use crate::lists::{self, Rows};

/// How far the priors may be from summing to one, and a covariance from symmetric relative to its
/// largest entry.
const TOLERANCE: f64 = 1e-9;

/// {πᵢ, μᵢ, Σᵢ}, i = 1 … K, over d coordinates. As JSON, matrices are lists of rows.
///
/// [`Mixture::new`] and reading from JSON check the values; code that changes a field must keep them valid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Lists", into = "Lists")]
pub struct Mixture {
    /// πᵢ ≥ 0; their sum is one.
    pub priors: Vec<f64>,
    /// μᵢ (d).
    pub means: Vec<DVector<f64>>,
    /// Σᵢ (d×d), symmetric positive definite.
    pub covariances: Vec<DMatrix<f64>>,
}

/// Why values are no mixture. Components are counted from 1.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum MixtureError {
    #[error("a mixture needs at least one component")]
    Empty,
    #[error("{k} priors for {means} centres and {covariances} covariances: give one each")]
    Counts { k: usize, means: usize, covariances: usize },
    #[error("the priors must be 0 or more and sum to 1: they are {0:?}")]
    Priors(Vec<f64>),
    #[error("component {0}: its centre is not finite or has another size than the first")]
    Mean(usize),
    #[error("component {0}: its covariance is not symmetric and positive definite")]
    Covariance(usize),
    #[error("a matrix has rows of unequal length")]
    Ragged,
}

impl Mixture {
    /// The checked mixture.
    pub fn new(
        priors: Vec<f64>,
        means: Vec<DVector<f64>>,
        covariances: Vec<DMatrix<f64>>,
    ) -> Result<Mixture, MixtureError> {
        check(&priors, &means, &covariances)?;
        Ok(Mixture { priors, means, covariances })
    }

    /// K.
    pub fn n_components(&self) -> usize {
        self.priors.len()
    }

    /// d.
    pub fn dim(&self) -> usize {
        self.means[0].len()
    }

    /// log Σᵢ πᵢ 𝒩(x | μᵢ, Σᵢ).
    pub fn log_density(&self, x: &DVector<f64>) -> f64 {
        log_sum_exp(&self.log_joint(x))
    }

    /// hᵢ(x) = πᵢ 𝒩(x | μᵢ, Σᵢ) / Σₖ πₖ 𝒩(x | μₖ, Σₖ), in log space: far from all centres the
    /// nearest component has all the weight, never 0/0.
    pub fn responsibilities(&self, x: &DVector<f64>) -> DVector<f64> {
        normalised(&self.log_joint(x))
    }

    /// log πᵢ 𝒩(x | μᵢ, Σᵢ) of every component.
    fn log_joint(&self, x: &DVector<f64>) -> Vec<f64> {
        log_joint(&self.priors, &self.means, &self.covariances, x)
    }
}

/// log πᵢ 𝒩(x | μᵢ, Σᵢ) of every component of a checked mixture.
pub(crate) fn log_joint(
    priors: &[f64],
    means: &[DVector<f64>],
    covariances: &[DMatrix<f64>],
    x: &DVector<f64>,
) -> Vec<f64> {
    let components = priors.iter().zip(means.iter().zip(covariances));
    components
        .map(|(prior, (mean, covariance))| {
            let gaussian = Gaussian::new(mean.clone(), covariance.clone())
                .expect("a mixture's covariances are positive definite");
            prior.ln() + gaussian.log_density(x)
        })
        .collect()
}

/// Whether these are the priors, centres and covariances of a mixture.
pub(crate) fn check(
    priors: &[f64],
    means: &[DVector<f64>],
    covariances: &[DMatrix<f64>],
) -> Result<(), MixtureError> {
    let k = priors.len();
    if k == 0 {
        return Err(MixtureError::Empty);
    }
    if means.len() != k || covariances.len() != k {
        let (means, covariances) = (means.len(), covariances.len());
        return Err(MixtureError::Counts { k, means, covariances });
    }
    let sum: f64 = priors.iter().sum();
    let are_priors = priors.iter().all(|prior| *prior >= 0.0) && (sum - 1.0).abs() <= TOLERANCE;
    if !are_priors {
        return Err(MixtureError::Priors(priors.to_vec()));
    }
    let d = means[0].len();
    for (i, (mean, covariance)) in means.iter().zip(covariances).enumerate() {
        if d == 0 || mean.len() != d || !mean.iter().all(|x| x.is_finite()) {
            return Err(MixtureError::Mean(i + 1));
        }
        let is_covariance = covariance.shape() == (d, d)
            && (covariance - covariance.transpose()).amax() <= TOLERANCE * covariance.amax()
            && Gaussian::new(mean.clone(), covariance.clone()).is_some();
        if !is_covariance {
            return Err(MixtureError::Covariance(i + 1));
        }
    }
    Ok(())
}

/// A mixture as it is written.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Lists {
    priors: Vec<f64>,
    means: Rows,
    covariances: Vec<Rows>,
}

impl From<Mixture> for Lists {
    fn from(mixture: Mixture) -> Lists {
        Lists {
            priors: mixture.priors,
            means: lists::lists(&mixture.means),
            covariances: mixture.covariances.iter().map(lists::rows).collect(),
        }
    }
}

impl TryFrom<Lists> for Mixture {
    type Error = MixtureError;

    fn try_from(written: Lists) -> Result<Mixture, MixtureError> {
        let covariances = lists::matrices(&written.covariances).ok_or(MixtureError::Ragged)?;
        Mixture::new(written.priors, lists::vectors(written.means), covariances)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two() -> Mixture {
        Mixture::new(
            vec![0.25, 0.75],
            vec![DVector::from_vec(vec![0.0, 0.0]), DVector::from_vec(vec![3.0, 1.0])],
            vec![
                DMatrix::from_row_slice(2, 2, &[1.0, 0.3, 0.3, 2.0]),
                DMatrix::from_diagonal_element(2, 2, 0.1),
            ],
        )
        .unwrap()
    }

    #[test]
    fn responsibilities_are_ratios_of_densities_and_the_nearest_wins_far_away() {
        let mixture = two();
        let x = DVector::from_vec(vec![2.0, 0.5]);
        let joint = mixture.log_joint(&x);
        let density: f64 = joint.iter().map(|log| log.exp()).sum();
        assert!((mixture.log_density(&x) - density.ln()).abs() < 1e-12);
        let h = mixture.responsibilities(&x);
        assert!((h[0] - joint[0].exp() / density).abs() < 1e-12);
        for far in [1e3, -1e6, 1e100] {
            let h = mixture.responsibilities(&DVector::from_element(2, far));
            assert_eq!(h.as_slice(), [1.0, 0.0], "the wider component wins at {far}");
        }
    }

    #[test]
    fn is_written_and_read_with_every_bit() {
        let text = serde_json::to_string(&two()).unwrap();
        assert_eq!(serde_json::from_str::<Mixture>(&text).unwrap(), two());
    }

    #[test]
    fn what_is_no_mixture_is_refused_with_the_component() {
        let broken = |change: fn(&mut Mixture)| {
            let mut mixture = two();
            change(&mut mixture);
            let Mixture { priors, means, covariances } = mixture;
            Mixture::new(priors, means, covariances).unwrap_err()
        };
        assert_eq!(broken(|m| m.priors.clear()), MixtureError::Empty);
        assert!(matches!(broken(|m| m.priors[0] = 0.5), MixtureError::Priors(_)));
        assert!(matches!(broken(|m| m.priors[0] = f64::NAN), MixtureError::Priors(_)));
        assert_eq!(broken(|m| m.means[1][0] = f64::NAN), MixtureError::Mean(2));
        assert_eq!(broken(|m| m.covariances[0][(0, 1)] = 0.4), MixtureError::Covariance(1));
        assert_eq!(broken(|m| m.covariances[1][(0, 0)] = 0.0), MixtureError::Covariance(2));
        let text = r#"{"priors":[1.0],"means":[[0.0]],"covariances":[[[-1.0]]]}"#;
        let error = serde_json::from_str::<Mixture>(text).unwrap_err().to_string();
        assert!(error.contains("component 1"), "{error}");
    }
}
