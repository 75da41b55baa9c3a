//! What neighbours say of a reward, and what becomes an elite by it.

use rand::RngExt;

use super::*;
use crate::normals::stream;
use crate::power::{PowerConfig, Weights};
use crate::{Search, Space};

fn trial(rollout: u64, theta: [f64; 2], reward: f64, success: bool) -> Trial {
    let theta = DVector::from_column_slice(&theta);
    Trial { rollout, theta, reward, success, measured: Vec::new() }
}

/// Successes around (1.15, 1.2), failures around (−1.4, −1.4), and last a lucky trial among these with the highest
/// reward of all.
fn around_a_good_place() -> Vec<Trial> {
    let place = |i: u64| [1.0 + 0.1 * (i % 4) as f64, 1.0 + 0.1 * (i / 4) as f64];
    let successes = (1..=12).map(|i| trial(i, place(i), 9.0, true));
    let barren = |i: u64| [-1.5 + 0.1 * (i % 3) as f64, -1.5 + 0.1 * (i / 3) as f64];
    let failures = (0..6).map(|i| trial(13 + i, barren(i), 2.0, false));
    successes.chain(failures).chain([trial(19, [-1.4, -1.4], 10.0, true)]).collect()
}

fn told(config: PowerConfig, trials: &[Trial]) -> Power {
    let mut search = Power::new(config, 1, Space::white(DVector::zeros(2)));
    trials.iter().for_each(|trial| search.tell(trial));
    search
}

const NOISY: f64 = 0.7;

fn noisy() -> PowerConfig {
    PowerConfig { noise: NOISY, ..PowerConfig::default() }
}

/// r̄ + K(K + σ²I)⁻¹(r − r̄), with dense matrices.
#[test]
fn is_what_the_textbook_expects() {
    let trials: Vec<Trial> = (0..8)
        .map(|i| {
            let x = f64::from(i);
            trial(i as u64 + 1, [x.sin(), (2.0 * x).cos()], x * x % 5.0 - 1.0, false)
        })
        .collect();
    let (noise, length) = (0.4, 0.8);
    let k = DMatrix::from_fn(8, 8, |i, j| {
        (-(&trials[i].theta - &trials[j].theta).norm_squared() / (2.0 * length * length)).exp()
    });
    let r = DVector::from_fn(8, |i, _| trials[i].reward);
    let inverse = (&k + DMatrix::identity(8, 8) * (noise * noise)).try_inverse().unwrap();
    let dense = &k * inverse * r.add_scalar(-r.mean());
    assert!((expected(&trials, noise, length) - dense.add_scalar(r.mean())).amax() < 1e-12);
}

#[test]
fn a_lucky_trial_far_from_all_successes_is_no_elite() {
    let trials = around_a_good_place();
    let elites = |config: PowerConfig| told(config, &trials).elites().0;
    let is_elite = |config: PowerConfig| elites(config).iter().any(|trial| trial.rollout == 19);
    assert!(is_elite(PowerConfig::default()), "a reward that is exact is the highest one");
    assert!(!is_elite(noisy()));
    assert_eq!(elites(noisy()).len(), noisy().n_elites);
}

/// With the next best rewards around it the same trial is one.
#[test]
fn a_good_trial_among_good_ones_stays_an_elite() {
    let mut trials = around_a_good_place();
    trials[18] = trial(19, [1.15, 1.15], 10.0, true);
    assert!(told(noisy(), &trials).elites().0.iter().any(|trial| trial.rollout == 19));
}

#[test]
fn where_rewards_begin_and_how_large_they_are_changes_no_rank() {
    let ranks = |of: &dyn Fn(f64) -> f64| -> Vec<u64> {
        let mut rng = stream(3, 1);
        let trials: Vec<Trial> = (1..=30)
            .map(|rollout| {
                let theta = [rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0)];
                trial(rollout, theta, of(rng.random_range(0.0..1.0)), false)
            })
            .collect();
        told(noisy(), &trials).kept.iter().map(|trial| trial.rollout).collect()
    };
    let reference = ranks(&|r| r);
    assert_ne!(reference, (1..=30).collect::<Vec<_>>());
    assert_eq!(ranks(&|r| 300.0 * r), reference);
    assert_eq!(ranks(&|r| r + 50.0), reference);
}

#[test]
fn rewards_stay_rewards_however_large_they_are_and_however_little_they_say() {
    for scale in [1e-300, 1e300, 0.0] {
        for weights in [Weights::Rank, Weights::Reward] {
            let mut trials = around_a_good_place();
            trials.iter_mut().for_each(|trial| trial.reward *= scale);
            trials[0].reward = 0.0;
            let search = told(PowerConfig { weights, ..noisy() }, &trials);
            assert!(search.kept.iter().all(|trial| trial.reward >= 0.0), "{scale}");
            assert!(search.ask(20, &[]).theta.iter().all(|x| x.is_finite()), "{scale}");
            assert_eq!(*search.mean() == DVector::zeros(2), scale == 0.0, "nothing was rewarded");
        }
    }
    // Without a length, and without noise that could be told from none.
    let still = PowerConfig { initial_std: 0.0, noise: 1e-200, ..noisy() };
    let mut trials = around_a_good_place();
    trials.extend([trial(20, [1.0, 1.0], 3.0, true), trial(21, [1.0, 1.0], 4.0, true)]);
    assert!(told(still, &trials).ask(22, &[]).theta.iter().all(|x| x.is_finite()));
}

#[test]
fn what_is_forgotten_says_nothing_any_more() {
    let trials = around_a_good_place();
    let search = told(PowerConfig { memory: 7, ..noisy() }, &trials);
    let mut kept: Vec<u64> = search.kept.iter().map(|trial| trial.rollout).collect();
    kept.sort();
    assert_eq!(kept, (13..=19).collect::<Vec<_>>());
}

/// Distance from (1, 1, 1, 1) within which rollouts succeed.
const NEAR: f64 = 1.3;

/// Share of successes in the last 20 of 100 rollouts, rated with one error in `every`.
fn late(noise: f64, seed: u64, every: u32) -> f64 {
    let config = PowerConfig { noise, ..PowerConfig::default() };
    let mut search = Power::new(config, seed, Space::white(DVector::zeros(4)));
    let mut late = 0;
    for rollout in 1..=100 {
        let theta = search.ask(rollout, &[]).theta;
        let distance = theta.add_scalar(-1.0).norm();
        let mut rng = stream(seed, (1 << 40) + rollout);
        let rating = match rng.random_range(0..every) {
            0 => f64::from(rng.random_range(0..=10_u8)),
            _ if distance < NEAR => 10.0,
            _ => (5.0 - distance).max(0.0).round(),
        };
        late += u32::from(rollout > 80 && distance < NEAR);
        let (success, measured) = (rating >= 7.0, Vec::new());
        search.tell(&Trial { rollout, theta, reward: rating, success, measured });
    }
    f64::from(late) / 20.0
}

#[test]
fn one_rating_in_five_may_be_wrong() {
    let mean = |noise, every| (1..=20).map(|seed| late(noise, seed, every)).sum::<f64>() / 20.0;
    let (exact, noisy) = (mean(0.0, 5), mean(NOISY, 5));
    assert!(noisy > 0.9 && noisy > exact + 0.1, "{exact} {noisy}");
    assert!(mean(NOISY, u32::MAX) > 0.9, "and without errors nothing is lost");
}
