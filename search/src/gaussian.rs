//! One Gaussian with its Cholesky factor: log densities and draws that never overflow or panic.

use std::f64::consts::TAU;

use nalgebra::{Cholesky, DMatrix, DVector};

/// First jitter on a covariance that has no Cholesky factor, relative to its largest variance.
const JITTER: f64 = 1e-14;
/// The least variance a flat covariance is given.
const MIN_VARIANCE: f64 = 1e-100;

/// 𝒩(μ, Σ) over D parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Gaussian {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Lower L with L·Lᵀ = Σ.
    cholesky: DMatrix<f64>,
    /// log of (2π)^(−D/2)·|Σ|^(−1/2).
    log_normaliser: f64,
}

impl Gaussian {
    /// `covariance` (D×D) is finite and symmetric; only its lower half is read. Where it is flat or
    /// rounding made it indefinite, the least jitter 1e-14, 1e-13, … of its largest variance that
    /// gives a Cholesky factor is added to its diagonal.
    pub fn new(mean: DVector<f64>, covariance: DMatrix<f64>) -> Gaussian {
        assert!(covariance.iter().all(|x| x.is_finite()), "a covariance is not finite");
        let (covariance, cholesky) = factorise(covariance);
        let log_determinant = 2.0 * cholesky.diagonal().map(f64::ln).sum();
        let log_normaliser = -0.5 * (mean.len() as f64 * TAU.ln() + log_determinant);
        Gaussian { mean, covariance, cholesky, log_normaliser }
    }

    /// 𝒩(μ, variance·I).
    pub fn isotropic(mean: DVector<f64>, variance: f64) -> Gaussian {
        let dim = mean.len();
        Gaussian::new(mean, DMatrix::from_diagonal_element(dim, dim, variance))
    }

    pub fn mean(&self) -> &DVector<f64> {
        &self.mean
    }

    pub fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    pub fn dim(&self) -> usize {
        self.mean.len()
    }

    /// log of (2π)^(−D/2)·|Σ|^(−1/2).
    pub fn log_normaliser(&self) -> f64 {
        self.log_normaliser
    }

    /// (θ − μ)ᵀ Σ⁻¹ (θ − μ) of every column of `thetas` (D×n).
    pub fn squared_distances(&self, thetas: &DMatrix<f64>) -> Vec<f64> {
        let mut white = vec![0.0; self.dim()];
        let distance = |theta: &[f64]| {
            let centred = theta.iter().zip(self.mean.iter());
            white.iter_mut().zip(centred).for_each(|(white, (theta, mean))| *white = theta - mean);
            self.whiten(&mut white)
        };
        thetas.as_slice().chunks_exact(self.dim()).map(distance).collect()
    }

    /// Solves L·y = x in place; ‖y‖².
    fn whiten(&self, x: &mut [f64]) -> f64 {
        let mut sum = 0.0;
        for (j, column) in self.cholesky.as_slice().chunks_exact(self.dim()).enumerate() {
            let (solved, rest) = x[j..].split_first_mut().expect("j < D");
            *solved /= column[j];
            rest.iter_mut().zip(&column[j + 1..]).for_each(|(x, l)| *x -= l * *solved);
            sum += *solved * *solved;
        }
        sum
    }

    /// log 𝒩(θ | μ, Σ).
    pub fn log_density(&self, theta: &DVector<f64>) -> f64 {
        let mut white = theta - &self.mean;
        self.log_normaliser - 0.5 * self.whiten(white.as_mut_slice())
    }

    /// μ + L z: a draw when `z` (D) is standard normal.
    pub fn sample(&self, z: &DVector<f64>) -> DVector<f64> {
        &self.mean + &self.cholesky * z
    }
}

/// The covariance that has a Cholesky factor, and the factor.
fn factorise(covariance: DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    if let Some(cholesky) = Cholesky::new(covariance.clone()) {
        return (covariance, cholesky.unpack());
    }
    let scale = covariance.amax().max(MIN_VARIANCE);
    let mut jitter = JITTER * scale;
    // Ends: beyond D times its largest entry the diagonal dominates.
    loop {
        let mut candidate = covariance.clone();
        (0..candidate.nrows()).for_each(|i| candidate[(i, i)] += jitter);
        if let Some(cholesky) = Cholesky::new(candidate.clone()) {
            return (candidate, cholesky.unpack());
        }
        jitter *= 10.0;
    }
}

/// log Σ exp(xᵢ) without overflow; −∞ of nothing.
pub fn log_sum_exp(values: &[f64]) -> f64 {
    let max = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if max == f64::NEG_INFINITY {
        return max;
    }
    max + values.iter().map(|x| (x - max).exp()).sum::<f64>().ln()
}

/// log(exp a + exp b).
pub fn log_add(a: f64, b: f64) -> f64 {
    let (less, more) = if a < b { (a, b) } else { (b, a) };
    if less == f64::NEG_INFINITY { more } else { more + (less - more).exp().ln_1p() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn density_of_a_correlated_gaussian() {
        let covariance = DMatrix::from_row_slice(2, 2, &[4.0, 2.0, 2.0, 3.0]);
        let gaussian = Gaussian::new(DVector::from_vec(vec![1.0, -1.0]), covariance);
        // det = 8, Σ⁻¹ = [[3, −2], [−2, 4]]/8, deviation (1, 2): dᵀΣ⁻¹d = 11/8.
        let expected = -TAU.ln() - 0.5 * 8_f64.ln() - 0.5 * 11.0 / 8.0;
        let found = gaussian.log_density(&DVector::from_vec(vec![2.0, 1.0]));
        assert!((found - expected).abs() < 1e-14, "{found} instead of {expected}");
    }

    #[test]
    fn flat_covariances_get_the_least_jitter_that_works() {
        for flat in [
            DMatrix::zeros(2, 2),
            DMatrix::from_element(2, 2, 1e-200),
            DMatrix::from_element(2, 2, 1.0),
            DMatrix::from_row_slice(2, 2, &[1e12, 1e12, 1e12, 1e12 - 1e-3]),
        ] {
            let gaussian = Gaussian::new(DVector::zeros(2), flat.clone());
            let change = (gaussian.covariance() - &flat).amax();
            assert!(change <= 1e-12 * flat.amax().max(1e-100), "{change} on {flat}");
            for theta in [DVector::zeros(2), DVector::from_element(2, 1e6)] {
                assert!(gaussian.log_density(&theta).is_finite());
            }
        }
    }

    #[test]
    fn log_sum_exp_survives_both_ends() {
        assert!((log_sum_exp(&[-1e6, -1e6]) - (2_f64.ln() - 1e6)).abs() < 1e-9);
        assert!((log_sum_exp(&[1e3, f64::NEG_INFINITY]) - 1e3).abs() < 1e-12);
        assert_eq!(log_sum_exp(&[f64::NEG_INFINITY; 2]), f64::NEG_INFINITY);
        assert_eq!(log_sum_exp(&[]), f64::NEG_INFINITY);
        assert!((log_add(-1e6, -1e6 - 1.0) - (1.0 + (-1_f64).exp()).ln() + 1e6).abs() < 1e-9);
        assert_eq!(log_add(f64::NEG_INFINITY, f64::NEG_INFINITY), f64::NEG_INFINITY);
        assert_eq!(log_add(f64::NEG_INFINITY, 2.0), 2.0);
    }
}
