//! Eq. (7) against reference vectors, and where floating point numbers end.

use serde::Deserialize;

use super::super::normals::stream;
use super::super::vectors::{Gmm, close, matrix, read, trials};
use super::*;

#[derive(Deserialize)]
struct EmCase {
    #[serde(rename = "M")]
    n_elites: usize,
    about: String,
    theta: Vec<Vec<f64>>,
    r: Vec<f64>,
    sigma0: Vec<Vec<f64>>,
    gmm: Gmm,
    responsibilities: Vec<Vec<f64>>,
    loglik: f64,
    expected: Gmm,
    loglik_after: f64,
}

#[test]
fn em_step_matches_the_reference_vectors() {
    let cases: Vec<EmCase> = read("em_update.json");
    assert!(!cases.is_empty());
    for case in cases {
        let about = match case.about.as_str() {
            "old" => About::OldMean,
            "new" => About::NewMean,
            other => panic!("scatter about {other}"),
        };
        let step = EmStep { n_elites: case.n_elites, sigma_0: matrix(&case.sigma0), about };
        let trials = trials(&case.theta, &case.r);
        let before = case.gmm.mixture();
        for (m, trial) in trials.iter().enumerate() {
            for (i, h) in before.responsibilities(&trial.theta).iter().enumerate() {
                assert!((h - case.responsibilities[i][m]).abs() < 1e-12, "h{i} of trial {m}");
            }
        }
        close(before.log_likelihood(&trials).unwrap(), case.loglik, 1e-12);
        let after = before.em_step(&trials, &step);
        case.expected.assert_close(&after, 1e-12);
        close(after.log_likelihood(&trials).unwrap(), case.loglik_after, 1e-12);
    }
}

#[derive(Deserialize)]
struct Densities {
    theta: Vec<Vec<f64>>,
    r: Vec<f64>,
    gmm: Gmm,
    log_joint: Vec<Vec<f64>>,
    log_density: Vec<f64>,
    responsibilities: Vec<Vec<f64>>,
    weighted_loglik: f64,
}

#[test]
fn densities_match_the_reference_vectors_on_far_points() {
    let case: Densities = read("responsibilities.json");
    let (mixture, trials) = (case.gmm.mixture(), trials(&case.theta, &case.r));
    for (m, trial) in trials.iter().enumerate() {
        close(mixture.log_density(&trial.theta), case.log_density[m], 1e-12);
        let responsibilities = mixture.responsibilities(&trial.theta);
        for (i, log_joint) in mixture.log_joint(&trial.theta).into_iter().enumerate() {
            close(log_joint, case.log_joint[i][m], 1e-12);
            // Relative, down to where the difference of two large logarithms is not exact.
            let expected = case.responsibilities[i][m];
            assert!((responsibilities[i] - expected).abs() <= 1e-12 * expected.max(1e-3));
        }
    }
    close(mixture.log_likelihood(&trials).unwrap(), case.weighted_loglik, 1e-12);
}

fn two(dim: usize, priors: [f64; 2]) -> Mixture {
    let component = |(i, prior): (usize, f64)| Component {
        prior,
        gaussian: Gaussian::isotropic(DVector::from_element(dim, 2.0 * i as f64), 1.0),
    };
    Mixture { components: priors.into_iter().enumerate().map(component).collect() }
}

fn em(sigma_0: f64) -> EmStep {
    let sigma_0 = DMatrix::from_diagonal_element(2, 2, sigma_0);
    EmStep { n_elites: 3, sigma_0, about: About::OldMean }
}

fn assert_sound(mixture: &Mixture) {
    let sum: f64 = mixture.components.iter().map(|component| component.prior).sum();
    assert!((sum - 1.0).abs() < 1e-12, "the priors sum to {sum}");
    for theta in [DVector::zeros(2), DVector::from_vec(vec![1e6, -1e6])] {
        assert!(mixture.log_density(&theta).is_finite());
        assert!(mixture.responsibilities(&theta).iter().all(|h| (0.0..=1.0).contains(h)));
    }
}

#[test]
fn em_stays_sound_on_degenerate_trials() {
    let equal = vec![vec![0.3, 0.4]; 6];
    let line: Vec<Vec<f64>> = (0..6).map(|i| vec![f64::from(i), 0.0]).collect();
    let far: Vec<Vec<f64>> = (0..6).map(|i| vec![1e6 * f64::from(i), 1e6]).collect();
    for thetas in [equal, line, far] {
        for rewards in [[1.0; 6], [0.0; 6], [0.0, 1e-300, 0.0, 1e-310, 0.0, 0.0], [1e300; 6]] {
            for (floor, priors) in
                [(0.0, [0.5, 0.5]), (0.1, [1.0 - 1e-16, 1e-300]), (1.0, [0.0, 1.0])]
            {
                let trials = trials(&thetas, &rewards);
                let mut mixture = two(2, priors);
                for _ in 0..5 {
                    mixture = mixture.em_step(&trials, &em(floor));
                    assert_sound(&mixture);
                }
            }
        }
    }
}

#[test]
fn priors_sum_to_one_after_steps_on_random_trials() {
    for seed in 0..50 {
        let mut rng = stream(seed, 1);
        let thetas: Vec<Vec<f64>> =
            (0..20).map(|_| vec![standard_normal(&mut rng), standard_normal(&mut rng)]).collect();
        let rewards: Vec<f64> = (0..20).map(|_| (20.0 * standard_normal(&mut rng)).exp()).collect();
        let mut mixture = two(2, [0.3, 0.7]);
        for _ in 0..10 {
            mixture = mixture.em_step(&trials(&thetas, &rewards), &em(0.01));
            assert_sound(&mixture);
        }
    }
}

#[test]
fn without_any_reward_the_mixture_stays() {
    let mixture = two(2, [0.25, 0.75]);
    let trials = trials(&[vec![1.0, 2.0], vec![3.0, 4.0]], &[0.0, 0.0]);
    assert_eq!(mixture.em_step(&trials, &em(1.0)), mixture);
    assert_eq!(mixture.log_likelihood(&trials), None);
}

#[test]
fn draws_follow_the_priors_and_stay_in_the_box() {
    let mixture = two(1, [0.25, 0.75]);
    let z = DVector::from_element(1, 0.5);
    assert_eq!(mixture.draw(0.2, &z), (0, DVector::from_element(1, 0.5)));
    assert_eq!(mixture.draw(0.25, &z), (1, DVector::from_element(1, 2.5)));
    assert_eq!(mixture.draw(1.0, &z).0, 1);
    let bounds = Bounds::new(1, &[2.9], &[3.0]).unwrap();
    for rollout in 0..100 {
        let theta = mixture.sample(&mut stream(1, rollout), Some(&bounds));
        assert!(bounds.contains(&theta), "{theta}");
    }
}

#[test]
fn modes_come_highest_prior_first() {
    let mixture = two(1, [0.25, 0.75]);
    assert_eq!(mixture.dominant().prior, 0.75);
    assert_eq!(mixture.modes().iter().map(|mode| mode.prior).collect::<Vec<_>>(), [0.75, 0.25]);
    assert_eq!(two(1, [0.5, 0.5]).dominant().gaussian.mean()[0], 0.0, "the first of equals");
}
