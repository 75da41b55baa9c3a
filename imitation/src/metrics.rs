//! How far a reproduction is from its demonstration.

use nalgebra::{DMatrix, DVector, DVectorView};

use crate::align::{resampled_by_length, warp};

/// Points a path is resampled to.
const N_POINTS: usize = 1000;

/// The swept error area (Khansari-Zadeh and Billard 2014) between two paths (d×T each, d ≥ 2), in the
/// squared unit of x: the area between them, whatever their timing.
///
/// Both are resampled to 1000 points at equal distances along the path; between points k and k + 1 they
/// span a tetragon, whose area is that of its two triangles. In one coordinate every area is 0.
pub fn swept_area(demonstration: &DMatrix<f64>, reproduction: &DMatrix<f64>) -> f64 {
    let a = resampled_by_length(demonstration, N_POINTS);
    let b = resampled_by_length(reproduction, N_POINTS);
    (1..N_POINTS)
        .map(|k| {
            let (a0, a1, b0, b1) = (a.column(k - 1), a.column(k), b.column(k - 1), b.column(k));
            triangle(&a0, &a1, &b0) + triangle(&b0, &b1, &a1)
        })
        .sum()
}

/// ½ √(|u|²|v|² − (u·v)²) for the sides u and v from `p`.
fn triangle(p: &DVectorView<f64>, q: &DVectorView<f64>, r: &DVectorView<f64>) -> f64 {
    let (u, v): (DVector<f64>, DVector<f64>) = (q - p, r - p);
    let squared = u.norm_squared() * v.norm_squared() - u.dot(&v).powi(2);
    0.5 * squared.max(0.0).sqrt()
}

/// The dynamic time warping distance between two paths (d×T and d×T'), in the unit of x: the least sum
/// of distances over pairs of points that run through both paths in order.
///
/// It grows with the number of points: compare paths of the same numbers.
pub fn warping_distance(demonstration: &DMatrix<f64>, reproduction: &DMatrix<f64>) -> f64 {
    warp(demonstration, reproduction).distance
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(points: &[[f64; 2]]) -> DMatrix<f64> {
        DMatrix::from_fn(2, points.len(), |c, k| points[k][c])
    }

    #[test]
    fn parallel_lines_sweep_the_rectangle_between_them() {
        let a = path(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]);
        let b = path(&[[0.0, 0.3], [2.0, 0.3]]);
        assert!((swept_area(&a, &b) - 0.6).abs() < 1e-9);
        assert_eq!(swept_area(&a, &a), 0.0);
    }

    #[test]
    fn two_sides_of_a_triangle_sweep_it() {
        // From (0, 0) along x, and along y, 1 m each: half of the unit square.
        let (a, b) = (path(&[[0.0, 0.0], [1.0, 0.0]]), path(&[[0.0, 0.0], [0.0, 1.0]]));
        assert!((swept_area(&a, &b) - 0.5).abs() < 1e-9);
    }

    #[test]
    fn the_area_is_that_of_the_shape_in_space_whatever_the_timing() {
        let slow = DMatrix::from_fn(3, 200, |c, k| {
            let u = (k as f64 / 199.0).powi(2);
            [u, 0.0, 0.2][c]
        });
        let even = DMatrix::from_fn(3, 50, |c, k| [k as f64 / 49.0, 0.3, 0.6][c]);
        // Parallel lines of 1 m, √(0.3² + 0.4²) = 0.5 m apart.
        assert!((swept_area(&slow, &even) - 0.5).abs() < 1e-9);
    }

    #[test]
    fn a_path_that_stands_still_sweeps_a_triangle() {
        let still = path(&[[0.0, 1.0], [0.0, 1.0]]);
        let line = path(&[[0.0, 0.0], [2.0, 0.0]]);
        assert!((swept_area(&line, &still) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_warping_distance_pairs_points_in_order() {
        let a = path(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]);
        // The first point is met by two, the last pair is 0.5 apart.
        let b = path(&[[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [2.0, 0.5]]);
        assert!((warping_distance(&a, &b) - 0.5).abs() < 1e-12);
        assert_eq!(warping_distance(&a, &b), warping_distance(&b, &a));
        assert_eq!(warping_distance(&a, &a), 0.0);
        // Against a single point, the sum of the distances to it.
        assert!((warping_distance(&a, &path(&[[0.0, 0.0]])) - 3.0).abs() < 1e-12);
    }
}
