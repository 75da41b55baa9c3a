//! A smooth Gaussian process with one length: in many dimensions, too, some trials tell the slope and
//! curvature of what lies around them.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Share of the variance that even the nearest trials do not explain.
const NUGGET: f64 = 1e-4;
/// Lengths that are compared, in widths of the box.
const LENGTHS: [f64; 7] = [0.2, 0.3, 0.45, 0.7, 1.0, 1.5, 2.2];

/// A process with the kernel exp(−d²/2), d in lengths, given the values of some points.
pub struct Smooth {
    points: Vec<DVector<f64>>,
    length: f64,
    /// Cholesky factor of the kernel matrix K of the points.
    factor: Cholesky<f64, Dyn>,
    mean: f64,
    /// K⁻¹(y − mean).
    weights: DVector<f64>,
    variance: f64,
    log_likelihood: f64,
}

impl Smooth {
    /// With the length, the mean and the variance that make these `values` of the `points`, at least
    /// one, most likely.
    pub fn fit(points: Vec<DVector<f64>>, values: &[f64]) -> Smooth {
        let squared = squared_distances(&points);
        let values = DVector::from_column_slice(values);
        let fits = LENGTHS.iter().filter_map(|length| Smooth::of(*length, &squared, &values));
        let best = fits.max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood));
        // The nugget keeps the shortest length positive definite.
        Smooth { points, ..best.expect("a length fits") }
    }

    /// With further points whose values are those expected there; `values` are those of the points so far.
    pub fn believing(self, values: &[f64], further: &[DVector<f64>]) -> Smooth {
        let expected = further.iter().map(|place| self.hoped(place, 0.0));
        let values: Vec<f64> = values.iter().copied().chain(expected).collect();
        let points = [self.points.as_slice(), further].concat();
        let believing =
            Smooth::of(self.length, &squared_distances(&points), &DVector::from_vec(values));
        // Too many points in one place may not be positive definite: then without them.
        believing.map_or(self, |believing| Smooth { points, ..believing })
    }

    fn of(length: f64, squared: &DMatrix<f64>, values: &DVector<f64>) -> Option<Smooth> {
        let n = values.len();
        let mut kernel = squared.map(|squared| (-0.5 * squared / (length * length)).exp());
        kernel.set_diagonal(&DVector::from_element(n, 1.0 + NUGGET));
        let factor = kernel.cholesky()?;
        let ones = DVector::from_element(n, 1.0);
        let inverse = factor.solve(&ones);
        let mean = inverse.dot(values) / inverse.sum();
        let rest = values - ones * mean;
        let weights = factor.solve(&rest);
        let variance = (weights.dot(&rest) / n as f64).max(f64::MIN_POSITIVE);
        let log_determinant: f64 = factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
        let log_likelihood = -log_determinant - 0.5 * n as f64 * variance.ln();
        let points = Vec::new();
        Some(Smooth { points, length, factor, mean, weights, variance, log_likelihood })
    }

    fn kernel(&self, place: &DVector<f64>) -> DVector<f64> {
        let like = |point: &DVector<f64>| {
            let differences = point.as_slice().iter().zip(place.as_slice());
            let squared: f64 = differences.map(|(a, b)| (a - b) * (a - b)).sum();
            (-0.5 * squared / (self.length * self.length)).exp()
        };
        DVector::from_iterator(self.points.len(), self.points.iter().map(like))
    }

    /// The value expected at a place, and so many standard deviations.
    pub fn hoped(&self, place: &DVector<f64>, deviations: f64) -> f64 {
        let mut kernel = self.kernel(place);
        let mean = self.mean + kernel.dot(&self.weights);
        self.factor.l_dirty().solve_lower_triangular_mut(&mut kernel);
        mean + deviations * (self.variance * (1.0 - kernel.norm_squared()).max(0.0)).sqrt()
    }
}

fn squared_distances(points: &[DVector<f64>]) -> DMatrix<f64> {
    let n = points.len();
    DMatrix::from_fn(n, n, |i, j| points[i].metric_distance(&points[j]).powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> Vec<DVector<f64>> {
        let place = |i: u32| [0.618, 0.383, 0.271].map(|step| (f64::from(i) * step).fract());
        (0..40).map(|i| DVector::from_column_slice(&place(i))).collect()
    }

    /// −‖x − ½‖².
    fn bowl(place: &DVector<f64>) -> f64 {
        -place.map(|x| (x - 0.5).powi(2)).sum()
    }

    fn fit() -> Smooth {
        let values: Vec<f64> = points().iter().map(bowl).collect();
        Smooth::fit(points(), &values)
    }

    /// Against the textbook's μ = m + kᵀK⁻¹(y − m) and σ² = s²(1 − kᵀK⁻¹k).
    #[test]
    fn agrees_with_the_inverse_of_the_kernel_matrix() {
        let (smooth, place) = (fit(), DVector::from_vec(vec![0.31, 0.72, 0.55]));
        let of = |a: &DVector<f64>, b: &DVector<f64>| {
            (-0.5 * (a - b).norm_squared() / smooth.length.powi(2)).exp()
        };
        let points = points();
        let gram = DMatrix::from_fn(40, 40, |i, j| of(&points[i], &points[j]))
            + DMatrix::identity(40, 40) * NUGGET;
        let inverse = gram.try_inverse().unwrap();
        let k = DVector::from_fn(40, |i, _| of(&points[i], &place));
        let y = DVector::from_fn(40, |i, _| bowl(&points[i]) - smooth.mean);
        let mean = smooth.mean + k.dot(&(&inverse * &y));
        let variance = y.dot(&(&inverse * &y)) / 40.0 * (1.0 - k.dot(&(&inverse * &k)));
        assert!((smooth.hoped(&place, 0.0) - mean).abs() < 1e-7);
        assert!((smooth.hoped(&place, 1.0) - mean - variance.sqrt()).abs() < 1e-6);
    }

    #[test]
    fn knows_a_bowl_between_its_points_and_that_it_knows_nothing_far_away() {
        let smooth = fit();
        let place = DVector::from_vec(vec![0.31, 0.72, 0.55]);
        assert!(
            (smooth.hoped(&place, 0.0) - bowl(&place)).abs() < 0.01,
            "{}",
            smooth.hoped(&place, 0.0)
        );
        let far = DVector::from_element(3, 1e6);
        assert!((smooth.hoped(&far, 1.0) - smooth.mean - smooth.variance.sqrt()).abs() < 1e-9);
        assert!(
            smooth.hoped(&place, 1.0) - smooth.hoped(&place, 0.0) < 0.1 * smooth.variance.sqrt()
        );
    }

    /// Equal trials and equal values are no reason to fail.
    #[test]
    fn degenerate_trials_give_finite_beliefs() {
        let points = vec![DVector::from_element(3, 0.5); 5];
        for values in [[0.0; 5], [0.0, 1.0, 0.0, 1.0, 0.0]] {
            let smooth = Smooth::fit(points.clone(), &values);
            assert!(
                smooth.hoped(&points[0], 1.0).is_finite() && smooth.variance.sqrt().is_finite()
            );
        }
    }
}
