//! Eqs. (1) and (6) against reference vectors, and the properties of the search.

use serde::Deserialize;

use super::super::normals::{standard_normal, stream};
use super::super::vectors::{matrix, read, trials};
use super::*;

#[derive(Deserialize)]
struct Case {
    #[serde(rename = "D")]
    dim: usize,
    /// Elites; 0 for all.
    #[serde(rename = "M")]
    n_elites: usize,
    theta_old: Vec<f64>,
    theta: Vec<Vec<f64>>,
    r: Vec<f64>,
    sigma0: Vec<Vec<f64>>,
    theta_new: Vec<f64>,
    sigma_new: Vec<Vec<f64>>,
}

/// The search as the paper states it: a constant floor.
fn plain() -> PowerConfig {
    PowerConfig {
        n_elites: 6,
        n_initial: 10,
        initial_std: 0.5,
        floor_std: 0.2,
        floor_decay: 1.0,
        floor_min: 0.05,
        elites: Elites::All,
        min_successes: 1,
        weights: Weights::Reward,
        scatter: Scatter::Old,
        memory: 0,
        noise: 0.0,
        mean_every: 0,
        candidates: 1,
        success_rate: 0.0,
        fewer_elites: false,
        late_std: 0.5,
        late_decay: 1.0,
        late_min: 0.1,
    }
}

/// The `n` best trials.
fn elites(mut trials: Vec<Trial>, n: usize) -> Vec<Trial> {
    trials.sort_by(by_reward);
    trials.truncate(n);
    trials
}

#[test]
fn matches_the_reference_vectors() {
    let cases: Vec<Case> = read("power_cov.json");
    assert!(!cases.is_empty());
    for case in cases {
        let n = if case.n_elites == 0 { case.r.len() } else { case.n_elites };
        let elites = elites(trials(&case.theta, &case.r), n);
        let theta_old = DVector::from_vec(case.theta_old);
        let weights = weights(Weights::Reward, &elites, 0.0).unwrap();
        let mean = power_mean(&theta_old, &elites, &weights);
        let expected = DVector::from_vec(case.theta_new);
        assert!((mean - &expected).amax() <= 1e-12 * expected.amax(), "mean, D = {}", case.dim);
        let sigma_0 = matrix(&case.sigma0);
        let covariance = power_covariance(&theta_old, &elites, &weights, &sigma_0);
        let expected = matrix(&case.sigma_new);
        assert!((covariance - &expected).amax() <= 1e-12 * expected.amax(), "D = {}", case.dim);
    }
}

/// r = exp(−‖θ − 1‖²/D), a smooth hill.
fn hill(theta: &DVector<f64>) -> f64 {
    (-theta.map(|x| (x - 1.0).powi(2)).mean()).exp()
}

fn run(config: PowerConfig, seed: u64, n: u64, reward: impl Fn(&DVector<f64>) -> f64) -> Power {
    let mut search = Power::new(config, seed, Space::white(DVector::zeros(12)));
    for rollout in 1..=n {
        let Proposal { theta, .. } = search.ask(rollout, &[]);
        let reward = reward(&theta);
        search.tell(&Trial { rollout, theta, reward, success: false, measured: Vec::new() });
    }
    search
}

#[test]
fn sampler_has_the_covariance_of_eq_6() {
    // The sampler is θ − mean = F z with F = [f₁ … f_M, σ₀I]: its covariance is F Fᵀ.
    let config = plain();
    let mut search = run(config, 5, 29, hill);
    let old_mean = search.mean().clone();
    let Proposal { theta, .. } = search.ask(30, &[]);
    let reward = hill(&theta);
    search.tell(&Trial { rollout: 30, theta, reward, success: false, measured: Vec::new() });

    let factors = search.factors.as_ref().unwrap();
    let mut f = DMatrix::zeros(12, factors.len() + 12);
    for (column, factor) in factors.iter().enumerate() {
        f.set_column(column, factor);
    }
    f.view_mut((0, factors.len()), (12, 12)).fill_diagonal(search.floor());
    let sigma_0 = DMatrix::identity(12, 12) * config.floor_std.powi(2);
    let weights = weights(Weights::Reward, &search.kept, 0.0).unwrap();
    let dense = power_covariance(&old_mean, &search.kept, &weights, &sigma_0);
    assert!((&f * f.transpose() - &dense).amax() <= 1e-14 * dense.amax());
    let std = search.snapshot(31).std;
    assert!((std.component_mul(&std) - dense.diagonal()).amax() < 1e-14);

    // And the proposal is that product with the numbers of stream 31, in this order.
    let mut rng = stream(5, 31);
    let z = DVector::from_fn(factors.len() + 12, |_, _| standard_normal(&mut rng));
    assert!((search.mean() + f * z - search.ask(31, &[]).theta).amax() < 1e-14);
}

#[test]
fn explores_around_the_start_until_the_initial_batch_is_told() {
    let config = PowerConfig { n_initial: 4, ..plain() };
    let search = run(config, 1, 4, hill);
    assert_eq!(search.mean(), &DVector::zeros(12));
    assert_eq!(search.snapshot(5).std, DVector::from_element(12, 0.5));
    let search = run(config, 1, 5, hill);
    assert_ne!(search.mean(), &DVector::zeros(12));
    assert_eq!(search.floor(), 0.2);
}

#[test]
fn scaling_all_rewards_changes_nothing() {
    let reference = run(plain(), 2, 40, hill);
    // A power of two scales without rounding, so every bit must agree.
    let scaled = run(plain(), 2, 40, |theta| 1024.0 * hill(theta));
    assert_eq!(reference.ask(41, &[]), scaled.ask(41, &[]));
    let scaled = run(plain(), 2, 40, |theta| 0.3 * hill(theta));
    assert!((reference.ask(41, &[]).theta - scaled.ask(41, &[]).theta).amax() < 1e-9);
}

#[test]
fn the_order_of_trials_does_not_matter() {
    let thetas: Vec<Vec<f64>> = (0..9).map(|i| vec![f64::from(i), f64::from(i * i % 7)]).collect();
    let rewards = [0.5, 0.1, 0.9, 0.5, 0.0, 0.7, 0.5, 0.2, 0.3];
    let told = trials(&thetas, &rewards);
    let update = |order: Vec<Trial>| {
        let mut search = Power::new(
            PowerConfig { n_elites: 4, n_initial: 8, ..plain() },
            1,
            Space::white(DVector::zeros(2)),
        );
        order.iter().for_each(|trial| search.tell(trial));
        search.snapshot(10)
    };
    let reversed = told.iter().rev().cloned().collect();
    let mut rotated = told.clone();
    rotated.rotate_left(4);
    let reference = update(told);
    assert_eq!(update(reversed), reference);
    assert_eq!(update(rotated), reference);
}

#[test]
fn ties_are_kept_by_rollout() {
    let thetas: Vec<Vec<f64>> = (0..5).map(|i| vec![f64::from(i)]).collect();
    let kept = elites(trials(&thetas, &[0.5; 5]), 3);
    assert_eq!(kept.iter().map(|trial| trial.rollout).collect::<Vec<_>>(), [1, 2, 3]);
}

#[test]
fn keeps_floor_when_rewards_are_equal() {
    let search = run(plain(), 3, 100, |_| 0.7);
    assert!(search.snapshot(101).std.min() >= 0.2);
    assert!(search.mean().iter().all(|x| x.is_finite()));
}

#[test]
fn without_any_reward_mean_and_covariance_stay() {
    let search = run(plain(), 3, 30, |_| 0.0);
    assert_eq!(search.mean(), &DVector::zeros(12));
    assert_eq!(search.snapshot(31).std, DVector::from_element(12, 0.5));
    assert_eq!(weights(Weights::Reward, &search.kept, 0.0), None);
    assert_eq!(weights(Weights::Rank, &search.kept, 0.0), None);
}

#[test]
fn tiny_and_huge_rewards_stay_finite() {
    for scale in [1e-300, 1e300] {
        let search = run(plain(), 4, 30, |theta| scale * hill(theta));
        assert!(search.ask(31, &[]).theta.iter().all(|x| x.is_finite()));
    }
}

#[test]
fn floor_decays_to_its_minimum() {
    let config = PowerConfig { floor_decay: 0.9, floor_min: 0.05, ..plain() };
    let floor = |n| run(config, 1, n, hill).floor();
    assert_eq!(floor(11), 0.2);
    assert!((floor(13) - 0.2 * 0.81).abs() < 1e-15);
    assert_eq!(floor(100), 0.05);
}

#[test]
fn same_seed_same_bits_and_asking_twice_changes_nothing() {
    let (a, b) = (run(plain(), 6, 50, hill), run(plain(), 6, 50, hill));
    assert_eq!(a.ask(51, &[]), b.ask(51, &[]));
    assert_eq!(a.ask(51, &[]), a.ask(51, &[]));
    let other = run(plain(), 7, 50, hill);
    assert_ne!(a.ask(51, &[]), other.ask(51, &[]));
}

#[test]
fn climbs_the_hill() {
    let search = run(plain(), 8, 200, hill);
    assert!(hill(search.mean()) > 0.9, "r(mean) = {}", hill(search.mean()));
}

/// θ = `theta` in one dimension.
fn tell(search: &mut Power, rollout: u64, theta: f64, reward: f64, success: bool) {
    search.tell(&Trial {
        rollout,
        theta: DVector::from_element(1, theta),
        reward,
        success,
        measured: Vec::new(),
    });
}

fn two_phases() -> PowerConfig {
    PowerConfig {
        n_elites: 2,
        min_successes: 2,
        n_initial: 2,
        floor_decay: 0.9,
        ..PowerConfig::default()
    }
}

#[test]
fn successes_take_over_from_better_rewarded_failures() {
    let mut search = Power::new(two_phases(), 1, Space::white(DVector::zeros(1)));
    tell(&mut search, 1, 0.0, 0.1, false);
    tell(&mut search, 2, 4.0, 3.0, false);
    tell(&mut search, 3, 2.0, 2.0, false);
    // ln(2.5) : ln(2.5) − ln 2, about the old mean.
    let w = 2.5_f64.ln() / (2.0 * 2.5_f64.ln() - 2_f64.ln());
    let mean = w * 4.0 + (1.0 - w) * 2.0;
    assert!((search.mean()[0] - mean).abs() < 1e-12);
    let variance = w * 16.0 + (1.0 - w) * 4.0 + 0.25;
    assert!((search.snapshot(4).std[0] - variance.sqrt()).abs() < 1e-12);

    tell(&mut search, 4, -1.0, 0.5, true);
    assert!(search.mean()[0] > 2.0, "one success may be luck");
    assert_eq!(search.floor(), 0.5, "the floor waits as well");
    tell(&mut search, 5, -3.0, 0.4, true);
    let mean = -w - 3.0 * (1.0 - w);
    assert!((search.mean()[0] - mean).abs() < 1e-12, "the best two successes");
    let floor: f64 = 0.5 * 0.9;
    let biased = w * (-1.0 - mean).powi(2) + (1.0 - w) * (-3.0 - mean).powi(2);
    let spread = biased / (1.0 - w * w - (1.0 - w).powi(2));
    assert!((search.snapshot(6).std[0] - (spread + floor * floor).sqrt()).abs() < 1e-12);

    tell(&mut search, 6, -9.0, 0.3, true);
    assert!((search.mean()[0] - mean).abs() < 1e-12, "a third one, not as good");
    tell(&mut search, 7, 9.0, 9.0, false);
    assert!((search.mean()[0] - mean).abs() < 1e-12, "a failure");
    assert!((search.floor() - 0.5 * 0.81).abs() < 1e-12, "the floor falls with successes only");
}

#[test]
fn a_lucky_trial_leaves_the_memory() {
    let remember = |memory| {
        let config = PowerConfig {
            memory,
            n_elites: 1,
            min_successes: 1,
            n_initial: 0,
            ..PowerConfig::default()
        };
        let mut search = Power::new(config, 1, Space::white(DVector::zeros(1)));
        tell(&mut search, 1, 7.0, 9.0, true);
        for rollout in 2..=4 {
            tell(&mut search, rollout, rollout as f64, 1.0, true);
        }
        search.mean()[0]
    };
    for (memory, best) in [(0, 7.0), (4, 7.0), (3, 2.0)] {
        assert!((remember(memory) - best).abs() < 1e-12, "memory {memory}");
    }
}

/// The property 1/(1 − Σw²) is for: over many batches of weighted draws the scatter about their own
/// mean is, in the mean, the covariance they were drawn from.
#[test]
fn the_scatter_of_weighted_elites_is_unbiased() {
    for n_elites in [2, 4, 10] {
        let config = PowerConfig {
            n_elites,
            min_successes: 1,
            n_initial: n_elites as u64 - 1,
            floor_decay: 1.0,
            ..PowerConfig::default()
        };
        let n_batches = 20_000;
        let mut sum = DVector::zeros(2);
        for batch in 1..=n_batches {
            let mut rng = stream(9, batch);
            let mut search = Power::new(config, 1, Space::white(DVector::zeros(2)));
            for rollout in 1..=n_elites as u64 {
                let z = [standard_normal(&mut rng), standard_normal(&mut rng)];
                let theta = DVector::from_vec(vec![5.0 + 2.0 * z[0], z[0] - 0.5 * z[1]]);
                // The order of the rewards, and with it the weights, has nothing to do with θ.
                let reward = rollout as f64;
                search.tell(&Trial { rollout, theta, reward, success: true, measured: Vec::new() });
            }
            let SearchSnapshot { std, floor, .. } = search.snapshot(0);
            sum += std.map(|std| std * std - floor * floor);
        }
        let mean = sum / n_batches as f64;
        for (found, expected) in mean.iter().zip([4.0, 1.25]) {
            let error = (found / expected - 1.0_f64).abs();
            assert!(error < 0.03, "{n_elites} elites: {found} instead of {expected}");
        }
    }
    assert!((unbiased(&[0.25; 4]) - 4.0 / 3.0).abs() < 1e-15, "m/(m − 1) of equal weights");
    assert_eq!(unbiased(&[1.0]), 1.0);
}
