//! Full turns about random axes, means and mixtures of orientations.

use search::normals::{standard_normal, stream};

use super::*;

fn random_vector(rng: &mut rand_chacha::ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| standard_normal(rng))
}

fn random_rotation(rng: &mut rand_chacha::ChaCha8Rng) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(random_vector(rng) * 2.0)
}

#[test]
fn log_and_exp_are_inverse_within_half_a_turn() {
    let mut rng = stream(1, 0);
    for _ in 0..200 {
        let (base, v) = (random_rotation(&mut rng), random_vector(&mut rng).cap_magnitude(3.1));
        assert!((log(&base, &exp(&base, &v)) - v).norm() < 1e-9);
        assert!(log(&base, &base).norm() < 1e-15);
    }
}

#[test]
fn the_mean_of_two_is_between_them_in_proportion_to_their_weights() {
    let mut rng = stream(2, 0);
    for _ in 0..50 {
        let (a, v) = (random_rotation(&mut rng), random_vector(&mut rng).cap_magnitude(1.5));
        let mean = karcher_mean(&[a, exp(&a, &v)], &[1.0, 3.0]).unwrap();
        assert!((log(&a, &mean) - v * 0.75).norm() < 1e-9);
    }
    assert_eq!(karcher_mean(&[], &[]), None);
    assert_eq!(karcher_mean(&[UnitQuaternion::identity()], &[0.0]), None);
}

#[test]
fn the_deviations_from_a_mean_sum_to_nothing() {
    let mut rng = stream(3, 0);
    let base = random_rotation(&mut rng);
    let rotations: Vec<_> = (0..20).map(|_| exp(&base, &(random_vector(&mut rng) * 0.4))).collect();
    let weights: Vec<f64> = (0..20).map(|i| 1.0 + i as f64).collect();
    let mean = karcher_mean(&rotations, &weights).unwrap();
    let sum: Vector3<f64> = rotations.iter().zip(&weights).map(|(q, w)| log(&mean, q) * *w).sum();
    assert!(sum.norm() < 1e-9);
}

#[test]
fn a_mixture_finds_two_groups_of_orientations() {
    let mut rng = stream(4, 0);
    let base = random_rotation(&mut rng);
    let groups = [Vector3::new(0.5, 0.0, 0.0), Vector3::new(-0.5, 0.3, 0.0)];
    let rotations: Vec<_> =
        (0..200).map(|i| exp(&base, &(groups[i % 2] + random_vector(&mut rng) * 0.05))).collect();
    let mixture = RotationMixture::fit(&rotations, 2, &GmmOptions::default(), 0).unwrap();
    for group in groups {
        let truth = exp(&base, &group);
        let nearest = (0..2).map(|i| mixture.center(i).angle_to(&truth)).fold(9.0, f64::min);
        assert!(nearest < 0.03, "{nearest} rad");
        assert!(mixture.responsibilities(&truth).max() > 0.999);
        let away = exp(&base, &Vector3::new(0.0, 0.0, 1.0));
        assert!(mixture.log_density(&truth) > mixture.log_density(&away) + 10.0);
    }
}

#[test]
fn turns_about_a_fixed_axis_have_a_mixture_too() {
    let rotations: Vec<_> =
        (0..60).map(|k| UnitQuaternion::from_scaled_axis(Vector3::z() * 0.02 * k as f64)).collect();
    assert!(RotationMixture::fit(&rotations, 2, &GmmOptions::default(), 0).is_ok());
}

/// Three turns and a bit about a random axis, from anywhere.
fn revolutions(seed: u64) -> (Vector3<f64>, f64, Vec<UnitQuaternion<f64>>) {
    let mut rng = stream(seed, 0);
    let axis = random_vector(&mut rng).normalize();
    let start = random_rotation(&mut rng);
    let total = 3.3 * TAU;
    let turned = |k: usize| UnitQuaternion::from_scaled_axis(axis * (total * k as f64 / 300.0));
    (axis, total, (0..=300).map(|k| turned(k) * start).collect())
}

#[test]
fn full_turns_about_random_axes_are_continuous_and_add_up() {
    for seed in 0..50 {
        let (axis, total, rotations) = revolutions(seed);
        let turns = turns(&rotations);
        assert!((turns[300] - axis * total).norm() < 1e-9, "seed {seed}");
        let step = total / 300.0;
        assert!(turns.windows(2).all(|pair| (pair[1] - pair[0]).norm() < 1.001 * step));
        for (again, rotation) in orientations(&rotations[0], &turns).iter().zip(&rotations) {
            assert!(again.angle_to(rotation) < 1e-9);
        }
    }
}

#[test]
fn unwrapped_rotation_vectors_go_on_beyond_a_turn() {
    for seed in 0..50 {
        let (axis, total, rotations) = revolutions(seed);
        let first = rotations[0];
        let wrapped: Vec<_> =
            rotations.iter().map(|q| (q * first.inverse()).scaled_axis()).collect();
        assert!(wrapped.iter().all(|v| v.norm() <= PI + 1e-9));
        let path = unwrapped(&wrapped).unwrap();
        assert!((path[300] - axis * total).norm() < 1e-9, "seed {seed}");
        for (vector, rotation) in path.iter().zip(&rotations) {
            assert!((UnitQuaternion::from_scaled_axis(*vector) * first).angle_to(rotation) < 1e-9);
        }
    }
}

#[test]
fn quaternions_keep_their_sign_on_the_way() {
    let (_, _, rotations) = revolutions(7);
    let mut flipped = rotations.clone();
    for k in (0..300).step_by(3) {
        flipped[k] = UnitQuaternion::new_unchecked(-flipped[k].into_inner());
    }
    for pair in continuous(&flipped).windows(2) {
        assert!((pair[1].coords - pair[0].coords).norm() < 0.1);
    }
}

#[test]
fn another_axis_after_a_full_turn_is_refused_and_turns_are_not() {
    let about = |axis: Vector3<f64>, angle: f64| axis * angle;
    let mut vectors: Vec<_> =
        (0..=60).map(|k| about(Vector3::x(), TAU * k as f64 / 60.0)).collect();
    vectors.extend((1..20).map(|k| about(Vector3::y(), 0.1 * k as f64)));
    let error = unwrapped(&vectors).unwrap_err();
    assert_eq!((error.point, error.next), (61, 62));
    let rotations: Vec<_> = vectors.into_iter().map(UnitQuaternion::from_scaled_axis).collect();
    assert!((turns(&rotations)[79] - Vector3::new(TAU, 1.9, 0.0)).norm() < 1e-9);
}
