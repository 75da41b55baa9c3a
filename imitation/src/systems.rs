//! Eq. (2) as a value: linear systems, weighted by a mixture.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::gaussian::normalised;
use crate::lists::{self, Rows};
use crate::mixture::{self, MixtureError};

/// Eq. (2): ξᵒ = Σᵢ hᵢ(ξʷ)[Aᵢ ξᵀ + bᵢ], i = 1 … K, where hᵢ are the responsibilities of a Gaussian
/// mixture over ξʷ. As JSON, matrices are lists of rows.
///
/// [`Systems::new`] and reading from JSON check the values; code that changes a field must keep them valid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Lists", into = "Lists")]
pub struct Systems {
    /// πᵢ ≥ 0; their sum is one.
    pub priors: Vec<f64>,
    /// μᵢ of ξʷ (dʷ).
    pub centers: Vec<DVector<f64>>,
    /// Σᵢ of ξʷ (dʷ×dʷ), symmetric positive definite.
    pub covariances: Vec<DMatrix<f64>>,
    /// Aᵢ (dᵒ×dᵀ).
    pub A: Vec<DMatrix<f64>>,
    /// bᵢ (dᵒ).
    pub b: Vec<DVector<f64>>,
}

/// Why values are no systems. Components are counted from 1.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SystemsError {
    /// What is wrong with the weights.
    #[error(transparent)]
    Weights(#[from] MixtureError),
    #[error("{k} components have {A} matrices A and {b} vectors b: give one each")]
    Counts { k: usize, A: usize, b: usize },
    #[error("component {0}: A or b is not finite or has another size than the first")]
    System(usize),
    #[error("a matrix has rows of unequal length")]
    Ragged,
}

impl Systems {
    /// The checked systems.
    pub fn new(
        priors: Vec<f64>,
        centers: Vec<DVector<f64>>,
        covariances: Vec<DMatrix<f64>>,
        A: Vec<DMatrix<f64>>,
        b: Vec<DVector<f64>>,
    ) -> Result<Systems, SystemsError> {
        mixture::check(&priors, &centers, &covariances)?;
        if A.len() != priors.len() || b.len() != priors.len() {
            return Err(SystemsError::Counts { k: priors.len(), A: A.len(), b: b.len() });
        }
        let (outputs, inputs) = A[0].shape();
        for (i, (A, b)) in A.iter().zip(&b).enumerate() {
            let sizes_fit = A.shape() == (outputs, inputs) && b.len() == outputs;
            if !sizes_fit || !A.iter().chain(b.iter()).all(|x| x.is_finite()) {
                return Err(SystemsError::System(i + 1));
            }
        }
        Ok(Systems { priors, centers, covariances, A, b })
    }

    /// K.
    pub fn n_components(&self) -> usize {
        self.priors.len()
    }

    /// Eq. (2), weights: hᵢ(ξʷ) = πᵢ 𝒩(ξʷ | μᵢ, Σᵢ) / Σₖ πₖ 𝒩(ξʷ | μₖ, Σₖ), at `w` = ξʷ (dʷ).
    ///
    /// In log space: far from all centres the nearest component has all the weight, never 0/0.
    pub fn activations(&self, w: &DVector<f64>) -> DVector<f64> {
        normalised(&mixture::log_joint(&self.priors, &self.centers, &self.covariances, w))
    }

    /// Eq. (2): ξᵒ = Σᵢ hᵢ(ξʷ)[Aᵢ ξᵀ + bᵢ] (dᵒ) at `w` = ξʷ (dʷ) and `xi` = ξᵀ (dᵀ).
    pub fn output(&self, w: &DVector<f64>, xi: &DVector<f64>) -> DVector<f64> {
        let h = self.activations(w);
        let systems = self.A.iter().zip(&self.b);
        h.iter()
            .zip(systems)
            .fold(DVector::zeros(self.b[0].len()), |sum, (h, (A, b))| sum + (A * xi + b) * *h)
    }
}

/// Systems as they are written.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Lists {
    priors: Vec<f64>,
    centers: Rows,
    covariances: Vec<Rows>,
    A: Vec<Rows>,
    b: Rows,
}

impl From<Systems> for Lists {
    fn from(systems: Systems) -> Lists {
        Lists {
            priors: systems.priors,
            centers: lists::lists(&systems.centers),
            covariances: systems.covariances.iter().map(lists::rows).collect(),
            A: systems.A.iter().map(lists::rows).collect(),
            b: lists::lists(&systems.b),
        }
    }
}

impl TryFrom<Lists> for Systems {
    type Error = SystemsError;

    fn try_from(written: Lists) -> Result<Systems, SystemsError> {
        let matrices = |lists: &[Rows]| lists::matrices(lists).ok_or(SystemsError::Ragged);
        Systems::new(
            written.priors,
            lists::vectors(written.centers),
            matrices(&written.covariances)?,
            matrices(&written.A)?,
            lists::vectors(written.b),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In time, one input and two outputs.
    fn two() -> Systems {
        let scalar = |x: f64| DMatrix::from_element(1, 1, x);
        Systems::new(
            vec![0.5, 0.5],
            vec![DVector::from_element(1, 0.0), DVector::from_element(1, 1.0)],
            vec![scalar(0.01), scalar(0.01)],
            vec![DMatrix::from_vec(2, 1, vec![1.0, 0.0]), DMatrix::from_vec(2, 1, vec![0.0, 2.0])],
            vec![DVector::from_vec(vec![0.0, 1.0]), DVector::from_vec(vec![5.0, 0.0])],
        )
        .unwrap()
    }

    #[test]
    fn halfway_between_equal_components_both_have_half_the_weight() {
        let t = DVector::from_element(1, 0.5);
        let h = two().activations(&t);
        assert!((h[0] - 0.5).abs() < 1e-12 && (h[1] - 0.5).abs() < 1e-12);
        let output = two().output(&t, &t);
        assert!((output - DVector::from_vec(vec![2.75, 1.0])).amax() < 1e-12);
    }

    #[test]
    fn far_away_the_nearest_component_has_all_the_weight() {
        let far = DVector::from_element(1, 1e9);
        assert_eq!(two().activations(&far).as_slice(), [0.0, 1.0]);
        assert_eq!(two().output(&far, &far).as_slice(), [5.0, 2e9]);
        assert_eq!(two().activations(&-far).as_slice(), [1.0, 0.0]);
    }

    #[test]
    fn systems_are_written_and_read_with_every_bit_and_checked() {
        let text = serde_json::to_string(&two()).unwrap();
        assert_eq!(serde_json::from_str::<Systems>(&text).unwrap(), two());
        let short = text.replace(r#""b":[[0.0,1.0],[5.0,0.0]]"#, r#""b":[[0.0,1.0],[5.0]]"#);
        let error = serde_json::from_str::<Systems>(&short).unwrap_err().to_string();
        assert!(error.starts_with("component 2: A or b"), "{error}");
        let ragged = text.replace("[[1.0],[0.0]]", "[[1.0],[]]");
        assert!(serde_json::from_str::<Systems>(&ragged).is_err());
    }
}
