//! Counts groups of good trials by a Dirichlet process of Gaussians: the paper's first wish (Sec. 4.2).

use nalgebra::{Cholesky, DMatrix, DVector};

use super::clusters::{farthest_first, nearest};

/// Sticks after which the process is cut off.
const TRUNCATION: usize = 10;
/// α: a priori about this many groups more for each e-fold of trials.
const CONCENTRATION: f64 = 1.0;
/// Expected standard deviation of a group, in widths of the box, and how many trials each belief
/// about its centre is worth.
const PRIOR_STD: f64 = 0.1;
const PRIOR_COUNT: f64 = 0.1;
const ITERATIONS: usize = 100;

/// Group of each point; a point counts as much as its weight. The posterior is approximated by
/// factors (Blei and Jordan, Bayesian Analysis 2006), with normal-Wishart Gaussians.
pub fn groups(points: &[DVector<f64>], weights: &[f64]) -> Vec<usize> {
    let centres = farthest_first(points, TRUNCATION);
    let certain =
        |point| DVector::from_fn(centres.len(), |k, _| f64::from(k == nearest(&centres, point)));
    let mut shares: Vec<DVector<f64>> = points.iter().map(certain).collect();
    let total: f64 = weights.iter().sum();
    let mean = points.iter().zip(weights).map(|(x, w)| x * *w).sum::<DVector<f64>>() / total;
    for _ in 0..ITERATIONS {
        let mut components: Vec<Component> = (0..centres.len())
            .map(|k| Component::new(points, weights, &shares, k, &mean))
            .collect();
        // A stick is broken where its group ends: groups in order of size leave fewer of them.
        components.sort_by(|a, b| b.count.total_cmp(&a.count));
        let sticks = log_sticks(&components.iter().map(|c| c.count).collect::<Vec<_>>());
        shares = points
            .iter()
            .map(|point| {
                let log = DVector::from_fn(components.len(), |k, _| {
                    sticks[k] + components[k].log_density(point)
                });
                let share = log.add_scalar(-log.max()).map(f64::exp);
                &share / share.sum()
            })
            .collect();
    }
    shares.iter().map(DVector::imax).collect()
}

/// E ln πₖ from the expected counts: vₖ ~ Beta(1 + Nₖ, α + Σ_{j>k} Nⱼ).
fn log_sticks(counts: &[f64]) -> Vec<f64> {
    let mut left: f64 = counts.iter().sum();
    let mut before = 0.0;
    let stick = |count: &f64| {
        left -= count;
        let (a, b) = (1.0 + count, CONCENTRATION + left.max(0.0));
        let log = before + digamma(a) - digamma(a + b);
        before += digamma(b) - digamma(a + b);
        log
    };
    counts.iter().map(stick).collect()
}

/// Posterior of one Gaussian: μ, Λ ~ 𝒩(m, (κΛ)⁻¹) Wishart(ν, W).
struct Component {
    count: f64,
    mean: DVector<f64>,
    kappa: f64,
    nu: f64,
    /// Cholesky factor of W⁻¹.
    cholesky: Cholesky<f64, nalgebra::Dyn>,
}

impl Component {
    fn new(
        points: &[DVector<f64>],
        weights: &[f64],
        shares: &[DVector<f64>],
        k: usize,
        prior_mean: &DVector<f64>,
    ) -> Component {
        let dim = prior_mean.len();
        let weight = |n: usize| weights[n] * shares[n][k];
        let count: f64 = (0..points.len()).map(weight).sum();
        let kappa = PRIOR_COUNT + count;
        let sum = points.iter().enumerate().map(|(n, x)| x * weight(n)).sum::<DVector<f64>>();
        let mean = (prior_mean * PRIOR_COUNT + sum) / kappa;
        // Scatter about the posterior mean: that of the data and of the prior's own trials.
        let nu_0 = dim as f64 + 2.0;
        let off = prior_mean - &mean;
        let mut scatter = DMatrix::from_diagonal_element(dim, dim, PRIOR_STD * PRIOR_STD)
            + &off * off.transpose() * PRIOR_COUNT;
        for (n, x) in points.iter().enumerate() {
            let step = x - &mean;
            scatter += &step * step.transpose() * weight(n);
        }
        let cholesky = Cholesky::new(scatter).expect("the prior makes it positive definite");
        Component { count, mean, kappa, nu: nu_0 + count, cholesky }
    }

    /// E ln 𝒩(x | μ, Λ⁻¹), up to a constant.
    fn log_density(&self, point: &DVector<f64>) -> f64 {
        let dim = self.mean.len() as f64;
        let log_det: f64 =
            (0..self.mean.len()).map(|d| digamma(0.5 * (self.nu - d as f64))).sum::<f64>()
                - self.cholesky.ln_determinant();
        let step = point - &self.mean;
        let distance = step.dot(&self.cholesky.solve(&step));
        0.5 * (log_det - dim / self.kappa - self.nu * distance)
    }
}

/// ψ(x) for x > 0: recurrence up to 6, then its asymptotic series.
fn digamma(mut x: f64) -> f64 {
    let mut value = 0.0;
    while x < 6.0 {
        value -= 1.0 / x;
        x += 1.0;
    }
    let inverse = 1.0 / (x * x);
    value + x.ln()
        - 0.5 / x
        - inverse
            * (1.0 / 12.0 - inverse * (1.0 / 120.0 - inverse * (1.0 / 252.0 - inverse / 240.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regions::clusters::clouds;

    #[test]
    fn digamma_has_its_known_values() {
        let euler = 0.577_215_664_901_532_9;
        for (x, expected) in [(1.0, -euler), (2.0, 1.0 - euler), (0.5, -euler - 4_f64.ln())] {
            assert!((digamma(x) - expected).abs() < 1e-9, "ψ({x}) = {}", digamma(x));
        }
    }

    #[test]
    fn finds_the_number_of_separate_clouds() {
        for centres in
            [&[[0.5, 0.5]][..], &[[0.2, 0.2], [0.8, 0.7]], &[[0.2, 0.2], [0.8, 0.7], [0.2, 0.9]]]
        {
            let points = clouds(centres);
            let mut labels = groups(&points, &vec![1.0; points.len()]);
            labels.sort_unstable();
            labels.dedup();
            assert_eq!(labels.len(), centres.len());
        }
    }

    #[test]
    fn one_point_or_equal_points_are_one_group() {
        let point = DVector::from_vec(vec![0.3, 0.4]);
        assert_eq!(groups(std::slice::from_ref(&point), &[1.0]), [0]);
        assert_eq!(groups(&vec![point; 8], &[0.5; 8]), [0; 8]);
    }
}
