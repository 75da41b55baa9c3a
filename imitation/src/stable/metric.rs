//! The P to begin with: the quadratic V that falls along the recordings as nearly as any.

use nalgebra::{DMatrix, DVector};
use search::normals::{standard_normal, stream};

use super::lbfgs;

/// Stream of the seed that the starts of the search are drawn from.
const STREAM: u64 = 1 << 32;
const N_STARTS: usize = 6;
const N_ITERATIONS: usize = 100;
/// Share by which √V is to fall over the whole path, at least.
const DECAY: f64 = 0.02;
/// The motion should cross the levels of V with a cosine below −STEEP; what that and roundness weigh
/// beside the squared departure, relative to the squared size of the paths.
const STEEP: f64 = 0.15;
const STEEPNESS: f64 = 0.02;
const ROUNDNESS: f64 = 1e-3;
/// V's ellipses should not be longer than so many times their width: across them, a field of moderate
/// velocities has gains larger by that. What the square of the excess, in powers of e, weighs.
const STRETCH: f64 = 10.0;
const STRETCHED: f64 = 0.1;

/// L, lower triangular with |L| = 1 and P = LLᵀ, for paths (d×T each) that end in the origin.
///
/// A path along which V rises cannot be followed. Pulled towards the origin wherever V would be above what
/// it was before, it can: see [`pulled`]. L is such that the mean squared pull is least.
pub(super) fn metric(paths: &[DMatrix<f64>], seed: u64) -> DMatrix<f64> {
    let d = paths[0].nrows();
    let n = d * (d + 1) / 2;
    let mut rng = stream(seed, STREAM);
    let mut best = (f64::INFINITY, DVector::zeros(n));
    for start in 0..N_STARTS {
        let theta = match start {
            0 => DVector::zeros(n),
            1 => whitening(paths),
            _ => DVector::from_fn(n, |_, _| standard_normal(&mut rng)),
        };
        let found = lbfgs::minimise(theta, N_ITERATIONS, |theta, slope| {
            // Few unknowns and kinks: differences serve as well as derivatives.
            for i in 0..n {
                let beside = |step: f64| {
                    let mut theta = theta.clone();
                    theta[i] += step;
                    badness(paths, &factor(d, &theta))
                };
                slope[i] = (beside(1e-6) - beside(-1e-6)) / 2e-6;
            }
            badness(paths, &factor(d, theta))
        });
        if found.0 < best.0 {
            best = found;
        }
    }
    factor(d, &best.1)
}

/// A path (d×T) that ends in the origin, with every point moved as little as it must be for V to fall all
/// the way: to the nearest of those where V is what it may be, x̃ = (I + μP)⁻¹x.
pub(super) fn pulled(path: &DMatrix<f64>, L: &DMatrix<f64>) -> DMatrix<f64> {
    let axes = (L * L.transpose()).symmetric_eigen();
    let mut pulled = axes.eigenvectors.tr_mul(path);
    let last = path.ncols() - 1;
    let mut lowest = f64::INFINITY;
    for (k, mut x) in pulled.column_iter_mut().enumerate() {
        let decay = (-DECAY * k as f64 / last as f64).exp();
        lowest = lowest.min(root(&axes.eigenvalues, x.as_slice(), 0.0) / decay);
        let mu = multiplier(&axes.eigenvalues, x.as_slice(), lowest * decay);
        x.iter_mut().zip(&axes.eigenvalues).for_each(|(x, p)| *x /= 1.0 + mu * p);
    }
    axes.eigenvectors * pulled
}

/// √V of (I + μP)⁻¹x, for x along the axes of P.
fn root(p: &DVector<f64>, x: &[f64], mu: f64) -> f64 {
    p.iter().zip(x).map(|(p, x)| p * (x / (1.0 + mu * p)).powi(2)).sum::<f64>().sqrt()
}

/// The μ ≥ 0 at which √V has come down to `limit`; infinite for a limit of 0.
///
/// Newton's method on 1/√V, which is nearly linear in μ, and concave, so that no step goes too far.
fn multiplier(p: &DVector<f64>, x: &[f64], limit: f64) -> f64 {
    let mut mu = 0.0;
    for _ in 0..50 {
        let root = root(p, x, mu);
        if root <= limit * (1.0 + 1e-12) || root == 0.0 {
            break;
        }
        let bent: f64 =
            p.iter().zip(x).map(|(p, x)| (p * x).powi(2) / (1.0 + mu * p).powi(3)).sum();
        mu += (1.0 / limit - 1.0 / root) * root.powi(3) / bent;
    }
    mu
}

fn badness(paths: &[DMatrix<f64>], L: &DMatrix<f64>) -> f64 {
    let P = L * L.transpose();
    let axes = P.symmetric_eigenvalues();
    let excess = (0.5 * (axes.max() / axes.min()).ln() - STRETCH.ln()).max(0.0);
    let (mut departure, mut size, mut flat, mut n) = (0.0, 0.0, 0.0, 0.0);
    for path in paths {
        let pulled = pulled(path, L);
        for (k, x) in path.column_iter().enumerate() {
            departure += (x - pulled.column(k)).norm_squared();
            size += x.norm_squared();
            n += 1.0;
            if k + 1 < path.ncols() {
                let (step, gradient) = (path.column(k + 1) - x, &P * x);
                let lengths = step.norm() * gradient.norm();
                let cosine = if lengths > 0.0 { step.dot(&gradient) / lengths } else { 0.0 };
                flat += (cosine + STEEP).max(0.0).powi(2);
            }
        }
    }
    let d = L.nrows();
    let roundness = (L - DMatrix::identity(d, d)).norm_squared() / (d * d) as f64;
    departure / size + STEEPNESS * flat / n + ROUNDNESS * roundness + STRETCHED * excess.powi(2)
}

/// Lower triangular with |L| = 1, from its entries row by row, of the diagonal the logarithms.
fn factor(d: usize, theta: &DVector<f64>) -> DMatrix<f64> {
    let entry = |r: usize, c: usize| theta[r * (r + 1) / 2 + c];
    let mean = (0..d).map(|r| entry(r, r)).sum::<f64>() / d as f64;
    DMatrix::from_fn(d, d, |r, c| match r.cmp(&c) {
        std::cmp::Ordering::Less => 0.0,
        std::cmp::Ordering::Equal => (entry(r, r) - mean).exp(),
        std::cmp::Ordering::Greater => entry(r, c) * (-mean).exp(),
    })
}

/// In which the paths are about round; the identity if they leave a direction out.
fn whitening(paths: &[DMatrix<f64>]) -> DVector<f64> {
    let d = paths[0].nrows();
    let spread: DMatrix<f64> = paths.iter().map(|path| path * path.transpose()).sum();
    let spread = &spread / spread.trace() + DMatrix::from_diagonal_element(d, d, 1e-3);
    let mut theta = DVector::zeros(d * (d + 1) / 2);
    if let Some(L) = spread.try_inverse().and_then(|P| P.cholesky()).map(|P| P.unpack()) {
        for r in 0..d {
            for c in 0..=r {
                theta[r * (r + 1) / 2 + c] = if r == c { L[(r, r)].ln() } else { L[(r, c)] };
            }
        }
    }
    theta
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(at: impl Fn(f64) -> [f64; 2]) -> DMatrix<f64> {
        DMatrix::from_fn(2, 80, |c, k| at(k as f64 / 79.0)[c])
    }

    fn pull(path: &DMatrix<f64>, L: &DMatrix<f64>) -> f64 {
        (path - pulled(path, L)).column_iter().map(|off| off.norm()).fold(0.0, f64::max)
    }

    #[test]
    fn a_straight_line_needs_no_pull() {
        let line = path(|u| [1.0 - u, 2.0 - 2.0 * u]);
        let L = metric(std::slice::from_ref(&line), 0);
        assert!((L.determinant() - 1.0).abs() < 1e-9);
        assert!(pull(&line, &L) < 1e-9);
    }

    /// Along y first, away from the end in the plain distance, then back.
    #[test]
    fn a_detour_gets_an_ellipse_that_shrinks_along_it() {
        let detour = path(|u| [1.0 - u, 0.2 + 4.0 * u - 4.2 * u * u]);
        let L = metric(std::slice::from_ref(&detour), 0);
        let (round, found) = (pull(&detour, &DMatrix::identity(2, 2)), pull(&detour, &L));
        assert!(round > 0.05 && found < 0.01, "{round} {found}");
    }

    #[test]
    fn a_pulled_path_crosses_every_level_inwards_and_is_the_nearest_that_does() {
        let loops = path(|u| {
            let radius = (1.0 - u) * (1.0 + 3.0 * u);
            [radius * (6.0 * u).cos(), radius * (6.0 * u).sin()]
        });
        let L = metric(std::slice::from_ref(&loops), 3);
        assert_eq!(L, metric(std::slice::from_ref(&loops), 3));
        let pulled = pulled(&loops, &L);
        let root = |k: usize| L.tr_mul(&pulled.column(k)).norm();
        assert!(pull(&loops, &L) > 0.1);
        assert!((1..80).all(|k| root(k) < root(k - 1) * (1.0 - 1e-6) || root(k) == 0.0));
        // What was moved was moved along the gradient of V.
        let P = &L * L.transpose();
        for (x, y) in loops.column_iter().zip(pulled.column_iter()) {
            let (off, gradient) = (x - y, &P * y);
            let across = off.perp(&gradient) / gradient.norm().max(1e-9);
            assert!(off.norm() < 1e-9 || across.abs() < 1e-6 * off.norm(), "{off} {gradient}");
        }
    }
}
