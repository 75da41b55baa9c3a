//! The tempered search: invariances, degenerate rewards, several optima, bounds on its memory.

use super::super::Bounds;
use super::*;

/// Two hills of unit width; the second one is a little lower.
fn two_hills(theta: &DVector<f64>) -> f64 {
    let hill = |centre: f64| (-0.5 * theta.add_scalar(-centre).norm_squared()).exp();
    hill(3.0) + 0.95 * hill(7.0)
}

fn space() -> Space {
    Space::white(DVector::from_vec(vec![8.0, 2.0]))
}

fn run_on(
    space: Space,
    config: TemperedConfig,
    seed: u64,
    n: u64,
    reward: impl Fn(u64, &DVector<f64>) -> f64,
) -> (Tempered, Vec<Trial>) {
    let mut search = Tempered::new(config, seed, space);
    let mut told = Vec::new();
    for rollout in 1..=n {
        let Proposal { theta, .. } = search.ask(rollout, &[]);
        let reward = reward(rollout, &theta);
        told.push(Trial { rollout, theta, reward, success: false, measured: Vec::new() });
        search.tell(&told[told.len() - 1]);
    }
    (search, told)
}

fn run(seed: u64, n: u64, reward: impl Fn(&DVector<f64>) -> f64) -> (Tempered, Vec<Trial>) {
    run_on(space(), TemperedConfig::default(), seed, n, |_, theta| reward(theta))
}

fn assert_sound(search: &Tempered) {
    let sum: f64 = search.modes().iter().map(|mode| mode.prior).sum();
    assert!((sum - 1.0).abs() < 1e-12, "the priors sum to {sum}");
    let theta = search.ask(1_000_000, &[]).theta;
    assert!(theta.iter().all(|x| x.is_finite()), "{theta}");
}

#[test]
fn scaling_all_rewards_changes_no_proposal() {
    let (_, reference) = run(2, 120, two_hills);
    for scale in [1024.0, 1e-7, 1e200, 1e-200] {
        let (_, scaled) = run(2, 120, |theta| scale * two_hills(theta));
        for (a, b) in reference.iter().zip(&scaled) {
            let error = (&a.theta - &b.theta).amax();
            assert!(error < 1e-9, "trial {} moved by {error:e} at {scale:e}", a.rollout);
        }
    }
}

#[test]
fn telling_stored_trials_again_resumes_the_session() {
    let (search, told) = run(6, 80, two_hills);
    let mut resumed = Tempered::new(TemperedConfig::default(), 6, space());
    told.iter().for_each(|trial| resumed.tell(trial));
    assert_eq!(resumed.ask(81, &[]), search.ask(81, &[]));
    assert_eq!(search.ask(81, &[]), search.ask(81, &[]));
    assert_eq!(resumed.modes(), search.modes());
    assert_ne!(run(7, 80, two_hills).0.ask(81, &[]), search.ask(81, &[]));
}

#[test]
fn finds_both_of_two_optima_and_how_many_they_are() {
    for seed in 0..5 {
        let (search, _) = run(seed, 200, two_hills);
        let modes = search.modes();
        assert_eq!(modes.len(), 2, "seed {seed}");
        for centre in [3.0, 7.0] {
            let near = |mode: &Mode| mode.mean.add_scalar(-centre).norm() < 0.3;
            assert!(modes.iter().any(near), "seed {seed}: nothing at {centre}");
        }
        assert!(modes[0].prior >= modes[1].prior);
    }
}

#[test]
fn one_optimum_stays_one_component() {
    for seed in 0..5 {
        let hill = |theta: &DVector<f64>| (-0.5 * theta.add_scalar(-5.0).norm_squared()).exp();
        let (search, _) = run(seed, 200, hill);
        assert_eq!(search.modes().len(), 1, "seed {seed}");
        assert!(search.mean().add_scalar(-5.0).norm() < 0.3, "seed {seed}: {}", search.mean());
    }
}

#[test]
fn stays_sound_on_degenerate_rewards() {
    let nothing = |_: &DVector<f64>| 0.0;
    let (search, _) = run(1, 40, nothing);
    assert_eq!(search.mean(), &space().theta_0);
    assert_sound(&search);
    assert_sound(&run(1, 60, |_| 1e-310).0);
    assert_sound(&run(1, 60, |_| f64::MAX).0);
    // A single rewarded trial, rewards over six hundred decades.
    assert_sound(&run_on(space(), TemperedConfig::default(), 1, 60, |n, _| f64::from(n == 20)).0);
    assert_sound(&run(1, 60, |theta| 10_f64.powf(100.0 * theta[0].clamp(-3.0, 3.0))).0);
}

#[test]
fn stays_sound_on_equal_and_far_trials() {
    let config = TemperedConfig { floor_std: 0.0, pseudo_count: 0.0, ..TemperedConfig::default() };
    for place in [0.0, 1e6] {
        let mut search = Tempered::new(config, 1, space());
        for rollout in 1..=30 {
            let theta = DVector::from_element(2, place);
            search.tell(&Trial {
                rollout,
                theta,
                reward: 1.0,
                success: false,
                measured: Vec::new(),
            });
        }
        assert_sound(&search);
    }
}

#[test]
fn keeps_within_the_box() {
    let bounds = Bounds::new(2, &[6.0, 0.0], &[9.0, 3.0]).unwrap();
    let boxed = Space { bounds: Some(bounds.clone()), ..space() };
    let reward = |_, theta: &DVector<f64>| two_hills(theta);
    let (_, told) = run_on(boxed, TemperedConfig::default(), 1, 100, reward);
    assert!(told.iter().all(|trial| bounds.contains(&trial.theta)));
}

#[test]
fn keeps_a_bounded_number_of_trials_and_the_best_of_them() {
    let (search, told) = run(3, 600, two_hills);
    assert_eq!(search.trials.len(), MAX_TRIALS);
    let best = told.iter().max_by(|a, b| a.reward.total_cmp(&b.reward)).unwrap();
    assert!(search.trials.iter().any(|trial| trial.number == best.rollout));
    assert_eq!(search.modes().len(), 2);
}

#[test]
fn follows_a_reward_that_moved_only_with_a_memory() {
    let distance = |memory: u64| {
        let config = TemperedConfig { memory, ..TemperedConfig::default() };
        let centre = |n: u64| if n > 200 { 7.0 } else { 4.0 };
        let hill =
            |n, theta: &DVector<f64>| (-0.5 * theta.add_scalar(-centre(n)).norm_squared()).exp();
        let (search, _) = run_on(space(), config, 5, 400, hill);
        search.mean().add_scalar(-7.0).norm()
    };
    assert!(distance(100) < 0.5, "{} away with a memory", distance(100));
    assert!(distance(0) > 1.0, "{} away without", distance(0));
}

#[test]
fn density_of_all_draws_counts_each_of_them() {
    // Each trial kept knows Σ q(θ) over one sampler a trial, before and after it.
    let config = TemperedConfig::default();
    let mut search = Tempered::new(config, 4, space());
    let mut samplers = Vec::new();
    for rollout in 1..=20 {
        samplers.push(search.sampler.clone());
        let Proposal { theta, .. } = search.ask(rollout, &[]);
        let reward = two_hills(&theta);
        search.tell(&Trial { rollout, theta, reward, success: false, measured: Vec::new() });
    }
    for trial in &search.trials {
        let theta = DMatrix::from_columns(std::slice::from_ref(&trial.theta));
        let sum: f64 = samplers.iter().map(|s| s.log_densities(&theta)[0].exp()).sum();
        assert!((trial.log_drawn - sum.ln()).abs() < 1e-9, "trial {}", trial.number);
    }
}
