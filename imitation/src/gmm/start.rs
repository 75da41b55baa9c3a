//! Where EM starts: k-means from centres drawn far apart.

use nalgebra::{DMatrix, DVector, DVectorView};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Steps of k-means; EM does the rest.
const N_STEPS: usize = 10;

/// `k` centres (each d) among `points` (d×N, N ≥ k ≥ 1).
///
/// k-means++ (Arthur and Vassilvitskii 2007): each next centre is a point drawn with a probability
/// proportional to its squared distance to the nearest centre so far. Some steps of k-means follow.
pub fn centers(points: &DMatrix<f64>, k: usize, rng: &mut ChaCha8Rng) -> Vec<DVector<f64>> {
    let first = rng.random_range(0..points.ncols());
    let mut centers = vec![points.column(first).clone_owned()];
    while centers.len() < k {
        let distances: Vec<f64> = points.column_iter().map(|x| nearest(&centers, &x).1).collect();
        let next = draw(&distances, rng);
        centers.push(points.column(next).clone_owned());
    }
    for _ in 0..N_STEPS {
        step(&mut centers, points);
    }
    centers
}

/// The place of the nearest centre to `x`, and the squared distance to it.
pub fn nearest(centers: &[DVector<f64>], x: &DVectorView<f64>) -> (usize, f64) {
    let distances = centers.iter().map(|center| x.metric_distance(center).powi(2));
    distances.enumerate().fold((0, f64::INFINITY), |best, (i, distance)| {
        if distance < best.1 { (i, distance) } else { best }
    })
}

/// An index drawn with a probability proportional to its weight; any, if all weights are 0.
fn draw(weights: &[f64], rng: &mut ChaCha8Rng) -> usize {
    let mut left = rng.random::<f64>() * weights.iter().sum::<f64>();
    if left == 0.0 {
        return rng.random_range(0..weights.len());
    }
    for (i, weight) in weights.iter().enumerate() {
        left -= weight;
        if left < 0.0 {
            return i;
        }
    }
    weights.len() - 1
}

/// Each centre moves to the mean of the points nearest to it; one without points stays.
fn step(centers: &mut [DVector<f64>], points: &DMatrix<f64>) {
    let mut sums = vec![(0.0, DVector::zeros(points.nrows())); centers.len()];
    for x in points.column_iter() {
        let (count, sum) = &mut sums[nearest(centers, &x).0];
        *count += 1.0;
        *sum += x;
    }
    for (center, (count, sum)) in centers.iter_mut().zip(sums) {
        if count > 0.0 {
            *center = sum / count;
        }
    }
}
