//! Demonstrations with a free and a narrow part: where they are stiff, and what that is worth.

use std::f64::consts::{PI, TAU};

use rand_chacha::ChaCha8Rng;
use search::normals::{standard_normal, stream};

use super::*;

const DURATION_S: f64 = 2.0;
const N_POINTS: usize = 201;
/// The narrow part (s); the free one ends 0.2 s before it.
const NARROW_S: std::ops::Range<f64> = 1.2..2.0;
const FREE_S: std::ops::Range<f64> = 0.2..0.8;

/// Five demonstrations (m) of 0.5 m along x that may go up to some centimetres off in y and z in their first
/// half, as through a room, and a millimetre or two in their second, as through a slot.
fn demonstrations(rng: &mut ChaCha8Rng) -> Vec<Recording> {
    let mut demonstrate = |m: usize| {
        // Off by smooth bumps of random height, whose sizes follow the room there is.
        let mut bumps = || [0; 6].map(|_| standard_normal(rng));
        let (off_x, off_y, off_z) = (bumps(), bumps(), bumps());
        let points = DMatrix::from_fn(3, N_POINTS, |c, k| {
            let u = k as f64 / (N_POINTS - 1) as f64;
            let rise = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
            let room = 0.0015 + 0.03 * (1.0 / (1.0 + (40.0 * (u - 0.5)).exp())) * (PI * u).sin();
            let wave = |heights: &[f64; 6]| -> f64 {
                let each = heights.iter().enumerate();
                each.map(|(i, h)| h * (-0.5 * ((u - i as f64 / 5.0) / 0.12_f64).powi(2)).exp())
                    .sum()
            };
            match c {
                0 => 0.5 * rise + 0.5 * room * wave(&off_x),
                1 => 0.1 * (PI * rise).sin() + room * wave(&off_y),
                _ => room * wave(&off_z),
            }
        });
        Recording::new(format!("demonstration {m}"), DURATION_S / (N_POINTS - 1) as f64, points)
    };
    (0..5).map(|m| demonstrate(m).unwrap()).collect()
}

/// A random push (m/s²): a few sines of up to 3 Hz in each coordinate.
fn push(rng: &mut ChaCha8Rng) -> impl Fn(f64) -> DVector<f64> + use<> {
    let waves: Vec<[f64; 4]> = (0..12)
        .map(|i| {
            let phase = TAU * standard_normal(rng);
            [(i % 3) as f64, 0.5 + 0.8 * (i / 3) as f64, phase, standard_normal(rng)]
        })
        .collect();
    move |t| {
        let mut force = DVector::zeros(3);
        for [c, frequency_hz, phase, height] in &waves {
            force[*c as usize] += height * (TAU * frequency_hz * t + phase).sin();
        }
        force
    }
}

fn mean_stiffness(attractors: &Attractors, part: std::ops::Range<f64>) -> f64 {
    let times = (0..N_POINTS).map(|k| k as f64 * DURATION_S / (N_POINTS - 1) as f64);
    let inside: Vec<f64> =
        times.filter(|t| part.contains(t)).map(|t| attractors.stiffness(t).trace() / 3.0).collect();
    inside.iter().sum::<f64>() / inside.len() as f64
}

/// Root mean square distance (m) to the mean demonstration in the narrow part.
fn error(attractors: &Attractors, mean: &DMatrix<f64>, push: &impl Fn(f64) -> DVector<f64>) -> f64 {
    let period_s = DURATION_S / (N_POINTS - 1) as f64;
    let start = mean.column(0).clone_owned();
    let path = attractors.rollout(&start, DURATION_S, period_s, push);
    let inside = (0..N_POINTS).filter(|k| NARROW_S.contains(&(*k as f64 * period_s)));
    let squares: Vec<f64> =
        inside.map(|k| (path.column(k) - mean.column(k)).norm_squared()).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// The same over several pushes.
fn errors(
    attractors: &Attractors,
    mean: &DMatrix<f64>,
    pushes: &[impl Fn(f64) -> DVector<f64>],
) -> f64 {
    let squares = pushes.iter().map(|push| error(attractors, mean, push).powi(2));
    (squares.sum::<f64>() / pushes.len() as f64).sqrt()
}

/// Half the mean stiffness of ours, everywhere, is what the narrow part is compared with: pushed there, where
/// it matters, and pushed all along, when what the free part yielded comes along into the narrow one.
#[test]
fn the_narrow_part_is_stiffer_and_better_held_than_with_a_uniform_stiffness() {
    let options = VariabilityOptions::default();
    let mut sums = [0.0; 4];
    for seed in 0..50 {
        let mut rng = stream(seed, 0);
        let recordings = demonstrations(&mut rng);
        let ours = attractors(&recordings, &options).unwrap();
        let (free, narrow) = (mean_stiffness(&ours, FREE_S), mean_stiffness(&ours, NARROW_S));
        assert!(narrow > free, "seed {seed}: {narrow} s⁻² is not more than {free} s⁻²");

        let half = mean_stiffness(&ours, 0.0..DURATION_S + 1e-9) / 2.0;
        let K = vec![DMatrix::from_diagonal_element(3, 3, half); options.n_components];
        let uniform =
            Attractors::fit(&recordings, ours.activations.clone(), K, options.kappa_v).unwrap();
        let mean = mean_path(&recordings);
        let all_along: Vec<_> = (0..4).map(|_| push(&mut rng)).collect();
        let there: Vec<_> = all_along
            .iter()
            .map(|push| |t: f64| if NARROW_S.contains(&t) { push(t) } else { DVector::zeros(3) })
            .collect();
        let [a, b] = [&ours, &uniform].map(|policy| errors(policy, &mean, &there));
        let [c, d] = [&ours, &uniform].map(|policy| errors(policy, &mean, &all_along));
        assert!(a <= b && c <= d, "seed {seed}: {a} and {b} m there, {c} and {d} m all along");
        sums.iter_mut().zip([a, b, c, d]).for_each(|(sum, error)| *sum += error);
    }
    let [a, b, c, d] = sums;
    assert!(a < 0.7 * b && c < 0.8 * d, "{a} {b} {c} {d}");
}

#[test]
fn stiffness_has_the_directions_of_the_covariance_and_is_inverse_to_the_deviation() {
    let turn = nalgebra::Rotation2::new(0.6);
    let turn = DMatrix::from_column_slice(2, 2, turn.matrix().as_slice());
    let turned = |a: f64, b: f64| {
        let values = DVector::from_vec(vec![a, b]);
        &turn * DMatrix::from_diagonal(&values) * turn.transpose()
    };
    // Deviations of 1, 2, 2 and 4 mm: 2 mm in the middle.
    let covariances = [turned(1e-6, 4e-6), turned(4e-6, 16e-6)];
    let K = stiffnesses(&covariances, 50.0, 800.0).unwrap();
    assert!((&K[0] - turned(400.0, 200.0)).amax() < 1e-9, "{}", K[0]);
    assert!((&K[1] - turned(200.0, 100.0)).amax() < 1e-9, "{}", K[1]);
    // Limits hold, also for a direction without any variance.
    let flat = stiffnesses(&[turned(0.0, 1e-6)], 50.0, 800.0).unwrap();
    assert!((&flat[0] - turned(800.0, 50.0)).amax() < 1e-9, "{}", flat[0]);
}

#[test]
fn units_and_equal_variability_change_nothing() {
    let recordings = demonstrations(&mut stream(3, 0));
    let mut millimetres = recordings.clone();
    millimetres.iter_mut().for_each(|recording| recording.points *= 1e3);
    let options = VariabilityOptions::default();
    let (one, other) =
        (attractors(&recordings, &options).unwrap(), attractors(&millimetres, &options).unwrap());
    for i in 0..options.n_components {
        assert!((&one.K[i] - &other.K[i]).amax() < 1e-6);
        assert!((&one.mu[i] * 1e3 - &other.mu[i]).amax() < 1e-3);
    }
    let alike = stiffnesses(&vec![DMatrix::identity(3, 3); 4], 50.0, 200.0).unwrap();
    assert!(alike.iter().all(|K| (K - DMatrix::identity(3, 3) * 100.0).amax() < 1e-9));
}

/// One coordinate, at −a, 0 and a of the mean: variance a².
#[test]
fn the_covariance_is_that_of_a_sample() {
    let recordings: Vec<Recording> = [-0.3, 0.0, 0.3]
        .map(|a| {
            let points = DMatrix::from_fn(1, 20, |_, k| k as f64 + a);
            Recording::new("r", 0.1, points).unwrap()
        })
        .to_vec();
    let activations = Activations::spread(Drive::Time, 3, 1.9, 0.5);
    for S in covariances(&recordings, &activations).unwrap() {
        assert!((S[(0, 0)] - 0.09).abs() < 1e-12);
    }
}

#[test]
fn errors_say_what_to_do() {
    let recordings = demonstrations(&mut stream(3, 0));
    let options = VariabilityOptions::default();
    let message = |recordings: &[Recording], options: &VariabilityOptions| {
        attractors(recordings, options).unwrap_err().to_string()
    };
    assert!(message(&recordings[..2], &options).contains("at least 3"));
    let mut shorter = recordings.clone();
    shorter[2] = shorter[2].resampled(100);
    assert!(message(&shorter, &options).starts_with("demonstration 2 has 100 points"));
    assert!(message(&shorter, &options).ends_with("align them first"));
    let same = vec![recordings[0].clone(); 3];
    assert!(message(&same, &options).starts_with("the recordings are all the same"));
    let range = VariabilityOptions { k_min: 600.0, ..options };
    assert!(message(&recordings, &range).starts_with("k_min = 600"));
}
