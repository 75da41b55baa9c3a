//! What holds for every encoding: a fit is a policy, θ and policy are two names for one thing, and no θ is refused.

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

fn config(kind: EncodingKind, task_dim: usize) -> LearnerConfig {
    LearnerConfig { task_dim, ..LearnerConfig::default() }.encoded(kind)
}

fn encoding(config: &LearnerConfig) -> (Encoding, PolicyMsg) {
    let policy = fit(&config.encoding(), &[pancake()]);
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

#[test]
fn encode_inverts_decode() {
    for kind in EncodingKind::ALL {
        for task_dim in [3, 4, 6] {
            let encoding = encoding(&config(kind, task_dim));
            for seed in 0..20 {
                let theta = around_fit(&encoding, seed, 1.0);
                let policy = encoding.0.decode(&theta, IDS);
                assert_eq!(policy.validate(), Ok(()));
                let back = encoding.0.encode(&policy).unwrap();
                assert!((back - theta).amax() < 1e-6, "{kind:?}, {task_dim}, seed {seed}");
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
        let config = config(kind, 4);
        let (encoding, policy) = encoding(&config);
        let space = Problem::new(&config, &[pancake()]).unwrap().spaces.remove(0);
        assert_eq!(space.theta_0, encoding.encode(&policy).unwrap());
        assert!(space.bounds.as_ref().unwrap().contains(&space.theta_0), "{kind:?}");
        let grown = pancake().poses().to_vec();
        let start = grown[0];
        let grown = grown.into_iter().map(|mut pose| {
            (0..3).for_each(|c| {
                pose[c] += config.exploration.position_amplitude * (pose[c] - start[c])
            });
            pose
        });
        let refitted = encoding.refit(&[pancake().with_poses(grown.collect())]);
        let theta = &space.theta_0 + space.exploration.column(0);
        assert!((theta - encoding.encode(&refitted).unwrap()).amax() < 1e-9, "{kind:?}");
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
