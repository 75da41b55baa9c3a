//! Uniform resampling and smooth derivatives of a recorded pose trajectory.

use shm_types::TASK_DIM;

/// x, y, z, pitch, roll, yaw in m and rad.
pub type Pose = [f64; TASK_DIM];

// What follows treats each coordinate on its own and takes any number of them: poses or joints.

/// Sampling period of every trajectory after [`resample`], s (nearly: it divides the duration).
pub const PERIOD_S: f64 = 0.01;
/// Jitter of the recorded times below which a trajectory counts as uniform already, s.
const JITTER_S: f64 = 1e-6;

/// Resamples to about 100 Hz: n = round(T/10 ms) intervals of T/n, so that the last pose is kept.
///
/// `times_s` strictly increasing and as long as `poses`, at least two. Between the recorded poses
/// runs a cubic Hermite curve with slopes from the neighbours: a linear one would have kinks, and
/// their second derivative would end up in the attractors. Returns the period (s) and the poses.
pub fn resample(times_s: &[f64], poses: &[Pose]) -> (f64, Vec<Pose>) {
    let start = times_s[0];
    let duration = times_s[times_s.len() - 1] - start;
    let uniform = |(i, t): (usize, &f64)| (t - start - i as f64 * PERIOD_S).abs() < JITTER_S;
    if times_s.iter().enumerate().all(uniform) {
        return (PERIOD_S, poses.to_vec());
    }
    let n = (duration / PERIOD_S).round().max(1.0) as usize;
    let period = duration / n as f64;
    let at: Vec<f64> = (0..=n).map(|k| start + k as f64 * period).collect();
    (period, sample(times_s, poses, &at))
}

/// The poses at `at_s` (s, increasing): on the cubic Hermite curve through `poses` at `times_s`, which
/// increase strictly and are at least two. Before the first and after the last pose the curve is held.
pub fn sample<const N: usize>(times_s: &[f64], poses: &[[f64; N]], at_s: &[f64]) -> Vec<[f64; N]> {
    let slopes = hermite_slopes(times_s, poses);
    let mut segment = 0;
    at_s.iter()
        .map(|&t| {
            while segment + 2 < times_s.len() && times_s[segment + 1] <= t {
                segment += 1;
            }
            hermite(times_s, poses, &slopes, segment, t)
        })
        .collect()
}

/// The poses at `source(t)` for every sample time t (s): a change of timing. Before the first pose
/// and after the last one the trajectory is held.
pub fn retime(poses: &[Pose], period_s: f64, source: impl Fn(f64) -> f64) -> Vec<Pose> {
    let times_s: Vec<f64> = (0..poses.len()).map(|k| k as f64 * period_s).collect();
    let slopes = hermite_slopes(&times_s, poses);
    let last = poses.len() - 2;
    let at = |t: &f64| {
        let t_s = source(*t);
        let segment = ((t_s / period_s).max(0.0) as usize).min(last);
        hermite(&times_s, poses, &slopes, segment, t_s)
    };
    times_s.iter().map(at).collect()
}

/// Slope at each knot: the derivative of the parabola through it and its neighbours; at the ends
/// the slope of the chord.
fn hermite_slopes<const N: usize>(times_s: &[f64], poses: &[[f64; N]]) -> Vec<[f64; N]> {
    let chord =
        |i: usize, c: usize| (poses[i + 1][c] - poses[i][c]) / (times_s[i + 1] - times_s[i]);
    let last = poses.len() - 1;
    (0..=last)
        .map(|i| {
            std::array::from_fn(|c| match i {
                0 => chord(0, c),
                i if i == last => chord(last - 1, c),
                i => {
                    let (before, after) =
                        (times_s[i] - times_s[i - 1], times_s[i + 1] - times_s[i]);
                    (after * chord(i - 1, c) + before * chord(i, c)) / (before + after)
                }
            })
        })
        .collect()
}

fn hermite<const N: usize>(
    times_s: &[f64],
    poses: &[[f64; N]],
    slopes: &[[f64; N]],
    i: usize,
    t: f64,
) -> [f64; N] {
    let width = times_s[i + 1] - times_s[i];
    let u = ((t - times_s[i]) / width).clamp(0.0, 1.0);
    let (u2, u3) = (u * u, u * u * u);
    std::array::from_fn(|c| {
        (2.0 * u3 - 3.0 * u2 + 1.0) * poses[i][c]
            + (u3 - 2.0 * u2 + u) * width * slopes[i][c]
            + (3.0 * u2 - 2.0 * u3) * poses[i + 1][c]
            + (u3 - u2) * width * slopes[i + 1][c]
    })
}

/// ẋ and ẍ by smooth central differences: value of the derivatives of the parabola fitted to five
/// neighbouring samples,
///
/// ẋₖ = (−2xₖ₋₂ − xₖ₋₁ + xₖ₊₁ + 2xₖ₊₂) / 10h,  ẍₖ = (2xₖ₋₂ − xₖ₋₁ − 2xₖ − xₖ₊₁ + 2xₖ₊₂) / 7h².
///
/// Beyond its ends the trajectory is held: a rollout starts and ends at rest.
pub fn derivatives<const N: usize>(
    poses: &[[f64; N]],
    period_s: f64,
) -> (Vec<[f64; N]>, Vec<[f64; N]>) {
    let last = poses.len() as isize - 1;
    let at = |k: isize, c: usize| poses[k.clamp(0, last) as usize][c];
    let stencil = |weights: [f64; 5], scale: f64| -> Vec<[f64; N]> {
        (0..=last)
            .map(|k| {
                std::array::from_fn(|c| {
                    let sum: f64 =
                        (-2..=2).zip(weights).map(|(j, weight)| weight * at(k + j, c)).sum();
                    sum / scale
                })
            })
            .collect()
    };
    (
        stencil([-2.0, -1.0, 0.0, 1.0, 2.0], 10.0 * period_s),
        stencil([2.0, -1.0, -2.0, -1.0, 2.0], 7.0 * period_s * period_s),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parabola(t: f64) -> Pose {
        [1.0 + 2.0 * t + 3.0 * t * t, -t, 0.7, 0.0, 0.0, t * t]
    }

    #[test]
    fn derivatives_are_exact_for_a_parabola_away_from_the_ends() {
        let poses: Vec<Pose> = (0..20).map(|k| parabola(k as f64 * 0.01)).collect();
        let (velocity, acceleration) = derivatives(&poses, 0.01);
        for k in 2..18 {
            assert!((velocity[k][0] - (2.0 + 6.0 * k as f64 * 0.01)).abs() < 1e-10);
            assert!((velocity[k][1] + 1.0).abs() < 1e-10);
            assert!((acceleration[k][0] - 6.0).abs() < 1e-8);
            assert!((acceleration[k][5] - 2.0).abs() < 1e-8);
        }
        assert!(velocity[9][2].abs() < 1e-12);
    }

    #[test]
    fn retiming_moves_a_parabola_in_time_and_holds_its_ends() {
        let poses: Vec<Pose> = (0..20).map(|k| parabola(k as f64 * 0.01)).collect();
        let late = retime(&poses, 0.01, |t| t - 0.034);
        assert_eq!((late[0], late[3]), (poses[0], poses[0]));
        assert!((late[12][0] - parabola(0.086)[0]).abs() < 1e-12);
        let early = retime(&poses, 0.01, |t| t + 1.0);
        assert_eq!(early[0], poses[19]);
    }

    #[test]
    fn keeps_a_uniform_trajectory_and_follows_an_uneven_one() {
        let even: Vec<f64> = (0..30).map(|k| 0.5 + k as f64 * 0.01).collect();
        let poses: Vec<Pose> = even.iter().map(|&t| parabola(t)).collect();
        assert_eq!(resample(&even, &poses), (PERIOD_S, poses.clone()));

        let uneven: Vec<f64> =
            (0..60).map(|k| k as f64 * 0.0175 + 0.004 * (k % 3) as f64).collect();
        let poses: Vec<Pose> = uneven.iter().map(|&t| parabola(t)).collect();
        let (period, resampled) = resample(&uneven, &poses);
        assert!((period - PERIOD_S).abs() < 1e-4);
        for (k, pose) in resampled.iter().enumerate() {
            let exact = parabola(k as f64 * period);
            assert!((pose[0] - exact[0]).abs() < 2e-4, "{k}: {} {}", pose[0], exact[0]);
        }
        assert_eq!(resampled.last(), poses.last());
    }
}
