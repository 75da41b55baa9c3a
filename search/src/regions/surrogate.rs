//! What the trials say about places that were not tried: Gaussian process regression.

use nalgebra::DVector;

use super::lanes::{Each, LANES, Lanes};

/// Share of the variance that even the nearest trials do not explain: kinks and steps.
const NUGGET: f64 = 1e-3;
/// Length scales that are compared, in widths of the box, and the one to begin with.
const LENGTHS: [f64; 7] = [0.05, 0.08, 0.12, 0.18, 0.27, 0.4, 0.8];
const FIRST_LENGTH: f64 = 0.18;

/// A process with a Matérn-3/2 kernel, one length a dimension, conditioned trial by trial.
///
/// Row n of the Cholesky factor of the kernel matrix is the kernel of trial n, whitened by the trials
/// before it. Any other place has such a whitened kernel v too, and there
/// μ = m + βᵀv and σ² = s²(1 − vᵀv), where β are the whitened values.
#[derive(Clone, Debug)]
pub struct Surrogate {
    lengths: Vec<f64>,
    points: Vec<DVector<f64>>,
    rows: Vec<Vec<f64>>,
}

/// Mean and standard deviation of the value at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Belief {
    pub mean: f64,
    pub std: f64,
}

impl Surrogate {
    /// The process whose lengths make these `values` of the `points` (at least one) most likely:
    /// one line search a dimension, twice.
    pub fn fit(points: &[DVector<f64>], values: &[f64]) -> Surrogate {
        let dim = points[0].len();
        let mut best = Surrogate::of(vec![FIRST_LENGTH; dim], points);
        let mut best_likelihood = best.log_likelihood(values);
        for axis in (0..dim).chain(0..dim) {
            for length in LENGTHS {
                let mut lengths = best.lengths.clone();
                lengths[axis] = length;
                let other = Surrogate::of(lengths, points);
                let likelihood = other.log_likelihood(values);
                if likelihood > best_likelihood {
                    (best, best_likelihood) = (other, likelihood);
                }
            }
        }
        best
    }

    fn of(lengths: Vec<f64>, points: &[DVector<f64>]) -> Surrogate {
        let mut surrogate = Surrogate { lengths, points: Vec::new(), rows: Vec::new() };
        points.chunks(LANES).for_each(|points| surrogate.push(points));
        surrogate
    }

    /// Adds one to [`LANES`] trials.
    pub fn push(&mut self, points: &[DVector<f64>]) {
        let mut lanes = Lanes::new(points);
        for (lane, point) in points.iter().enumerate() {
            self.whiten(&mut lanes);
            let mut row = lanes.lane(lane);
            let unexplained = 1.0 + NUGGET - lanes.explained[lane];
            row.push(unexplained.max(NUGGET).sqrt());
            self.rows.push(row);
            self.points.push(point.clone());
        }
    }

    /// Appends to the whitened kernels of `places` what they lack for the latest trials.
    pub fn whiten(&self, places: &mut Lanes) {
        for n in places.v.len()..self.points.len() {
            let (before, own) = (&self.rows[n][..n], self.rows[n][n]);
            let (kernel, known) = (self.kernel(&self.points[n], places), places.dot(before));
            places.push(std::array::from_fn(|lane| (kernel[lane] - known[lane]) / own));
        }
    }

    /// (1 + d) exp(−d) with d = √3 ‖(a − b) / lengths‖, of `point` and each of `places`.
    fn kernel(&self, point: &DVector<f64>, places: &Lanes) -> Each {
        let mut squared = [0.0; LANES];
        for ((a, axis), length) in point.iter().zip(&places.axes).zip(&self.lengths) {
            squared.iter_mut().zip(axis).for_each(|(sum, b)| *sum += ((a - b) / length).powi(2));
        }
        squared.map(|squared: f64| {
            let distance = (3.0 * squared).sqrt();
            (1.0 + distance) * (-distance).exp()
        })
    }

    /// The process with one value a trial.
    pub fn condition(&self, values: &[f64]) -> Conditioned {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let mut beta: Vec<f64> = Vec::with_capacity(values.len());
        for (n, (row, value)) in self.rows.iter().zip(values).enumerate() {
            beta.push((value - mean - dot(&row[..n], &beta)) / row[n]);
        }
        let scale = (squared_norm(&beta) / beta.len() as f64).sqrt();
        Conditioned { beta, mean, scale }
    }

    /// Up to a constant; m is the mean of the values and s the most likely scale.
    fn log_likelihood(&self, values: &[f64]) -> f64 {
        let scale = self.condition(values).scale.max(f64::MIN_POSITIVE);
        let diagonal: f64 = self.rows.iter().enumerate().map(|(n, row)| row[n].ln()).sum();
        -diagonal - values.len() as f64 * scale.ln()
    }
}

/// A [`Surrogate`] and values of its trials.
#[derive(Clone, Debug)]
pub struct Conditioned {
    beta: Vec<f64>,
    mean: f64,
    scale: f64,
}

impl Conditioned {
    /// At each of `places`, which are whitened for all trials.
    pub fn at(&self, places: &Lanes) -> [Belief; LANES] {
        let known = places.dot(&self.beta);
        std::array::from_fn(|lane| {
            let std = self.scale * (1.0 - places.explained[lane]).max(0.0).sqrt();
            Belief { mean: self.mean + known[lane], std }
        })
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn squared_norm(v: &[f64]) -> f64 {
    dot(v, v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    fn points() -> Vec<DVector<f64>> {
        (0..40)
            .map(|i| {
                let i = f64::from(i);
                DVector::from_vec(vec![(i * 0.618).fract(), (i * 0.383).fract()])
            })
            .collect()
    }

    fn values(points: &[DVector<f64>]) -> Vec<f64> {
        points.iter().map(|p| (12.0 * p[0]).sin() + 0.1 * p[1]).collect()
    }

    fn belief(surrogate: &Surrogate, conditioned: &Conditioned, place: &DVector<f64>) -> Belief {
        let mut lanes = Lanes::new(std::slice::from_ref(place));
        surrogate.whiten(&mut lanes);
        conditioned.at(&lanes)[0]
    }

    /// Against the textbook's μ = m + kᵀK⁻¹(y − m) and σ² = s²(1 − kᵀK⁻¹k).
    #[test]
    fn agrees_with_the_inverse_of_the_kernel_matrix() {
        let (points, place) = (points(), DVector::from_vec(vec![0.3, 0.7]));
        let values = values(&points);
        let surrogate = Surrogate::of(vec![0.4, 0.2], &points);
        let found = belief(&surrogate, &surrogate.condition(&values), &place);

        let n = points.len();
        let kernel = |a: &DVector<f64>, b| surrogate.kernel(a, &Lanes::new(&[b]))[0];
        let gram = DMatrix::from_fn(n, n, |i, j| {
            kernel(&points[i], points[j].clone()) + if i == j { NUGGET } else { 0.0 }
        });
        let inverse = gram.try_inverse().unwrap();
        let k = DVector::from_fn(n, |i, _| kernel(&points[i], place.clone()));
        let mean = values.iter().sum::<f64>() / n as f64;
        let y = DVector::from_fn(n, |i, _| values[i] - mean);
        let scale = y.dot(&(&inverse * &y)) / n as f64;
        assert!((found.mean - mean - k.dot(&(&inverse * &y))).abs() < 1e-9);
        let variance = scale * (1.0 - k.dot(&(&inverse * &k)));
        assert!((found.std - variance.sqrt()).abs() < 1e-9);
    }

    /// A session that resumes adds many trials at once and proposes what it would have proposed.
    #[test]
    fn trials_added_at_once_or_one_by_one_are_the_same() {
        let points = points();
        let lengths = vec![0.4, 0.2];
        let at_once = Surrogate::of(lengths.clone(), &points);
        let mut one_by_one = Surrogate { lengths, points: Vec::new(), rows: Vec::new() };
        points.chunks(1).for_each(|point| one_by_one.push(point));
        assert_eq!(at_once.rows, one_by_one.rows);
    }

    /// The direction that matters gets the shorter length; trials are nearly certain, others not.
    #[test]
    fn fits_its_lengths_and_knows_what_it_knows() {
        let points = points();
        let surrogate = Surrogate::fit(&points, &values(&points));
        assert!(surrogate.lengths[0] < surrogate.lengths[1], "{:?}", surrogate.lengths);
        let conditioned = surrogate.condition(&values(&points));
        let at = |place| belief(&surrogate, &conditioned, place);
        let known = at(&points[3]);
        assert!((known.mean - values(&points)[3]).abs() < 0.02, "{known:?}");
        let far = at(&DVector::from_vec(vec![1e6, -1e6]));
        assert!(far.std > 5.0 * known.std && far.std == conditioned.scale);
    }

    /// Equal trials and equal values are no reason to fail.
    #[test]
    fn degenerate_trials_give_finite_beliefs() {
        let points = vec![DVector::from_vec(vec![0.5, 0.5]); 5];
        for values in [[0.0; 5], [0.0, 1.0, 0.0, 1.0, 0.0]] {
            let surrogate = Surrogate::fit(&points, &values);
            let belief = belief(&surrogate, &surrogate.condition(&values), &points[0]);
            assert!(belief.mean.is_finite() && belief.std.is_finite(), "{belief:?}");
        }
    }
}
