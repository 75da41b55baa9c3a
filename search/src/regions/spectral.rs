//! Counts groups of good trials by spectral clustering: the paper's second wish (Sec. 4.2).

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::clusters::{farthest_first, nearest};

/// At most so many groups.
const MAX_GROUPS: usize = 10;
/// The scale of a trial's affinities is the distance to this neighbour.
const SCALE_NEIGHBOUR: usize = 4;
/// Eigenvalues of the Laplacian below this are as good as zero.
const RESOLUTION: f64 = 0.02;
const ITERATIONS: usize = 30;

/// Group of each point: normalised cuts with self-tuned affinities (Zelnik-Manor and Perona, NIPS
/// 2004), as many groups as the largest relative gap among the eigenvalues says (Ng, Jordan and Weiss, NIPS
/// 2001). Along a ridge the eigenvalues decline steadily, and the gap says little.
pub fn groups(points: &[DVector<f64>]) -> Vec<usize> {
    let n = points.len();
    if n <= SCALE_NEIGHBOUR {
        return vec![0; n];
    }
    let eigen = SymmetricEigen::new(normalised_affinity(points));
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]).then(a.cmp(&b)));
    // Of the Laplacian, whose eigenvalues are zero as often as there are separate groups: the gap
    // is relative, as those within a group begin low too.
    let laplacian = |k: usize| (1.0 - eigen.eigenvalues[order[k]]).max(0.0) + RESOLUTION;
    let gap = |k: &usize| laplacian(*k) / laplacian(k - 1);
    let n_groups = (1..=MAX_GROUPS.min(n - 1))
        .rev()
        .max_by(|a, b| gap(a).total_cmp(&gap(b)))
        .expect("there are several points");

    let row = |i: usize| {
        let row = DVector::from_fn(n_groups, |k, _| eigen.eigenvectors[(i, order[k])]);
        row.try_normalize(f64::MIN_POSITIVE).unwrap_or(row)
    };
    k_means(&(0..n).map(row).collect::<Vec<_>>(), n_groups)
}

/// D^(−1/2) A D^(−1/2) of the affinities A = exp(−‖xᵢ − xⱼ‖² / (σᵢσⱼ)).
fn normalised_affinity(points: &[DVector<f64>]) -> DMatrix<f64> {
    let n = points.len();
    let squared = DMatrix::from_fn(n, n, |i, j| (&points[i] - &points[j]).norm_squared());
    let scales = DVector::from_fn(n, |i, _| {
        let mut row: Vec<f64> = squared.row(i).iter().copied().collect();
        row.sort_unstable_by(f64::total_cmp);
        row[SCALE_NEIGHBOUR].sqrt().max(f64::EPSILON)
    });
    let mut affinity = DMatrix::from_fn(n, n, |i, j| {
        if i == j { 0.0 } else { (-squared[(i, j)] / (scales[i] * scales[j])).exp() }
    });
    let degrees = DVector::from_fn(n, |i, _| affinity.row(i).sum().max(f64::MIN_POSITIVE).sqrt());
    for i in 0..n {
        for j in 0..n {
            affinity[(i, j)] /= degrees[i] * degrees[j];
        }
    }
    affinity
}

/// Lloyd's algorithm from centres that are far apart: no random start.
fn k_means(points: &[DVector<f64>], n_groups: usize) -> Vec<usize> {
    let mut centres = farthest_first(points, n_groups);
    for _ in 0..ITERATIONS {
        let labels: Vec<usize> = points.iter().map(|point| nearest(&centres, point)).collect();
        for (group, centre) in centres.iter_mut().enumerate() {
            let own = || points.iter().zip(&labels).filter(|(_, label)| **label == group);
            let n = own().count();
            if n > 0 {
                *centre = own().map(|(point, _)| point).sum::<DVector<f64>>() / n as f64;
            }
        }
    }
    points.iter().map(|point| nearest(&centres, point)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regions::clusters::clouds;

    #[test]
    fn separate_clouds_are_groups() {
        for centres in [&[[0.2, 0.2], [0.8, 0.7]][..], &[[0.2, 0.2], [0.8, 0.7], [0.2, 0.9]]] {
            let labels = groups(&clouds(centres));
            for (a, first) in labels.iter().enumerate() {
                for (b, second) in labels.iter().enumerate() {
                    assert_eq!(first == second, a / 25 == b / 25, "{labels:?}");
                }
            }
        }
    }

    #[test]
    fn few_or_equal_points_are_one_group() {
        let point = DVector::from_vec(vec![0.3, 0.4]);
        assert_eq!(groups(&vec![point.clone(); 3]), [0; 3]);
        assert_eq!(groups(&vec![point; 9]), [0; 9]);
    }
}
