//! What the estimators that cluster good trials share.

use nalgebra::DVector;

/// Trials below this share of the best reward are not clustered: they follow the nearest one that is.
const GOOD_SHARE: f64 = 0.4;

/// Group of each trial, from a clustering of the good ones (given with their shares of the best).
pub fn of_good_trials(
    points: &[DVector<f64>],
    rewards: &[f64],
    cluster: impl Fn(&[DVector<f64>], &[f64]) -> Vec<usize>,
) -> Vec<usize> {
    let best = rewards.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let good: Vec<usize> = (0..points.len()).filter(|&t| rewards[t] >= GOOD_SHARE * best).collect();
    let good_points: Vec<DVector<f64>> = good.iter().map(|&t| points[t].clone()).collect();
    let shares: Vec<f64> = good.iter().map(|&t| rewards[t] / best).collect();
    let labels = cluster(&good_points, &shares);
    points.iter().map(|point| labels[nearest(&good_points, point)]).collect()
}

/// Index of the centre nearest to `point`; the first of equals.
pub fn nearest(centres: &[DVector<f64>], point: &DVector<f64>) -> usize {
    let distance = |i: &usize| centres[*i].metric_distance(point);
    (0..centres.len())
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .expect("there are centres")
}

/// 25 points around each of `centres`, for the tests of the estimators.
#[cfg(test)]
pub fn clouds(centres: &[[f64; 2]]) -> Vec<DVector<f64>> {
    use crate::normals::{standard_normal, stream};
    let mut rng = stream(5, 1);
    let mut draw = |x: f64| x + 0.04 * standard_normal(&mut rng);
    let points = centres.iter().flat_map(|c| [*c; 25]);
    points.map(|c| DVector::from_vec(vec![draw(c[0]), draw(c[1])])).collect()
}

/// The first point, and again and again the one farthest from those taken.
pub fn farthest_first(points: &[DVector<f64>], n: usize) -> Vec<DVector<f64>> {
    let mut taken = vec![points[0].clone()];
    while taken.len() < n.min(points.len()) {
        let gap = |point: &&DVector<f64>| point.metric_distance(&taken[nearest(&taken, point)]);
        let next = points.iter().max_by(|a, b| gap(a).total_cmp(&gap(b))).expect("not empty");
        taken.push(next.clone());
    }
    taken
}
