//! Finds all tops of a box, each once; repeats, resumes, survives, costs the same late as early.

use super::climb::ClimbConfig;
use super::*;

fn square() -> Space {
    let bounds = Some(Bounds::new(2, &[0.0, -2.0], &[10.0, 2.0]).unwrap());
    Space { bounds, ..Space::white(DVector::from_vec(vec![5.0, 0.0])) }
}

fn drive(search: &mut Niching, n: u64, f: impl Fn(&DVector<f64>) -> f64) -> Vec<Trial> {
    let trial = |rollout| {
        let Proposal { theta, .. } = search.ask(rollout, &[]);
        let trial =
            Trial { rollout, reward: f(&theta), theta, success: false, measured: Vec::new() };
        search.tell(&trial);
        trial
    };
    (1..=n).map(trial).collect()
}

/// A round hill, a ridge and a narrow hill of one height, and a lower hill.
const TOPS: [([f64; 2], [f64; 2], f64); 4] = [
    ([1.0, 1.0], [0.5, 0.5], 1.0),
    ([6.0, -1.0], [2.0, 0.1], 1.0),
    ([9.0, 1.5], [0.05, 0.05], 1.0),
    ([4.0, 1.5], [0.5, 0.3], 0.5),
];

fn hills(theta: &DVector<f64>) -> f64 {
    let hill = |(top, width, height): &([f64; 2], [f64; 2], f64)| {
        let distance: f64 = (0..2).map(|i| ((theta[i] - top[i]) / width[i]).powi(2)).sum();
        // Wide flanks: the narrow hill is no needle.
        height / (1.0 + distance)
    };
    TOPS.iter().map(hill).fold(0.0, f64::max)
}

fn tops(search: &Niching) -> Vec<[f64; 2]> {
    search.modes().iter().map(|mode| [mode.mean[0], mode.mean[1]]).collect()
}

#[test]
fn finds_every_high_top_once_and_no_other() {
    for seed in 0..4 {
        let mut search = Niching::new(NichingConfig::default(), seed, square());
        drive(&mut search, 10_000, hills);
        let found = tops(&search);
        assert_eq!(found.len(), 3, "seed {seed}: {found:?}");
        for (top, ..) in &TOPS[..3] {
            let near = |at: &[f64; 2]| (0..2).all(|i| (at[i] - top[i]).abs() < 1e-3);
            assert!(found.iter().any(near), "seed {seed}: {top:?} is not in {found:?}");
        }
        let lower = search.optima.all.iter().any(|optimum| optimum.trial.reward < 0.6);
        assert!(lower, "seed {seed}: the lower top is known, so that it is not climbed again");
    }
}

/// With one hill in the box, tests send every start back: nearly no trial is spent on climbing.
#[test]
fn climbs_no_hill_twice() {
    let hill = |theta: &DVector<f64>| (-theta.norm_squared() / 30.0).exp();
    let mut search = Niching::new(NichingConfig::default(), 1, square());
    drive(&mut search, 3000, hill);
    assert_eq!(search.optima.all.len(), 1);
    let started = search.n_starts;
    let mut n_climbing = 0;
    for rollout in 3001..=5000 {
        n_climbing += u32::from(matches!(search.stage, Stage::Climb));
        let Proposal { theta, .. } = search.ask(rollout, &[]);
        let reward = hill(&theta);
        search.tell(&Trial { rollout, theta, reward, success: false, measured: Vec::new() });
    }
    assert_eq!(n_climbing, 0);
    assert!(search.n_starts > started + 200);
}

#[test]
fn repeats_its_bits_and_resumes_by_retelling() {
    let new = |seed| Niching::new(NichingConfig::default(), seed, square());
    let (mut a, mut b) = (new(6), new(6));
    for trial in drive(&mut a, 2000, hills) {
        b.tell(&trial);
        assert_eq!(b.ask(trial.rollout + 1, &[]), b.ask(trial.rollout + 1, &[]));
    }
    assert_eq!(a.ask(2001, &[]), b.ask(2001, &[]));
    assert_eq!(a.modes(), b.modes());
    assert_eq!(a.snapshot(2001), b.snapshot(2001));
    assert_ne!(a.ask(2001, &[]), new(7).ask(2001, &[]));
}

#[test]
fn stays_in_its_box_and_makes_one_around_the_start_where_there_is_none() {
    let space = square();
    let bounds = space.bounds.clone().unwrap();
    let mut search = Niching::new(NichingConfig::default(), 2, space);
    let edge = |theta: &DVector<f64>| 20.0 + theta.sum();
    assert!(drive(&mut search, 2000, edge).iter().all(|trial| bounds.contains(&trial.theta)));
    assert!((tops(&search)[0][0] - 10.0).abs() < 1e-4, "the best corner");

    let config = NichingConfig { half_width: 0.5, ..NichingConfig::default() };
    let mut search = Niching::new(config, 2, Space::white(DVector::from_element(3, 7.0)));
    let told = drive(&mut search, 500, |theta| theta.sum());
    assert!(told.iter().all(|trial| trial.theta.iter().all(|x| (6.5..=7.5).contains(x))));
    assert!(search.modes()[0].mean.min() > 7.4);
}

#[test]
fn survives_hostile_rewards() {
    let rewards: [fn(&DVector<f64>) -> f64; 5] = [
        |_| 0.0,
        |_| 0.7,
        |theta| 1e300 * hills(theta),
        |theta| 1e-310 * hills(theta),
        |theta| f64::from(theta[0] > 9.0),
    ];
    for reward in rewards {
        let mut search = Niching::new(NichingConfig::default(), 3, square());
        let told = drive(&mut search, 3000, reward);
        assert!(told.iter().all(|trial| trial.theta.iter().all(|x| x.is_finite())));
        let priors: f64 = search.modes().iter().map(|mode| mode.prior).sum();
        assert!((priors - 1.0).abs() < 1e-9, "{priors}");
    }
}

#[test]
fn goes_up_in_112_dimensions() {
    let hill = |theta: &DVector<f64>| (-theta.map(|x| (x - 1.0).powi(2)).mean()).exp();
    let mut search = Niching::new(NichingConfig::default(), 3, Space::white(DVector::zeros(112)));
    let told = drive(&mut search, 600, hill);
    let best = |trials: &[Trial]| trials.iter().map(|t| t.reward).fold(0.0, f64::max);
    assert!(best(&told) > 1.5 * best(&told[..50]), "{} {}", best(&told), best(&told[..50]));
}

/// Four round hills about θ₀ in four dimensions; within 0.15 of a top is a success.
fn four(theta: &DVector<f64>) -> (f64, bool) {
    let tops = [[0.5, 0.5], [0.5, -0.5], [-0.5, 0.5], [-0.5, -0.5]];
    let to = |top: &[f64; 2]| theta - DVector::from_vec(vec![top[0], top[1], 0.2, -0.2]);
    let distance = tops.iter().map(|top| to(top).norm()).fold(f64::INFINITY, f64::min);
    ((-4.0 * distance * distance).exp(), distance < 0.15)
}

fn dear() -> NichingConfig {
    let climb =
        ClimbConfig { surrogate: true, until_success: true, patience: 15, ..default_climb() };
    let (start_std, n_candidates, n_between_tests) = (0.2, 1, 12);
    NichingConfig { start_std, n_candidates, n_between_tests, climb, ..NichingConfig::default() }
}

fn default_climb() -> ClimbConfig {
    NichingConfig::default().climb
}

fn drive_four(search: &mut Niching, n: u64) -> Vec<Trial> {
    let trial = |rollout| {
        let theta = search.ask(rollout, &[]).theta;
        let (reward, success) = four(&theta);
        let trial = Trial { rollout, theta, reward, success, measured: Vec::new() };
        search.tell(&trial);
        trial
    };
    (1..=n).map(trial).collect()
}

#[test]
fn a_surrogate_finds_the_hills_about_the_start_with_few_trials() {
    let bounds = Some(Bounds::around(&DVector::zeros(4), 1.0));
    for seed in 0..4 {
        let space = Space { bounds: bounds.clone(), ..Space::white(DVector::zeros(4)) };
        let (mut search, mut again) =
            (Niching::new(dear(), seed, space.clone()), Niching::new(dear(), seed, space.clone()));
        let told = drive_four(&mut search, 250);
        assert_eq!(told[0].theta, space.theta_0, "the first start is θ₀");
        let tops: Vec<DVector<f64>> = search.modes().into_iter().map(|mode| mode.mean).collect();
        assert_eq!(tops.len(), 4, "seed {seed}: {tops:?}");
        assert!(tops.iter().all(|top| four(top).1), "seed {seed}: {tops:?}");
        told.iter().for_each(|trial| again.tell(trial));
        assert_eq!((again.ask(251, &[]), again.modes()), (search.ask(251, &[]), search.modes()));
    }
}

#[test]
fn a_climb_ends_at_its_first_success_or_when_it_gets_no_better() {
    let trial = |reward: f64, success| Trial {
        rollout: 1,
        theta: DVector::from_element(2, reward),
        reward,
        success,
        measured: Vec::new(),
    };
    let config = ClimbConfig { patience: 3, until_success: true, ..default_climb() };
    let mut climb = Climb::new(config, trial(0.1, false), 0.1);
    for reward in [0.2, 0.1, 0.1] {
        climb.tell(trial(reward, false));
        assert!(!climb.is_over());
    }
    climb.tell(trial(0.1, false));
    assert!(climb.is_over() && !climb.has_succeeded());
    let mut climb = Climb::new(config, trial(0.1, false), 0.1);
    climb.tell(trial(0.2, true));
    assert!(climb.is_over() && climb.has_succeeded());
}
