//! Smoothing of a recorded trajectory whose samples need not be evenly spaced.

use nalgebra::{Matrix3, Vector3};

/// Samples farther than this many widths weigh nothing: e^(−4.5) of the middle one.
const REACH: f64 = 3.0;

/// Local quadratic regression with Gaussian weights: the smoothed sample at tₖ is a of
///
/// min over a, b, c of Σᵢ exp(−½uᵢ²)·(xᵢ − a − b·uᵢ − c·uᵢ²)²,  uᵢ = (tᵢ − tₖ)/h, |uᵢ| ≤ 3,
///
/// with h = `width_s` (s), each coordinate on its own. A parabola comes back unchanged, at the ends
/// as well: peaks and ends keep their place, unlike under a moving average.
///
/// `times_s` (s) increases strictly and is as long as `samples` (poses or joints). A sample with fewer
/// than two others within 3h stays as it is.
pub fn smooth<const N: usize>(
    times_s: &[f64],
    samples: &[[f64; N]],
    width_s: f64,
) -> Vec<[f64; N]> {
    (0..samples.len())
        .map(|k| smoothed(times_s, samples, k, width_s).unwrap_or(samples[k]))
        .collect()
}

fn smoothed<const N: usize>(
    times_s: &[f64],
    samples: &[[f64; N]],
    k: usize,
    width_s: f64,
) -> Option<[f64; N]> {
    let t = times_s[k];
    let first = times_s.partition_point(|&other| other < t - REACH * width_s);
    let end = times_s.partition_point(|&other| other <= t + REACH * width_s);
    // Normal equations of the three coefficients; a is the first of them.
    let mut normal = Matrix3::zeros();
    let mut right = [Vector3::zeros(); N];
    for i in first..end {
        let u = (times_s[i] - t) / width_s;
        let basis = Vector3::new(1.0, u, u * u);
        let weighted = basis * (-0.5 * u * u).exp();
        normal += weighted * basis.transpose();
        right.iter_mut().zip(samples[i]).for_each(|(sum, x)| *sum += weighted * x);
    }
    if end - first < 3 {
        return None;
    }
    let inverse = normal.try_inverse()?;
    Some(right.map(|sum| (inverse * sum)[0]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::Pose;

    fn uneven() -> Vec<f64> {
        (0..100).map(|k| k as f64 * 0.01 + 0.003 * (k % 3) as f64).collect()
    }

    #[test]
    fn leaves_a_parabola_alone_up_to_its_ends() {
        let times = uneven();
        let parabola = |t: &f64| [1.0 + 2.0 * t - 3.0 * t * t, 0.7, -t, 0.0, t * t, 1.0];
        let poses: Vec<Pose> = times.iter().map(parabola).collect();
        for (smooth, exact) in smooth(&times, &poses, 0.03).iter().zip(&poses) {
            (0..6).for_each(|c| assert!((smooth[c] - exact[c]).abs() < 1e-11));
        }
    }

    #[test]
    fn takes_most_of_an_alternating_error_away() {
        let times = uneven();
        let error = |k: usize| if k.is_multiple_of(2) { 1e-3 } else { -1e-3 };
        let poses: Vec<Pose> =
            (0..100).map(|k| [0.78 + error(k), 0.0, 0.0, 0.0, 0.0, 0.0]).collect();
        for pose in &smooth(&times, &poses, 0.03)[10..90] {
            assert!((pose[0] - 0.78).abs() < 1e-4, "{}", pose[0]);
        }
    }

    #[test]
    fn a_sample_without_neighbours_stays() {
        let poses = [[1.0; 6], [2.0; 6], [9.0; 6]];
        assert_eq!(smooth(&[0.0, 0.01, 5.0], &poses, 0.02), poses);
    }
}
