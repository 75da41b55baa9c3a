//! Demonstrations with a free and a narrow part, in position and orientation: where a session begins stiff.

use std::f64::consts::{PI, TAU};

use nalgebra::{UnitQuaternion, Vector3};
use search::normals::{standard_normal, stream};
use shm_types::policy::PolicyMsg;

use super::*;
use crate::LearnerConfig;
use crate::activation::stiffness;
use crate::demonstration::DemonstrationsAre;
use crate::encoding::{Encoding, fit};
use crate::parameters::PolicyIds;
use crate::problem::Problem;

const DURATION_S: f64 = 6.0;
const N_POINTS: usize = 301;
const SEEDS: u64 = 20;

/// How far repetitions are from each other at the share `u` of the movement: much before its middle, little after.
fn room(u: f64) -> f64 {
    0.04 + (PI * u).sin() / (1.0 + (40.0 * (u - 0.5)).exp())
}

/// `n` repetitions of a way of 0.3 m that turns about the vertical by `yaw` rad, off by up to some centimetres and
/// some tenths of a radian in its first half. With quaternions, or with rotation vectors.
fn repetitions(seed: u64, n: usize, yaw: f64, orientation: Orientation) -> Vec<Demonstration> {
    let mut rng = stream(seed, 0);
    let mut one = |m: usize| {
        // Off by smooth bumps of random height.
        let mut bumps = || [0; 6].map(|_| standard_normal(&mut rng));
        let heights: [[f64; 6]; 6] = [(); 6].map(|_| bumps());
        let row = |k: usize| {
            let u = k as f64 / (N_POINTS - 1) as f64;
            let rise = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
            let wave = |c: usize| -> f64 {
                let each = heights[c].iter().enumerate();
                let bump = |(i, h): (usize, &f64)| {
                    h * (-0.5 * ((u - i as f64 / 5.0) / 0.12).powi(2)).exp()
                };
                room(u) * each.map(bump).sum::<f64>()
            };
            let [x, y, z] =
                [0.5 + 0.3 * rise + 0.01 * wave(0), 0.02 * wave(1), 0.6 + 0.02 * wave(2)];
            let off = Vector3::new(wave(3), wave(4), wave(5)) * 0.1;
            let R = UnitQuaternion::from_scaled_axis(off)
                * UnitQuaternion::from_scaled_axis(Vector3::z() * yaw * rise);
            let t_s = DURATION_S * u;
            let r = R.scaled_axis();
            match orientation {
                Orientation::Sphere => {
                    format!("{t_s},{x},{y},{z},{},{},{},{}\n", R.w, R.i, R.j, R.k)
                }
                Orientation::Vector => format!("{t_s},{x},{y},{z},{},{},{}\n", r.y, r.x, r.z),
            }
        };
        let rows: String = (0..N_POINTS).map(row).collect();
        let header = match orientation {
            Orientation::Sphere => "qw,qx,qy,qz",
            Orientation::Vector => "pitch_rad,roll_rad,yaw_rad",
        };
        let text = format!("t_s,x_m,y_m,z_m,{header}\n{rows}");
        Demonstration::parse(&format!("r{m}.csv"), &text).expect("it is valid")
    };
    (0..n).map(|m| one(m + 1)).collect()
}

fn config(orientation: Orientation) -> LearnerConfig {
    let mut config = LearnerConfig {
        task_dim: 6,
        orientation,
        n_components: 12.into(),
        // A soft spring under κᵛ = 2√k_max would pull from far ahead.
        damping_ratio: 1.0,
        initial_stiffness: InitialStiffness::Variability,
        demonstrations_are: DemonstrationsAre::Repetitions,
        ..LearnerConfig::default()
    };
    // The movement does not come back, so it has no phases.
    config.exploration.stiffness = crate::exploration::StiffnessKind::Uniform;
    config.exploration.rotation_amplitude = 0.1;
    config
}

/// Mean stiffness of a block over a part of the movement, in shares of its duration, s⁻².
fn mean(policy: &PolicyMsg, block: std::ops::Range<usize>, part: std::ops::Range<f64>) -> f64 {
    let shares: Vec<f64> =
        (0..200).map(|k| k as f64 / 200.0).filter(|u| part.contains(u)).collect();
    let trace = |u: &f64| {
        block.clone().map(|c| stiffness(policy, DURATION_S * *u)[(c, c)]).sum::<f64>() / 3.0
    };
    shares.iter().map(trace).sum::<f64>() / shares.len() as f64
}

#[test]
fn a_session_begins_stiff_where_its_demonstrations_agree() {
    for (orientation, yaw) in [(Orientation::Vector, 1.0), (Orientation::Sphere, TAU)] {
        let config = config(orientation);
        assert_eq!(config.validate(), Ok(()));
        for seed in 0..SEEDS {
            let shown = repetitions(seed, 5, yaw, orientation);
            let policy = fit(&config.encoding(), &shown).unwrap();
            assert_eq!(policy.validate(), Ok(()));
            for block in [0..3, 3..6] {
                let free = mean(&policy, block.clone(), 0.1..0.4);
                let narrow = mean(&policy, block.clone(), 0.6..1.0);
                assert!(narrow > 1.5 * free, "{orientation:?} {seed} {block:?}: {free} {narrow}");
            }
        }
    }
}

#[test]
fn stiffnesses_are_full_in_position_and_in_rotation_and_within_their_bounds() {
    let config = config(Orientation::Sphere);
    let policy = fit(&config.encoding(), &repetitions(3, 5, TAU, Orientation::Sphere)).unwrap();
    let [k_min, k_max] = bounds(config.kappa_p, config.stiffness_range);
    assert_eq!([k_min, k_max], [50.0, 800.0]);
    assert_eq!(policy.damping, 2.0 * 800_f64.sqrt());
    for component in policy.components() {
        let K = DMatrix::from_fn(6, 6, |row, col| component.stiffness_at(row, col));
        let eigenvalues = K.symmetric_eigenvalues();
        assert!(eigenvalues.min() > 49.999 && eigenvalues.max() < 800.001, "{eigenvalues}");
        let between = K.view((3, 0), (3, 3)).amax();
        assert_eq!(between, 0.0, "what mixes m and rad is no direction");
    }
    let largest = |row: usize, col: usize| {
        let entries = policy.components().iter().map(|one| one.stiffness_at(row, col).abs());
        entries.fold(0.0, f64::max)
    };
    assert!(largest(1, 0) > 5.0 && largest(4, 3) > 5.0, "{} {}", largest(1, 0), largest(4, 3));
    // And it is what the search begins with.
    let encoding = Encoding::new(&policy, config.encoding()).unwrap();
    let theta = encoding.encode(&policy).unwrap();
    let back = encoding.decode(&theta, PolicyIds::default());
    assert!((encoding.encode(&back).unwrap() - theta).amax() < 1e-9);
}

/// What alters a movement leaves its stiffness as it is.
#[test]
fn directions_of_movement_keep_the_stiffness() {
    let config = config(Orientation::Sphere);
    let shown = repetitions(1, 4, TAU, Orientation::Sphere);
    let problem = Problem::new(&config, &shown).unwrap();
    assert_eq!(problem.spaces.len(), 1);
    let space = &problem.spaces[0];
    let stiffness = |policy: &PolicyMsg| policy.components.map(|component| component.stiffness);
    let start = problem.decode(&space.theta_0, PolicyIds::default());
    let theta = &space.theta_0 + space.exploration.column(0) * 0.5;
    let moved = problem.decode(&theta, PolicyIds::default());
    let pairs =
        stiffness(&start).into_iter().flatten().zip(stiffness(&moved).into_iter().flatten());
    assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-6));
    assert!(start.components[5].attractor != moved.components[5].attractor);
}

#[test]
fn a_coordinate_in_which_nothing_differs_keeps_kappa_p() {
    let flat: Vec<Demonstration> = repetitions(2, 3, 0.0, Orientation::Vector)
        .iter()
        .map(|one| {
            let level = |pose: &Pose| [pose[0], 0.0, pose[2], 0.0, 0.0, 0.0];
            one.with_poses(one.poses().iter().map(level).collect())
        })
        .collect();
    let policy = fit(&config(Orientation::Vector).encoding(), &flat).unwrap();
    for component in policy.components() {
        assert!([1, 3, 4, 5].iter().all(|c| component.stiffness_at(*c, *c) == 200.0));
        assert_ne!(component.stiffness_at(2, 2), 200.0);
    }
}

#[test]
fn what_says_nothing_of_stiffness_is_refused_with_its_files() {
    let config = config(Orientation::Vector).encoding();
    let refused = |shown: &[Demonstration]| fit(&config, shown).unwrap_err().to_string();
    let all = repetitions(1, 3, 0.5, Orientation::Vector);
    let one = refused(&all[..1]);
    assert!(one.contains("variability of r1.csv: 1 recordings"), "{one}");
    assert!(one.contains("at least 3") && one.contains("task.other_demonstrations"), "{one}");
    let two = refused(&all[..2]);
    assert!(two.contains("r1.csv, r2.csv: 2 recordings"), "{two}");
    let same = refused(&[all[0].clone(), all[0].clone(), all[0].clone()]);
    assert!(same.contains("are all the same") && same.contains("kappa_p"), "{same}");
}
