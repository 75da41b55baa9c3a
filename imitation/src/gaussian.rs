//! One Gaussian with its Cholesky factor, and weights of several computed in log space.

use std::f64::consts::TAU;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// 𝒩(μ, Σ) over d coordinates, ready to be evaluated.
#[derive(Clone, Debug)]
pub(crate) struct Gaussian {
    mean: DVector<f64>,
    cholesky: Cholesky<f64, Dyn>,
    /// log of (2π)^(−d/2)·|Σ|^(−1/2).
    log_normaliser: f64,
}

impl Gaussian {
    /// `covariance` is d×d; `None` unless it is positive definite.
    pub fn new(mean: DVector<f64>, covariance: DMatrix<f64>) -> Option<Gaussian> {
        let cholesky = Cholesky::new(covariance)?;
        let log_determinant = 2.0 * cholesky.l_dirty().diagonal().map(f64::ln).sum();
        let log_normaliser = -0.5 * (mean.len() as f64 * TAU.ln() + log_determinant);
        log_normaliser.is_finite().then_some(Gaussian { mean, cholesky, log_normaliser })
    }

    /// log 𝒩(x | μ, Σ).
    pub fn log_density(&self, x: &DVector<f64>) -> f64 {
        let mut white = x - &self.mean;
        self.cholesky.l_dirty().solve_lower_triangular_mut(&mut white);
        self.log_normaliser - 0.5 * white.norm_squared()
    }

    /// log 𝒩(x | μ, Σ) of every column of `points` (d×N).
    pub fn log_densities(&self, points: &DMatrix<f64>) -> Vec<f64> {
        let mut white = points.clone();
        white.column_iter_mut().for_each(|mut x| x -= &self.mean);
        self.cholesky.l_dirty().solve_lower_triangular_mut(&mut white);
        white.column_iter().map(|x| self.log_normaliser - 0.5 * x.norm_squared()).collect()
    }

    /// tr Σ⁻¹.
    pub fn precision_trace(&self) -> f64 {
        self.cholesky.inverse().trace()
    }
}

/// log Σ exp(xᵢ) without overflow; −∞ of nothing.
pub(crate) fn log_sum_exp(values: &[f64]) -> f64 {
    let max = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if max == f64::NEG_INFINITY {
        return max;
    }
    max + values.iter().map(|x| (x - max).exp()).sum::<f64>().ln()
}

/// exp(xᵢ) / Σₖ exp(xₖ). The largest exponent is subtracted first, so that the sum is at least 1.
pub(crate) fn normalised(logs: &[f64]) -> DVector<f64> {
    let max = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights = DVector::from_iterator(logs.len(), logs.iter().map(|log| (log - max).exp()));
    &weights / weights.sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn density_of_a_correlated_gaussian() {
        let covariance = DMatrix::from_row_slice(2, 2, &[4.0, 2.0, 2.0, 3.0]);
        let gaussian = Gaussian::new(DVector::from_vec(vec![1.0, -1.0]), covariance).unwrap();
        // |Σ| = 8, Σ⁻¹ = [[3, −2], [−2, 4]]/8, deviation (1, 2): dᵀΣ⁻¹d = 11/8.
        let expected = -TAU.ln() - 0.5 * 8_f64.ln() - 0.5 * 11.0 / 8.0;
        let found = gaussian.log_density(&DVector::from_vec(vec![2.0, 1.0]));
        assert!((found - expected).abs() < 1e-14, "{found} instead of {expected}");
        assert_eq!(gaussian.log_densities(&DMatrix::from_vec(2, 1, vec![2.0, 1.0])), [found]);
        assert!((gaussian.precision_trace() - 7.0 / 8.0).abs() < 1e-14);
    }

    #[test]
    fn a_flat_covariance_is_no_gaussian() {
        for flat in [[1.0, 1.0, 1.0, 1.0], [0.0; 4], [1.0, 2.0, 2.0, 1.0], [f64::NAN; 4]] {
            let covariance = DMatrix::from_row_slice(2, 2, &flat);
            assert!(Gaussian::new(DVector::zeros(2), covariance).is_none(), "{flat:?}");
        }
    }

    #[test]
    fn logarithms_survive_both_ends() {
        assert!((log_sum_exp(&[-1e6, -1e6]) - (2_f64.ln() - 1e6)).abs() < 1e-9);
        assert!((log_sum_exp(&[1e3, f64::NEG_INFINITY]) - 1e3).abs() < 1e-12);
        assert_eq!(log_sum_exp(&[]), f64::NEG_INFINITY);
        assert_eq!(normalised(&[-1e9, -2e9]).as_slice(), [1.0, 0.0]);
        assert_eq!(normalised(&[1e5, 1e5]).as_slice(), [0.5, 0.5]);
    }
}
