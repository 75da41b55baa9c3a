//! Policies: noise, valid ones with something changed, and valid or nearly valid ones at the bounds.

use nalgebra::Matrix6;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use shm_types::policy::{ACTIVATION_DECAY, ACTIVATION_TIME, Component, PolicyMsg, packed_index};
use shm_types::{MAX_COMPONENTS, PACKED, TASK_DIM};

use super::bounds::Arm;
use super::{fields, mutate, noise};

/// Which of the three kinds, and the message.
pub fn hostile_policy(rng: &mut ChaCha8Rng, arm: &Arm) -> (&'static str, PolicyMsg) {
    match rng.random_range(0..10) {
        0 => ("noise", noise(rng)),
        1 => ("noise, sealed", dressed(noise(rng), rng).sealed()),
        2..=5 => {
            let mut policy = either_at_the_bounds(rng, arm).sealed();
            mutate(&mut policy, rng);
            if policy.n_systems == 0 && rng.random_bool(0.3) {
                spoil_stiffness(&mut policy, rng);
            }
            // Most of them must get past the digest.
            ("mutated", if rng.random_bool(0.85) { policy.sealed() } else { policy })
        }
        _ => ("at the bounds", either_at_the_bounds(rng, arm).sealed()),
    }
}

fn either_at_the_bounds(rng: &mut ChaCha8Rng, arm: &Arm) -> PolicyMsg {
    if rng.random_bool(0.3) { fields::at_the_bounds(rng, arm) } else { at_the_bounds(rng, arm) }
}

/// Noise whose counts are right, so that what lies behind them is looked at.
fn dressed(noise: PolicyMsg, rng: &mut ChaCha8Rng) -> PolicyMsg {
    let n = rng.random_range(1..=MAX_COMPONENTS as u32);
    let (n_components, n_systems) = if rng.random() { (n, 0) } else { (0, n) };
    PolicyMsg {
        task_dim: [3, 4, 6][rng.random_range(0..3)],
        n_components,
        n_systems,
        activation: rng.random_range(0..2),
        output: 0,
        orientation: rng.random_range(0..2),
        n_actions: 0,
        duration_s: rng.random_range(0.05..2.5),
        ..noise
    }
}

/// Indefinite, singular, or far too stiff.
fn spoil_stiffness(policy: &mut PolicyMsg, rng: &mut ChaCha8Rng) {
    let component = &mut policy.components[rng.random_range(0..2)];
    let (row, column) = (rng.random_range(0..TASK_DIM), rng.random_range(0..TASK_DIM));
    let entry = &mut component.stiffness[packed_index(row, column)];
    *entry = match rng.random_range(0..3) {
        0 => -*entry,
        1 => 0.0,
        _ => *entry * rng.random_range(1.0..1e4),
    };
}

/// Between the bounds, now and then on one, a hair within or a hair beyond.
pub fn between(min: f64, max: f64, rng: &mut ChaCha8Rng) -> f64 {
    let bound = if rng.random() { min } else { max };
    match rng.random_range(0..100) {
        0 => bound,
        1 => bound.next_up(),
        2 => bound.next_down(),
        3 => bound * (1.0 + rng.random_range(-1e-6..1e-6)),
        _ => rng.random_range(min..=max),
    }
}

fn at_the_bounds(rng: &mut ChaCha8Rng, arm: &Arm) -> PolicyMsg {
    let decays: bool = rng.random();
    let mut policy = PolicyMsg {
        session: rng.random(),
        rollout: rng.random(),
        policy_id: rng.random(),
        task_dim: [3, 4, 6][rng.random_range(0..3)],
        n_components: rng.random_range(1..=MAX_COMPONENTS as u32),
        activation: if decays { ACTIVATION_DECAY } else { ACTIVATION_TIME },
        duration_s: between(0.05, arm.longest_s, rng),
        decay_rate: between(if decays { 1e-3 } else { 0.0 }, 1e3, rng),
        damping: between(0.0, 1e3, rng),
        // The stiffest springs bear a ratio of 2.2.
        damping_ratio: if rng.random_bool(0.2) { between(0.0, 10.0, rng) } else { 0.0 },
        orientation_stiffness: between(0.0, 1e5, rng),
        orientation_damping: between(0.0, 1e3, rng),
        orientation: rng.random_range(0..2),
        ..PolicyMsg::EMPTY
    };
    let (d, n) = (policy.task_dim as usize, policy.n_components as usize);
    for component in &mut policy.components[..n] {
        *component = Component {
            center: between(-30.0, 60.0, rng),
            width: between(1e-4, 30.0, rng),
            attractor: point(rng, arm),
            stiffness: [0.0; PACKED],
        };
        set_stiffness(component, d, rng);
    }
    policy
}

/// A point at most as far from the shoulder as is allowed, and any orientation.
pub fn point(rng: &mut ChaCha8Rng, arm: &Arm) -> [f64; TASK_DIM] {
    let direction: [f64; 3] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
    let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-9);
    let distance = between(0.0, arm.farthest_m, rng);
    std::array::from_fn(|i| match i {
        0..3 => arm.shoulder[i] + direction[i] / length * distance,
        _ => between(-100.0, 100.0, rng),
    })
}

/// K with λ between the bounds, most evenly over the decades.
fn set_stiffness(component: &mut Component, d: usize, rng: &mut ChaCha8Rng) {
    let K = rotated(d, rng, |rng| 10_f64.powf(between(-3.0, 5e4_f64.log10(), rng)));
    for row in 0..d {
        for column in 0..=row {
            component.stiffness[packed_index(row, column)] = K[(row, column)];
        }
    }
}

/// Q diag(λ) Qᵀ in the leading d×d block; Q of plane rotations.
pub fn rotated(
    d: usize,
    rng: &mut ChaCha8Rng,
    mut eigenvalue: impl FnMut(&mut ChaCha8Rng) -> f64,
) -> Matrix6<f64> {
    let mut K = Matrix6::zeros();
    for i in 0..d {
        K[(i, i)] = eigenvalue(rng);
    }
    for _ in 0..rng.random_range(0..2 * d) {
        let (i, j) = (rng.random_range(0..d), rng.random_range(0..d));
        if i == j {
            continue;
        }
        let (sin, cos) = rng.random_range(0.0..std::f64::consts::TAU).sin_cos();
        let mut R = Matrix6::identity();
        (R[(i, i)], R[(j, j)], R[(i, j)], R[(j, i)]) = (cos, cos, -sin, sin);
        K = R.transpose() * K * R;
    }
    K
}
