//! Splitting a component of a mixture in two, Eq. (9), and merging two into one, Eq. (8).

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::gaussian::Gaussian;
use super::mixture::{Component, Mixture};

/// What Eq. (9) leaves to choose; always along the first principal axis (l = 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Split {
    pub alpha: f64,
    pub beta: f64,
    pub u: f64,
}

impl Default for Split {
    /// Sec. 4.1.1: α = β = ½, u = √¾.
    fn default() -> Self {
        Split { alpha: 0.5, beta: 0.5, u: 0.75_f64.sqrt() }
    }
}

/// √λ₁·v₁ of a covariance (D×D). Its sign, which Eq. (9) leaves open, makes the entry of largest
/// magnitude positive.
fn principal_axis(covariance: &DMatrix<f64>) -> DVector<f64> {
    let eigen = SymmetricEigen::new(covariance.clone());
    let first = eigen.eigenvalues.imax();
    let axis = eigen.eigenvectors.column(first) * eigen.eigenvalues[first].max(0.0).sqrt();
    if axis[axis.iamax()] < 0.0 { -axis } else { axis }
}

/// Eq. (9): component `i` becomes j at its place and k at the end. Prior, mean and covariance of
/// the two together are those of the one.
pub fn split(mixture: &Mixture, i: usize, Split { alpha, beta, u }: Split) -> Mixture {
    let Component { prior, gaussian } = &mixture.components[i];
    let axis = principal_axis(gaussian.covariance());
    // Ratios of πᵢ, πⱼ and πₖ, which stay defined when πᵢ vanishes.
    let (k_to_j, j_to_k) = ((1.0 - alpha) / alpha, alpha / (1.0 - alpha));
    let (i_to_j, i_to_k) = (1.0 / alpha, 1.0 / (1.0 - alpha));
    let along = &axis * axis.transpose();
    let half = |prior: f64, shift: f64, scale: f64, stretch: f64| Component {
        prior,
        gaussian: Gaussian::new(
            gaussian.mean() + &axis * shift,
            gaussian.covariance() * scale + &along * stretch,
        ),
    };
    let u2 = u * u;
    let j_stretch = (beta - beta * u2 - 1.0) * i_to_j + 1.0;
    let k_stretch = (beta * u2 - beta - u2) * i_to_k + 1.0;
    let j = half(prior * alpha, -k_to_j.sqrt() * u, k_to_j, j_stretch);
    let k = half(prior * (1.0 - alpha), j_to_k.sqrt() * u, j_to_k, k_stretch);
    let mut components = mixture.components.clone();
    components[i] = j;
    components.push(k);
    Mixture { components }
}

/// Eq. (8): components `j` < `k` become one at the place of `j`.
pub fn merge(mixture: &Mixture, j: usize, k: usize) -> Mixture {
    assert!(j < k, "components {j} and {k}");
    let mut components = mixture.components.clone();
    let other = components.remove(k);
    components[j] = moment_match(&components[j], &other);
    Mixture { components }
}

/// The Gaussian with the prior, mean and covariance of two together.
fn moment_match(j: &Component, k: &Component) -> Component {
    let prior = j.prior + k.prior;
    let share = if prior > 0.0 { k.prior / prior } else { 0.5 };
    let between = k.gaussian.mean() - j.gaussian.mean();
    let mean = j.gaussian.mean() + &between * share;
    // Σᵢ + μᵢμᵢᵀ of Eq. (8), written about μᵢ so that no large terms cancel.
    let covariance = j.gaussian.covariance() * (1.0 - share)
        + k.gaussian.covariance() * share
        + &between * between.transpose() * (share * (1.0 - share));
    Component { prior, gaussian: Gaussian::new(mean, covariance) }
}

#[cfg(test)]
mod tests;
