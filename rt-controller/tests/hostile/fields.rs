//! Linear systems at their bounds: how they are made up, and their bounds once more.

use nalgebra::{Matrix6, Vector6};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use shm_types::policy::{
    ACTIVATION_STATE, LinearSystem, ORIENTATION_SPHERE, OUTPUT_VELOCITY, PolicyMsg, packed_index,
};
use shm_types::{MAX_COMPONENTS, TASK_DIM};

use super::bounds::{Arm, is_positive};
use super::policies::{between, point, rotated};

/// Shares by which bounds are widened or narrowed where rounding counts for more: of gains, of what a
/// small eigenvalue beside large ones decides, and of λ, which the inverse of a small one decides.
const GAIN: f64 = 1e-5;
const SMALL: f64 = 0.1;
const LAMBDA: f64 = 0.05;

/// A policy of systems, nearly all of them within or on their bounds.
pub fn at_the_bounds(rng: &mut ChaCha8Rng, arm: &Arm) -> PolicyMsg {
    let mut policy = PolicyMsg {
        task_dim: [3, 4, 6][rng.random_range(0..3)],
        n_systems: rng.random_range(1..=MAX_COMPONENTS as u32),
        activation: rng.random_range(0..=ACTIVATION_STATE),
        output: rng.random_range(0..=OUTPUT_VELOCITY),
        orientation: rng.random_range(0..=ORIENTATION_SPHERE),
        duration_s: between(0.05, arm.longest_s, rng),
        decay_rate: between(1e-3, 1e3, rng),
        orientation_stiffness: between(0.0, 1e5, rng),
        orientation_damping: between(0.0, 1e3, rng),
        following: between(1.0, 500.0, rng),
        target: point(rng, arm),
        ..PolicyMsg::EMPTY
    };
    let is_field = policy.activation == ACTIVATION_STATE;
    if is_field && rng.random_bool(0.95) {
        policy.output = OUTPUT_VELOCITY;
    }
    let (d, drive_dim) = (policy.task_dim as usize, policy.drive_dim());
    let P = rotated(d, rng, |rng| 10_f64.powf(between(-3.0, 3.0, rng)));
    pack(&P, d, &mut policy.certificate);
    let target =
        Vector6::from_fn(|i, _| match policy.orientation == ORIENTATION_SPHERE && i >= 3 {
            true => 0.0,
            false => policy.target[i],
        });
    for i in 0..policy.n_systems as usize {
        let mut system = LinearSystem::ZERO;
        system.log_prior = between(-1e3, 1e3, rng);
        system.center = std::array::from_fn(|_| between(-100.0, 100.0, rng));
        let sigma = rotated(drive_dim, rng, |rng| 10_f64.powf(between(-8.0, 4.0, rng)));
        pack(&sigma, drive_dim, &mut system.covariance);
        let A = match is_field {
            true => contracting(d, &P, policy.following, rng),
            false => rotated(d, rng, |rng| -between(0.0, 5e4 / policy.following, rng)),
        };
        (0..36).for_each(|k| system.of_position[k] = A[(k / TASK_DIM, k % TASK_DIM)]);
        if is_field {
            let b = -A * target;
            (0..d).for_each(|k| system.offset[k] = b[k]);
        } else {
            system.of_drive = std::array::from_fn(|_| between(-1e3, 1e3, rng));
            system.offset = std::array::from_fn(|_| between(-1e3, 1e3, rng));
        }
        if policy.output != OUTPUT_VELOCITY {
            let B = rotated(d, rng, |rng| -between(0.0, 1e3, rng));
            (0..36).for_each(|k| system.of_velocity[k] = B[(k / TASK_DIM, k % TASK_DIM)]);
        }
        policy.systems[i] = system;
    }
    policy
}

/// A with ½ (P A + Aᵀ P) = −N, that is A = P⁻¹ (Ω − N) with a skew Ω, mostly as slow as `following` bears.
fn contracting(d: usize, P: &Matrix6<f64>, following: f64, rng: &mut ChaCha8Rng) -> Matrix6<f64> {
    let turn = if rng.random_bool(0.5) { 0.0 } else { between(0.0, 3.0, rng) };
    let mut skew = Matrix6::zeros();
    for row in 0..d {
        for column in 0..row {
            let entry = turn * rng.random_range(-1.0..=1.0);
            (skew[(row, column)], skew[(column, row)]) = (entry, -entry);
        }
    }
    // In P's own coordinates, where P is 1, and back: A = P^(−½) (W + S) P^½.
    let eigen = P.symmetric_eigen();
    let power = |exponent: f64| {
        let values = eigen.eigenvalues.map(|value| value.max(1e-12).powf(exponent));
        eigen.eigenvectors * Matrix6::from_diagonal(&values) * eigen.eigenvectors.transpose()
    };
    let slow = rotated(d, rng, |rng| -(1e-3 + between(0.0, 4.0, rng)));
    let A = power(-0.5) * (skew + slow) * power(0.5);
    let norm = A.norm();
    let most = 5e4 / following;
    if norm > most && rng.random_bool(0.9) { A * (most / norm) } else { A }
}

fn pack(matrix: &Matrix6<f64>, d: usize, packed: &mut [f64]) {
    for row in 0..d {
        for column in 0..=row {
            packed[packed_index(row, column)] = matrix[(row, column)];
        }
    }
}

/// The bound that a policy of systems violates, if any; `slack` as of springs.
pub fn violation(policy: &PolicyMsg, arm: &Arm, slack: f64) -> Option<String> {
    if arm.is_beyond(&policy.target, slack) {
        return Some("target too far from the shoulder".into());
    }
    let is_field = policy.activation == ACTIVATION_STATE;
    if is_field && policy.output != OUTPUT_VELOCITY {
        return Some("an acceleration driven by the state".into());
    }
    let d = policy.task_dim as usize;
    let certificate = |r: usize, c: usize| policy.certificate_at(r, c);
    let unit = |r: usize, c: usize| f64::from(u8::from(r == c));
    let is_certificate = is_positive(d, |r, c| certificate(r, c) - unit(r, c) * (1e-3 - slack))
        && is_positive(d, |r, c| unit(r, c) * 1e3 * (1.0 + slack) - certificate(r, c));
    if is_field && !is_certificate {
        return Some("certificate".into());
    }
    let of_system = |(i, system): (usize, &LinearSystem)| {
        let broken = of_system(system, policy, slack);
        broken.map(|what| format!("system {i}: {what}"))
    };
    policy.systems().iter().enumerate().find_map(of_system)
}

fn of_system(system: &LinearSystem, policy: &PolicyMsg, slack: f64) -> Option<&'static str> {
    let within = |values: &[f64], max: f64| values.iter().all(|x| x.abs() <= max);
    let entries = [system.of_position, system.of_velocity].iter().all(|m| within(m, 1e6))
        && within(&system.of_drive, 1e6)
        && within(&system.offset, 1e6);
    let gaussian = within(&[system.log_prior], 1e3)
        && within(&system.center, 100.0)
        && within(&system.covariance, 1e4);
    if !entries || !gaussian {
        return Some("an entry");
    }
    let (d, drive_dim) = (policy.task_dim as usize, policy.drive_dim());
    let unit = |r: usize, c: usize| f64::from(u8::from(r == c));
    let sigma = |r: usize, c: usize| system.covariance_at(r, c);
    let least = 1e-8 * (1.0 - SMALL * slack.signum());
    let is_gaussian = is_positive(drive_dim, |r, c| sigma(r, c) - unit(r, c) * least)
        && is_positive(drive_dim, |r, c| unit(r, c) * 1e4 * (1.0 + slack) - sigma(r, c));
    if !is_gaussian {
        return Some("covariance");
    }
    let follows = policy.output == OUTPUT_VELOCITY;
    let lambda = if follows { policy.following } else { 1.0 };
    let is_within = |m: &[f64; 36], max: f64| {
        let squared = |r: usize, c: usize| -> f64 {
            (0..d).map(|k| m[TASK_DIM * k + r] * m[TASK_DIM * k + c]).sum()
        };
        let max = (max / lambda).powi(2) * (1.0 + GAIN * slack.signum());
        is_positive(d, |r, c| unit(r, c) * max - squared(r, c))
    };
    let is_used = |k: usize| (k / TASK_DIM).max(k % TASK_DIM) < d;
    if follows && (0..36).any(|k| is_used(k) && system.of_velocity[k] != 0.0) {
        return Some("of_velocity of a velocity");
    }
    if !is_within(&system.of_position, 5e4) || !is_within(&system.of_velocity, 1e3) {
        return Some("gain");
    }
    match policy.activation == ACTIVATION_STATE {
        true => of_field(system, policy, slack),
        false => None,
    }
}

fn of_field(system: &LinearSystem, policy: &PolicyMsg, slack: f64) -> Option<&'static str> {
    let d = policy.task_dim as usize;
    if system.of_drive[..d].iter().any(|x| *x != 0.0) {
        return Some("of_drive of a field");
    }
    let A = |r: usize, c: usize| system.of_position_at(r, c);
    let P = |r: usize, c: usize| policy.certificate_at(r, c);
    let PA = |r: usize, c: usize| -> f64 { (0..d).map(|k| P(r, k) * A(k, c)).sum() };
    let rate = 1e-3 * (1.0 - SMALL * slack.signum());
    if !is_positive(d, |r, c| -0.5 * (PA(r, c) + PA(c, r)) - rate * P(r, c)) {
        return Some("contraction");
    }
    let x = |i: usize| match policy.orientation == ORIENTATION_SPHERE && i >= 3 {
        true => 0.0,
        false => policy.target[i],
    };
    let left = |r: usize| (0..d).map(|c| A(r, c) * x(c)).sum::<f64>() + system.offset[r];
    if (0..d).any(|r| left(r).abs() > 1e-6 * (1.0 + SMALL * slack.signum())) {
        return Some("not at rest at the target");
    }
    let lambda = policy.following * (1.0 + LAMBDA * slack.signum());
    (!is_followed(d, P, PA, lambda)).then_some("following")
}

/// With S = −½(PA + AᵀP) and T = ½(PA − AᵀP), both in the coordinates of the message, the motion that follows has the
/// certificate [S, T; Tᵀ, λP − S] ≻ 0.
fn is_followed(
    d: usize,
    P: impl Fn(usize, usize) -> f64,
    PA: impl Fn(usize, usize) -> f64,
    lambda: f64,
) -> bool {
    let S = |r: usize, c: usize| -0.5 * (PA(r, c) + PA(c, r));
    let T = |r: usize, c: usize| 0.5 * (PA(r, c) - PA(c, r));
    is_positive(2 * d, |r, c| match (r < d, c < d) {
        (true, true) => S(r, c),
        (true, false) => T(r, c - d),
        (false, true) => T(c, r - d),
        (false, false) => lambda * P(r - d, c - d) - S(r - d, c - d),
    })
}
