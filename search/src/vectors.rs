//! Reads reference vectors for the tests of the searches.

use std::path::PathBuf;

use nalgebra::{DMatrix, DVector};
use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::gaussian::Gaussian;
use super::mixture::{Component, Mixture};
use crate::trial::Trial;

/// A file of `tests/vectors`, or of the directory `SKILLET_VECTORS` names.
pub fn read<T: DeserializeOwned>(name: &str) -> T {
    let directory = std::env::var_os("SKILLET_VECTORS").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/vectors")),
        PathBuf::from,
    );
    let path = directory.join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path:?}: {e}"));
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{path:?}: {e}"))
}

pub fn matrix(rows: &[Vec<f64>]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), rows.len(), |i, j| rows[i][j])
}

pub fn trials(thetas: &[Vec<f64>], rewards: &[f64]) -> Vec<Trial> {
    let trial = |((i, theta), &reward): ((usize, &Vec<f64>), &f64)| Trial {
        rollout: i as u64 + 1,
        theta: DVector::from_vec(theta.clone()),
        reward,
        success: false,
        measured: Vec::new(),
    };
    thetas.iter().enumerate().zip(rewards).map(trial).collect()
}

/// A mixture as the files write it.
#[derive(Deserialize)]
pub struct Gmm {
    pi: Vec<f64>,
    mu: Vec<Vec<f64>>,
    sigma: Vec<Vec<Vec<f64>>>,
}

impl Gmm {
    pub fn mixture(&self) -> Mixture {
        let component = |i: usize| Component {
            prior: self.pi[i],
            gaussian: Gaussian::new(
                DVector::from_column_slice(&self.mu[i]),
                matrix(&self.sigma[i]),
            ),
        };
        Mixture { components: (0..self.pi.len()).map(component).collect() }
    }

    /// Every prior, mean and covariance of `found` within `tolerance` of the largest entry.
    pub fn assert_close(&self, found: &Mixture, tolerance: f64) {
        let expected = self.mixture();
        assert_eq!(found.components.len(), expected.components.len(), "K");
        for (i, (found, expected)) in found.components.iter().zip(&expected.components).enumerate()
        {
            close(found.prior, expected.prior, tolerance);
            let (a, b) = (&found.gaussian, &expected.gaussian);
            let error = (a.mean() - b.mean()).amax() / b.mean().amax();
            assert!(error <= tolerance, "mean {i} is off by {error:e}");
            let error = (a.covariance() - b.covariance()).amax() / b.covariance().amax();
            assert!(error <= tolerance, "covariance {i} is off by {error:e}");
        }
    }
}

/// `found` within `tolerance`·|expected|.
pub fn close(found: f64, expected: f64, tolerance: f64) {
    let error = (found - expected).abs();
    assert!(error <= tolerance * expected.abs(), "{found} instead of {expected}");
}
