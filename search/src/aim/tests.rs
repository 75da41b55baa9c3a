//! The search on throws in closed form.

use nalgebra::{DMatrix, DVector};

use super::*;
use crate::{Direction, Method, Prediction, SearchConfig, build};

type World = fn(&DVector<f64>) -> Vec<Option<f64>>;

/// Two measures of five parameters, neither of them linear: the first is there always, the second where the
/// first is above 0.
fn world(theta: &DVector<f64>) -> Vec<Option<f64>> {
    let a = 0.2 + 0.5 * theta[0] - 0.3 * theta[1] + 0.1 * theta[2] * theta[2];
    let b = -1.0 + theta[1] + 0.5 * theta[3] + 0.3 * (theta[0] + theta[4]).sin();
    vec![Some(a), (a > 0.0).then_some(b)]
}

fn targets() -> Vec<Target> {
    vec![Target::new("a", [0.7, 1.3], 0.3), Target::new("b", [0.2, 0.8], 0.5)]
}

fn succeeds(measured: &[Option<f64>]) -> bool {
    let is_within = |(value, target): (&Option<f64>, &Target)| {
        value.is_some_and(|value| (target.min..=target.max).contains(&value))
    };
    measured.iter().zip(&targets()).all(is_within)
}

fn config() -> SearchConfig {
    let aim = AimConfig { targets: targets(), ..AimConfig::default() };
    SearchConfig { method: Method::Aim, aim, ..SearchConfig::default() }
}

fn space() -> Space {
    Space::white(DVector::zeros(5))
}

fn trial(rollout: u64, theta: DVector<f64>) -> Trial {
    let measured = world(&theta);
    let success = succeeds(&measured);
    Trial { rollout, theta, reward: f64::from(u8::from(success)), success, measured }
}

fn run(config: &SearchConfig, seed: u64, space: Space, n: u64) -> (Box<dyn Search>, Vec<Trial>) {
    let mut search = build(config, seed, space);
    let one = |rollout| {
        let trial = trial(rollout, search.ask(rollout, &[]).theta);
        search.tell(&trial);
        trial
    };
    let trials = (1..=n).map(one).collect();
    (search, trials)
}

fn first(trials: &[Trial]) -> u64 {
    trials.iter().find(|trial| trial.success).map_or(u64::MAX, |trial| trial.rollout)
}

/// Measured: 4 to 10.
#[test]
fn hits_the_windows_from_measures_alone() {
    for seed in 0..10 {
        let (_, trials) = run(&config(), seed, space(), 15);
        assert!(first(&trials) <= 12, "seed {seed}: {}", first(&trials));
        let late = trials.iter().rev().take(3).filter(|trial| trial.success).count();
        assert!(late >= 2, "seed {seed} does not stay");
    }
}

#[test]
fn a_true_prediction_needs_no_trial_and_is_used_only_when_asked_for() {
    let predicted = Space { prediction: Some(Prediction::new(world)), ..space() };
    for seed in 0..5 {
        assert_eq!(first(&run(&config(), seed, predicted.clone(), 2).1), 2);
        let mut blind = config();
        blind.aim.predict = false;
        let (a, b) =
            (run(&blind, seed, predicted.clone(), 9).1, run(&config(), seed, space(), 9).1);
        assert_eq!(a, b);
    }
}

#[test]
fn a_prediction_along_directions_is_that_of_the_policy() {
    let l = DMatrix::from_fn(12, 5, |i, j| if i == j || i == j + 5 { 0.5 } else { 0.0 });
    let outer = |theta: &DVector<f64>| world(&DVector::from_fn(5, |i, _| theta[i] + theta[i + 5]));
    let along = Space::along(DVector::zeros(12), l).unwrap();
    let space = Space { prediction: Some(Prediction::new(outer)), ..along };
    let mut search = build(&config(), 3, space);
    let theta = search.ask(1, &[]).theta;
    search.tell(&Trial { measured: outer(&theta), ..trial(1, theta) });
    assert!(succeeds(&outer(&search.ask(2, &[]).theta)));
}

/// Ten times too large, and something else altogether: both are found out, and the search succeeds.
#[test]
fn a_prediction_that_is_far_off_loses_its_say() {
    let wrong: [World; 2] = [
        |theta| world(theta).into_iter().map(|value| value.map(|value| 10.0 * value)).collect(),
        |theta| vec![Some(5.0 * theta[4]), Some(-3.0 * theta[2])],
    ];
    for of in wrong {
        let space = Space { prediction: Some(Prediction::new(of)), ..space() };
        let (search, trials) = run(&config(), 1, space, 25);
        assert!(!search.doubted().is_empty());
        assert!(first(&trials) <= 20, "{}", first(&trials));
    }
    let offset = |theta: &DVector<f64>| {
        world(theta).into_iter().map(|value| value.map(|value| value + 0.1)).collect()
    };
    let space = Space { prediction: Some(Prediction::new(offset)), ..space() };
    let (search, trials) = run(&config(), 1, space, 15);
    assert_eq!(search.doubted(), [] as [usize; 0], "what is off a little is corrected");
    assert!(first(&trials) <= 6, "{}", first(&trials));
}

#[test]
fn the_trials_alone_decide_what_is_proposed() {
    let predicted = Space { prediction: Some(Prediction::new(world)), ..space() };
    for space in [space(), predicted] {
        let (search, trials) = run(&config(), 7, space.clone(), 12);
        let mut again = build(&config(), 7, space.clone());
        for trial in &trials {
            assert_eq!(again.ask(trial.rollout, &[]).theta, trial.theta);
            assert_eq!(again.ask(trial.rollout, &[]).theta, trial.theta);
            again.tell(trial);
        }
        assert_eq!(again.ask(13, &[]), search.ask(13, &[]));
        assert_ne!(
            build(&config(), 8, space.clone()).ask(2, &[]),
            build(&config(), 7, space).ask(2, &[])
        );
    }
}

#[test]
fn rollouts_beside_pending_ones_differ() {
    let (search, _) = run(&config(), 2, space(), 3);
    let mut pending: Vec<Proposal> = Vec::new();
    for rollout in 4..12 {
        let next = search.ask(rollout, &pending);
        assert!(pending.iter().all(|other| other.theta != next.theta));
        pending.push(next);
    }
    let untold = build(&config(), 2, space());
    assert_ne!(untold.ask(2, &[]), Proposal { rollout: 2, ..untold.ask(3, &[]) });
}

#[test]
fn what_was_not_measured_or_is_no_number_teaches_nothing() {
    let mut search = build(&config(), 4, space());
    for (rollout, value) in (1..).zip([None, Some(f64::NAN), Some(f64::INFINITY), None]) {
        let theta = search.ask(rollout, &[]).theta;
        let measured = if rollout == 4 { Vec::new() } else { vec![value, None] };
        search.tell(&Trial { rollout, theta, reward: 0.0, success: false, measured });
        assert!(search.ask(rollout + 1, &[]).theta.iter().all(|x| x.is_finite()));
    }
    assert!(search.snapshot(5).std.iter().all(|std| *std > 0.0));
}

#[test]
fn late_directions_stay_closed_and_growing_ones_go_forwards() {
    let (grows, late) =
        (Direction { grows: true, late: false }, Direction { grows: false, late: true });
    let directions = vec![grows, Direction::default(), late];
    let space = Space { directions, ..Space::white(DVector::zeros(3)) };
    let aim =
        AimConfig { targets: vec![Target::new("a", [1.0, 2.0], 1.0)], ..AimConfig::default() };
    let mut search = Aim::new(aim, PowerConfig::default(), 1, space);
    search.tell(&Trial { measured: vec![Some(0.0)], ..trial_of_zero(3) });
    assert!(search.candidates.iter().all(|candidate| candidate.e[2] == 0.0));
    let backwards = search.candidates.iter().filter(|candidate| candidate.e[0] < -0.8).count();
    assert!(backwards < 3, "only neighbours of others: {backwards}");
}

fn trial_of_zero(dim: usize) -> Trial {
    let theta = DVector::zeros(dim);
    Trial { rollout: 1, theta, reward: 0.0, success: false, measured: Vec::new() }
}

#[test]
fn power_takes_over_with_a_small_floor_after_enough_successes() {
    let mut then = config();
    then.aim.then = Then::Power;
    let run = |config: &SearchConfig| {
        let predicted = Space { prediction: Some(Prediction::new(world)), ..space() };
        run(config, 5, predicted, 12)
    };
    let ((search, trials), (_, without)) = (run(&then), run(&config()));
    let n = trials.iter().scan(0, |n, trial| {
        *n += u64::from(trial.success);
        Some(*n)
    });
    let over = n.take_while(|n| *n < then.aim.successes).count() + 1;
    assert_eq!(trials[..over], without[..over]);
    assert_ne!(trials[over], without[over]);
    let snapshot = search.snapshot(13);
    assert!(snapshot.floor <= 0.25 && snapshot.floor > 0.0, "{}", snapshot.floor);
    let successes: Vec<_> = trials.iter().filter(|trial| trial.success).collect();
    assert!(successes.iter().any(|trial| (&trial.theta - search.mean()).norm() < 1.0));
}

/// Measured: every part of the first window in 37 to 54 trials.
#[test]
fn every_part_of_a_window_is_succeeded_in() {
    let mut covering = config();
    covering.aim.then = Then::Cover;
    covering.aim.targets[0].parts = 6;
    for seed in 0..5 {
        let (search, trials) = run(&covering, seed, space(), 90);
        let mut hit = [0; 6];
        for trial in trials.iter().filter(|trial| trial.success) {
            hit[((trial.measured[0].unwrap() - 0.7) / 0.1).min(5.0) as usize] += 1;
        }
        assert!(hit.iter().all(|n| *n >= 3), "seed {seed}: {hit:?}");
        assert!(succeeds(&world(search.mean())), "the answer is one of them");
        let again = run(&covering, seed, space(), 90).1;
        assert_eq!(again, trials);
    }
}

/// What is wished for changes: of a history told anew only the low ones succeed any more.
#[test]
fn a_part_in_which_nothing_succeeds_any_more_is_given_up() {
    let mut covering = config();
    covering.aim.then = Then::Cover;
    covering.aim.targets[0].parts = 6;
    let (_, trials) = run(&covering, 3, space(), 90);
    let is_low = |trial: &Trial| trial.measured[0].is_some_and(|a| a < 1.0);
    let mut search = build(&covering, 3, space());
    for trial in trials {
        let success = trial.success && is_low(&trial);
        search.tell(&Trial { success, ..trial });
    }
    let mut n_low = 0;
    for rollout in 91..=110 {
        let trial = trial(rollout, search.ask(rollout, &[]).theta);
        let success = trial.success && is_low(&trial);
        n_low += u64::from(success);
        search.tell(&Trial { success, ..trial });
    }
    assert!(n_low >= 14, "{n_low} of 20");
}

#[test]
fn bad_settings_are_refused_with_what_to_do() {
    let with = |change: &dyn Fn(&mut AimConfig)| {
        let mut config = config();
        change(&mut config.aim);
        config.validate().unwrap_err().to_string()
    };
    let error = with(&|aim| aim.targets[1].min = 0.9);
    assert!(error.contains("learner.search.aim.targets[1].min is 0.9"), "{error}");
    assert!(error.contains("for b a min below max = 0.8"), "{error}");
    assert!(with(&|aim| aim.targets[0].max = f64::NAN).contains("finite numbers"));
    assert!(with(&|aim| aim.targets[0].scale = 0.0).contains("targets[0].scale is 0"));
    assert!(with(&|aim| aim.targets[0].parts = 0).contains("targets[0].parts is 0"));
    let many = with(&|aim| aim.targets.iter_mut().for_each(|target| target.parts = 20));
    assert!(many.contains("400 combinations of parts"), "{many}");
    assert!(with(&|aim| aim.candidates = 0).contains("learner.search.aim.candidates is 0"));
    assert!(with(&|aim| aim.targets.clear()).contains("aim.targets is empty: use one target"));
    let mut unused = config();
    (unused.method, unused.aim.targets) = (Method::Power, Vec::new());
    assert_eq!(unused.validate(), Ok(()));
}
