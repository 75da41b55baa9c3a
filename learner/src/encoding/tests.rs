//! What holds for every encoding: a fit is a policy, θ and policy are two names for one thing, and no θ is refused.

#![allow(non_snake_case)] // P

use super::*;
use crate::LearnerConfig;
use crate::problem::Problem;
use search::normals::{standard_normal, stream};

const IDS: PolicyIds = PolicyIds { session: 9, rollout: 3, policy_id: 5 };

fn pancake() -> Demonstration {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../demos/pancake.csv");
    let text = std::fs::read_to_string(path).expect("the project's demonstration");
    Demonstration::parse("pancake.csv", &text).expect("it is valid")
}

/// A movement that ends where it has not been before, in x, z and pitch.
fn reach() -> Demonstration {
    let n = pancake().poses().len();
    let pose = |k: usize| {
        let u = k as f64 / (n - 1) as f64;
        let u = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
        [0.5 + 0.3 * u, 0.0, 0.6 + 0.2 * u * u, 0.4 * u, 0.0, 0.0]
    };
    pancake().with_poses((0..n).map(pose).collect())
}

/// One that a field of the state can follow, where it has to.
fn shown(kind: EncodingKind) -> Demonstration {
    if kind == EncodingKind::Seds { reach() } else { pancake() }
}

fn config(kind: EncodingKind, task_dim: usize) -> LearnerConfig {
    let config = LearnerConfig { task_dim, ..LearnerConfig::default() };
    // A field is searched for: with fewer components it takes less time.
    let n_components = if kind == EncodingKind::Seds { 4.into() } else { config.n_components };
    LearnerConfig { n_components, ..config }.encoded(kind)
}

fn encoding(config: &LearnerConfig) -> (Encoding, PolicyMsg) {
    let policy = fit(&config.encoding(), &[shown(config.encoding)]).expect("it can be fitted");
    (Encoding::new(&policy, config.encoding()).expect("the fit is its base"), policy)
}

/// θ of the fit with noise of `std` in scaled units on every parameter.
fn around_fit((encoding, policy): &(Encoding, PolicyMsg), seed: u64, std: f64) -> DVector<f64> {
    let mut rng = stream(seed, 0);
    encoding.encode(policy).unwrap().map(|value| value + std * standard_normal(&mut rng))
}

#[test]
fn the_fit_comes_back_from_its_theta() {
    for kind in EncodingKind::ALL {
        for task_dim in [3, 4, 6] {
            let config = config(kind, task_dim);
            assert_eq!(config.validate(), Ok(()), "{kind:?}");
            let (encoding, policy) = encoding(&config);
            let theta = encoding.encode(&policy).unwrap();
            assert_eq!(theta.len(), encoding.dim());
            let back = encoding.decode(&theta, IDS);
            assert_eq!(back.validate(), Ok(()));
            assert_eq!((back.session, back.rollout, back.policy_id), (9, 3, 5));
            assert!(
                (encoding.encode(&back).unwrap() - theta).amax() < 1e-9,
                "{kind:?}, {task_dim}"
            );
        }
    }
}

/// As long as nothing has to be moved into its bounds; what was moved stays where it is.
#[test]
fn encode_inverts_decode() {
    for kind in EncodingKind::ALL {
        for task_dim in [3, 4, 6] {
            let encoding = encoding(&config(kind, task_dim));
            for (seed, std) in [(1, 0.001), (2, 0.03), (3, 0.3), (4, 0.3), (5, 3.0), (6, 10.0)] {
                let theta = around_fit(&encoding, seed, std);
                let policy = encoding.0.decode(&theta, IDS);
                assert_eq!(policy.validate(), Ok(()));
                let back = encoding.0.encode(&policy).unwrap();
                let again = encoding.0.encode(&encoding.0.decode(&back, IDS)).unwrap();
                let (error, moved) = ((&again - &back).amax(), (&back - theta).amax());
                assert!(error < 1e-5, "{kind:?}, {task_dim}, {std}: {error}");
                let inside = if kind == EncodingKind::Seds { 0.001 } else { 0.3 };
                assert!(std > inside || moved < 1e-6, "{kind:?}, {task_dim}, {std}: {moved}");
            }
        }
    }
}

#[test]
fn every_theta_gives_a_valid_policy() {
    for kind in EncodingKind::ALL {
        for (task_dim, std) in [(3, 1.0), (4, 10.0), (6, 100.0), (4, 1e6)] {
            let encoding = encoding(&config(kind, task_dim));
            for seed in 0..20 {
                let policy = encoding.0.decode(&around_fit(&encoding, seed, std), IDS);
                assert_eq!(policy.validate(), Ok(()), "{kind:?}, {task_dim}, {std}, seed {seed}");
            }
        }
    }
}

/// What is searched: the altered demonstrations, within the box.
#[test]
fn one_unit_along_a_direction_is_the_refit_to_an_altered_demonstration() {
    for kind in EncodingKind::ALL {
        let (config, shown) = (config(kind, 4), shown(kind));
        let (encoding, policy) = encoding(&config);
        let space = Problem::new(&config, std::slice::from_ref(&shown)).unwrap().spaces.remove(0);
        assert_eq!(space.theta_0, encoding.encode(&policy).unwrap());
        assert!(space.bounds.as_ref().unwrap().contains(&space.theta_0), "{kind:?}");
        let start = shown.poses()[0];
        let grown = shown.poses().iter().map(|pose| {
            let growth = config.exploration.position_amplitude;
            std::array::from_fn(|c| match c < 3 {
                true => pose[c] + growth * (pose[c] - start[c]),
                false => pose[c],
            })
        });
        let theta =
            |shown: Demonstration| encoding.encode(&encoding.refit(&[shown]).unwrap()).unwrap();
        let changed = theta(shown.with_poses(grown.collect())) - theta(shown.clone());
        assert!((space.exploration.column(0) - changed).amax() < 1e-9, "{kind:?}");
    }
}

/// Springs are what they were before there was a choice, the stored configuration included.
#[test]
fn springs_are_the_default_and_leave_no_trace() {
    let config = LearnerConfig::default();
    assert_eq!(config.clone().encoded(EncodingKind::Springs), config);
    let text = serde_json::to_string(&config).unwrap();
    assert!(!text.contains("encoding") && !text.contains("demonstrations_are"), "{text}");
}

#[test]
fn a_session_keeps_its_encoding() {
    let (springs, dmp) = (LearnerConfig::default(), config(EncodingKind::Dmp, 4));
    let same_but = LearnerConfig { encoding: EncodingKind::Dmp, ..springs.clone() };
    let message = same_but.check_resumes(&springs).unwrap_err().to_string();
    assert!(message.contains("learner.encoding is \"dmp\""), "{message}");
    assert!(message.contains("started with its default"), "{message}");
    let message = springs.check_resumes(&same_but).unwrap_err().to_string();
    assert!(message.contains("learner.encoding is its default"), "{message}");
    assert_eq!(dmp.check_resumes(&dmp), Ok(()));
}

#[test]
fn what_an_encoding_does_not_have_is_refused_with_what_to_set() {
    type Break = fn(&mut LearnerConfig);
    let breaks: [(&str, Break); 3] = [
        ("learner.compliance.weight is 1.5: use 0 with learner.encoding = \"dmp\"", |c| {
            c.compliance.weight = 1.5;
        }),
        ("learner.exploration.stiffness is full: use fixed with", |c| {
            c.exploration.stiffness = crate::exploration::StiffnessKind::Full;
        }),
        ("learner.demonstrations_are is repetitions: use starts with", |c| {
            c.demonstrations_are = crate::demonstration::DemonstrationsAre::Repetitions;
        }),
    ];
    for (expected, break_it) in breaks {
        let mut config = config(EncodingKind::Dmp, 4);
        break_it(&mut config);
        let message = config.validate().expect_err(expected).to_string();
        assert!(message.contains(expected), "{message:?} lacks {expected:?}");
    }
}

/// Eq. (3): a primitive whose forces vanish is a spring that pulls to the goal.
#[test]
fn without_forces_every_attractor_is_the_goal() {
    let (encoding, _) = encoding(&config(EncodingKind::Dmp, 4));
    let mut theta = DVector::zeros(encoding.dim());
    theta[encoding.dim() - 4] = 20.0; // x of the goal, in units of 3 cm
    let policy = encoding.decode(&theta, IDS);
    for component in policy.components() {
        assert!((component.attractor[0] - 0.6).abs() < 1e-12);
        assert_eq!(component.attractor[1..4], [0.0; 3]);
    }
    let mut stiffer = policy;
    stiffer.components[2].stiffness[0] *= 2.0;
    let error = encoding.encode(&stiffer.sealed()).unwrap_err().to_string();
    assert!(error.starts_with("component 2: its stiffness"), "{error}");
}

/// A local model of the position alone has the eigenvalues of [0 I; −(K + W) −κᵛI].
#[test]
fn every_local_model_is_stable_whatever_theta_is() {
    let encoding = encoding(&config(EncodingKind::Tsm, 4));
    for (seed, std) in [(1, 0.0), (2, 1.0), (3, 10.0), (4, 100.0)] {
        let policy = encoding.0.decode(&around_fit(&encoding, seed, std), IDS);
        for system in policy.systems() {
            let companion = nalgebra::DMatrix::from_fn(8, 8, |row, col| match (row < 4, col < 4) {
                (true, true) => 0.0,
                (true, false) => f64::from(u8::from(row == col - 4)),
                (false, true) => system.of_position_at(row - 4, col),
                (false, false) => system.of_velocity_at(row - 4, col - 4),
            });
            let eigenvalues = companion.complex_eigenvalues();
            assert!(eigenvalues.iter().all(|value| value.re < 0.0), "{std}: {eigenvalues}");
        }
    }
}

/// Springs whose pull is not turned: with W = 0 the acceleration is that of Eq. (5).
#[test]
fn the_springs_in_a_model_are_those_of_its_theta() {
    let (encoding, policy) = encoding(&config(EncodingKind::Tsm, 4));
    let (springs, map) = encoding.springs(&policy).unwrap();
    let theta = encoding.encode(&policy).unwrap();
    assert_eq!(theta.rows(0, map.dim()), map.encode(&springs).unwrap());
    assert_eq!(encoding.dim(), 8 * (4 + 16));
    let (x, t_s) = ([0.7, 0.1, 0.8, 0.3], 0.5);
    let h = crate::activation::policy_activations(&springs, t_s);
    for (h, (system, spring)) in h.iter().zip(policy.systems().iter().zip(springs.components())) {
        for row in 0..4 {
            let pull = |col: usize| system.of_position_at(row, col) * x[col];
            let found = h * (system.offset[row] + (0..4).map(pull).sum::<f64>());
            let turned =
                |col: usize| -system.of_position_at(row, col) * (spring.attractor[col] - x[col]);
            let expected = h * (0..4).map(turned).sum::<f64>();
            assert!((found - expected).abs() < 1e-9 * (1.0 + expected.abs()), "{found} {expected}");
        }
    }
}

#[test]
fn a_stiffness_is_explored_where_there_is_one() {
    for kind in EncodingKind::ALL.into_iter().filter(|kind| *kind != EncodingKind::Seds) {
        let mut config = config(kind, 4);
        if kind.has_stiffness() {
            config.exploration.stiffness = crate::exploration::StiffnessKind::Uniform;
        }
        let n = if kind.has_stiffness() { 7 } else { 5 };
        let space = Problem::new(&config, &[pancake()]).unwrap().spaces.remove(0);
        assert_eq!(space.exploration.ncols(), n, "{kind:?}");
    }
}

/// V falls at every rate and the loop can follow, whatever θ is.
#[test]
fn the_certificate_of_a_field_holds_for_every_theta() {
    let encoding = encoding(&config(EncodingKind::Seds, 4));
    for seed in 0..40 {
        let std = 10_f64.powi(seed as i32 % 4 - 1);
        let policy = encoding.0.decode(&around_fit(&encoding, seed, std), IDS);
        let (systems, certificate) = certified(&policy);
        let rate = certificate.check(&systems).unwrap_or_else(|error| panic!("{std}: {error}"));
        assert!(rate > 0.99 * 2.0 * 0.01, "{std}: {rate}");
        let needed = certificate.damping(&systems).unwrap();
        assert!(needed < policy.following, "{std}: {needed}");
    }
}

/// The field of a policy, for those who check certificates.
fn certified(policy: &PolicyMsg) -> (imitation::Systems, imitation::stable::Certificate) {
    let d = policy.task_dim as usize;
    let square = |entry: &dyn Fn(usize, usize) -> f64| nalgebra::DMatrix::from_fn(d, d, entry);
    let vector = |of: &[f64]| DVector::from_column_slice(&of[..d]);
    let n = policy.systems().len();
    let systems = imitation::Systems::new(
        vec![1.0 / n as f64; n],
        policy.systems().iter().map(|one| vector(&one.center)).collect(),
        policy.systems().iter().map(|one| square(&|r, c| one.covariance_at(r, c))).collect(),
        policy.systems().iter().map(|one| square(&|r, c| one.of_position_at(r, c))).collect(),
        policy.systems().iter().map(|one| vector(&one.offset)).collect(),
    );
    let P = square(&|r, c| policy.certificate[shm_types::policy::packed_index(r, c)]);
    let target = vector(&policy.target);
    (systems.unwrap(), imitation::stable::Certificate { P, target })
}

#[test]
fn a_field_comes_near_the_end_of_the_movement() {
    let (_, policy) = encoding(&config(EncodingKind::Seds, 4));
    let (systems, certificate) = certified(&policy);
    let priors = policy.systems().iter().map(|one| one.log_prior.exp());
    let systems = imitation::Systems { priors: priors.collect(), ..systems };
    let field = imitation::stable::StableField { systems, certificate };
    let start = DVector::from_column_slice(&reach().poses()[0][..4]);
    let path = field.driven(&start, policy.following, 2.0 * policy.duration_s, 0.01);
    let end = DVector::from_column_slice(&reach().poses()[reach().poses().len() - 1][..4]);
    let left = (path.column(path.ncols() - 1) - &end).norm();
    assert!(left < 0.1 * (&start - &end).norm(), "{left}");
}

/// What the fits refuse is said with the files and with what to do.
#[test]
fn what_cannot_be_fitted_names_its_files() {
    let refused = |kind, n_components: usize, shown: &[Demonstration]| {
        let mut config = config(kind, 4);
        config.n_components = n_components.into();
        fit(&config.encoding(), shown).unwrap_err().to_string()
    };
    let closed = refused(EncodingKind::Seds, 8, &[pancake()]);
    assert!(closed.contains("pancake.csv leads away from its end"), "{closed}");
    assert!(closed.contains("learner.encoding"), "{closed}");
    let rows: String = (0..12).map(|k| format!("0.{k:02},0.7,0,0.{k:02},0\n")).collect();
    let short = format!("t_s,x_m,y_m,z_m,pitch_rad\n{rows}");
    let short = Demonstration::parse("short.csv", &short).unwrap();
    let many = refused(EncodingKind::Gmr, 8, &[short]);
    assert!(many.contains("8 components in 1 coordinates and time need 24 points: short.csv has 12, from 0 s to 0.11 s"), "{many}");
    assert!(many.contains("learner.n_components"), "{many}");
}

/// The same movement shown twice is that movement; a mixture of it may be another one.
#[test]
fn repetitions_of_one_movement_make_one_start() {
    for kind in EncodingKind::ALL.into_iter().filter(|kind| kind.fits_several()) {
        let mut config = config(kind, 4);
        let (alone, twice) = ([shown(kind)], [shown(kind), shown(kind)]);
        assert_eq!(Problem::new(&config, &twice).unwrap().spaces.len(), 2, "{kind:?}");
        config.demonstrations_are = crate::demonstration::DemonstrationsAre::Repetitions;
        assert_eq!(config.validate(), Ok(()));
        assert_eq!(Problem::new(&config, &twice).unwrap().spaces.len(), 1, "{kind:?}");
        let (encoding, policy) = encoding(&config);
        let theta = |shown| encoding.encode(&encoding.refit(shown).unwrap()).unwrap();
        assert_eq!(encoding.refit(&alone).unwrap().validate(), Ok(()));
        if kind != EncodingKind::Seds {
            let error = (theta(&twice) - encoding.encode(&policy).unwrap()).amax();
            assert!(error < 1e-6, "{kind:?}: {error}");
        }
    }
}

/// Springs follow what was shown of them; systems, whose target is one, stay where it began.
#[test]
fn coordinates_that_are_not_learnt_are_held_where_they_begin() {
    let tilted = |kind| {
        let shown = shown(kind);
        let tilt = |(k, pose): (usize, &[f64; 6])| {
            let mut pose = *pose;
            (pose[3], pose[4]) = (0.2, 0.1 + 0.001 * k as f64);
            pose
        };
        shown.with_poses(shown.poses().iter().enumerate().map(tilt).collect())
    };
    for kind in [EncodingKind::Gmr, EncodingKind::Seds, EncodingKind::Tsm] {
        let policy = fit(&config(kind, 3).encoding(), &[tilted(kind)]).unwrap();
        assert_eq!(policy.target[3..], [0.2, 0.1, 0.0], "{kind:?}");
    }
}

/// What a task computes of a policy before its rollout it computes of springs.
#[test]
fn measures_are_predicted_where_the_loop_runs_springs() {
    for kind in EncodingKind::ALL {
        let config = config(kind, 4);
        let predictor = crate::prediction::Predictor::new(|_| vec![("apex_m", 1.0)]);
        let problem = Problem::new(&config, &[shown(kind)]).unwrap();
        let problem = problem.with_prediction(&config, Some(predictor));
        let is_predicted = problem.spaces[0].prediction.is_some();
        let runs_springs = matches!(kind, EncodingKind::Springs | EncodingKind::Dmp);
        assert_eq!(is_predicted, runs_springs, "{kind:?}");
    }
}

/// Eq. (3) fitted on its own, with forces about the goal, is the policy that is fitted as springs.
#[test]
fn a_primitive_is_that_of_the_crate_imitation() {
    use imitation::activations::Drive;
    use imitation::dmp::{DmpOptions, Form};
    let (_, policy) = encoding(&config(EncodingKind::Dmp, 4));
    let (shown, n) = (pancake(), pancake().poses().len());
    let points = nalgebra::DMatrix::from_fn(4, n, |c, k| shown.poses()[k][c]);
    let recording = imitation::Recording::new("pancake", shown.period_s(), points).unwrap();
    let drive = Drive::Decay { rate: policy.decay_rate };
    let options = DmpOptions { form: Form::Plain, drive, n_components: 8, ..Default::default() };
    let dmp = imitation::Dmp::fit(&[recording], &options).unwrap();
    for (spring, force) in policy.components().iter().zip(&dmp.forces) {
        let attractor = &dmp.goal + force / dmp.kappa_p;
        let fitted = DVector::from_column_slice(&spring.attractor[..4]);
        assert!((attractor - &fitted).amax() < 1e-4, "{fitted}");
    }
}
