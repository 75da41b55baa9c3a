//! The plane of the two principal axes of the trials: where a hundred parameters vary most.

use nalgebra::{DMatrix, DVector};
use search::Mode;

/// y = Vᵀ(θ − θ̄), θ̄ the mean of the trials and V (D×2) the first two right singular vectors of
/// the matrix of their deviations.
pub struct Principal {
    mean: DVector<f64>,
    axes: DMatrix<f64>,
    /// Shares of the trials' variance along each axis.
    pub shares: [f64; 2],
}

impl Principal {
    /// `None` if the trials do not span a plane, or are not all of one dimension.
    pub fn of(thetas: &[&DVector<f64>]) -> Option<Principal> {
        let dim = thetas.first()?.len();
        if dim < 2 || thetas.len() < 3 || thetas.iter().any(|theta| theta.len() != dim) {
            return None;
        }
        let sum = thetas.iter().fold(DVector::zeros(dim), |sum, theta| sum + *theta);
        let mean: DVector<f64> = sum / thetas.len() as f64;
        let deviations = DMatrix::from_fn(thetas.len(), dim, |trial, i| thetas[trial][i] - mean[i]);
        let svd = deviations.svd(false, true);
        let variances = svd.singular_values.map(|s| s * s);
        let total = variances.sum();
        if !total.is_finite() || variances[1] <= 1e-12 * total {
            return None;
        }
        let mut axes = svd.v_t?.rows(0, 2).transpose();
        for mut axis in axes.column_iter_mut() {
            // Either sign would do; this one does not depend on the decomposition.
            if axis[axis.icamax()] < 0.0 {
                axis.neg_mut();
            }
        }
        Some(Principal { mean, axes, shares: [variances[0] / total, variances[1] / total] })
    }

    pub fn project(&self, theta: &DVector<f64>) -> DVector<f64> {
        self.axes.tr_mul(&(theta - &self.mean))
    }

    /// The mode's marginal distribution in the plane: Vᵀ(μ − θ̄), VᵀΣV.
    pub fn mode(&self, mode: &Mode) -> Mode {
        Mode {
            prior: mode.prior,
            mean: self.project(&mode.mean),
            covariance: self.axes.tr_mul(&mode.covariance) * &self.axes,
        }
    }

    pub fn dim(&self) -> usize {
        self.mean.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points that vary by 3 along (3, 4)/5, by 1 along (−4, 3)/5 of the first two coordinates.
    fn thetas() -> Vec<DVector<f64>> {
        [(3.0, 0.0), (-3.0, 0.0), (0.0, 1.0), (0.0, -1.0)]
            .map(|(a, b)| DVector::from_vec(vec![1.0 + 0.6 * a - 0.8 * b, 0.8 * a + 0.6 * b, 7.0]))
            .to_vec()
    }

    #[test]
    fn axes_are_those_of_the_largest_variance() {
        let thetas = thetas();
        let plane = Principal::of(&thetas.iter().collect::<Vec<_>>()).unwrap();
        assert!((plane.shares[0] - 0.9).abs() < 1e-12 && (plane.shares[1] - 0.1).abs() < 1e-12);
        let first = plane.project(&thetas[0]);
        assert!((first[0] - 3.0).abs() < 1e-12 && first[1].abs() < 1e-12, "{first}");

        let covariance = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 4.0, 9.0]));
        let mode = plane.mode(&Mode { prior: 0.5, mean: thetas[2].clone(), covariance });
        assert!((mode.covariance[(0, 0)] - (0.36 + 0.64 * 4.0)).abs() < 1e-12);
        assert!((mode.covariance[(0, 1)] - mode.covariance[(1, 0)]).abs() < 1e-12);
    }

    #[test]
    fn a_line_and_a_point_are_no_plane() {
        let thetas = thetas();
        let line: Vec<_> = [&thetas[0], &thetas[1], &thetas[0]].to_vec();
        assert!(Principal::of(&line).is_none());
        assert!(Principal::of(&[]).is_none());
        let other = DVector::zeros(2);
        assert!(Principal::of(&[&thetas[0], &thetas[2], &other]).is_none());
    }
}
