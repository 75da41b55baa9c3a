//! What every method must do, whatever it is: keep to its box, and say which rewards it takes.

use nalgebra::{DMatrix, DVector};

use super::power::Weights;
use super::*;

pub(super) const METHODS: [Method; 12] = [
    Method::Aim,
    Method::Power,
    Method::Random,
    Method::Cem,
    Method::Pi2,
    Method::Rwr,
    Method::Reinforce,
    Method::Enac,
    Method::Niching,
    Method::Regions,
    Method::Algorithm1,
    Method::Tempered,
];

/// Those that weight trials by their rewards, or compare shares of the best one.
const NOT_NEGATIVE: [Method; 5] =
    [Method::Rwr, Method::Niching, Method::Regions, Method::Algorithm1, Method::Tempered];

fn config(method: Method) -> SearchConfig {
    SearchConfig { method, ..SearchConfig::default() }
}

fn origin() -> Space {
    Space::white(DVector::zeros(3))
}

/// ‖θ − 1‖²/D, to be minimised.
fn cost(theta: &DVector<f64>) -> f64 {
    theta.map(|x| (x - 1.0).powi(2)).mean()
}

fn drive(search: &mut dyn Search, n: u64, reward: impl Fn(&DVector<f64>) -> f64) -> Vec<Trial> {
    let trial = |rollout| {
        let Proposal { theta, .. } = search.ask(rollout, &[]);
        let trial =
            Trial { rollout, reward: reward(&theta), theta, success: false, measured: Vec::new() };
        search.check_reward(trial.reward).unwrap();
        search.tell(&trial);
        trial
    };
    (1..=n).map(trial).collect()
}

fn thetas(trials: Vec<Trial>) -> Vec<DVector<f64>> {
    trials.into_iter().map(|trial| trial.theta).collect()
}

type Reward<'a> = &'a dyn Fn(&DVector<f64>) -> f64;

/// Draws, the mean and every answer, in a narrow box and in a wide one, with the optimum in a corner,
/// beyond the box, inside, in two corners, and nowhere.
#[test]
fn every_method_keeps_to_its_box() {
    let skewed = DMatrix::from_fn(3, 2, |i, j| [[1.0, 0.2], [0.5, -1.0], [0.3, 0.4]][i][j]);
    let narrow = [[-0.2, -0.3, -0.1], [0.5, 0.4, 0.6]];
    for (method, width) in METHODS.into_iter().flat_map(|m| [(m, 1.0), (m, 12.0)]) {
        let [min, max] = narrow.map(|corner| corner.map(|x| x * width));
        let bounds = Bounds::new(3, &min, &max).unwrap();
        let corners = [&bounds.min, &bounds.max].map(|corner| corner / width);
        let rewards: [Reward; 5] = [
            &|theta| theta.sum().exp(),
            &|theta| (-cost(theta)).exp(),
            &|theta| (-20.0 * theta.norm_squared()).exp(),
            &|theta| corners.iter().map(|c| (-8.0 * (theta - c).norm_squared()).exp()).sum(),
            &|_| 0.5,
        ];
        for (kind, reward) in rewards.into_iter().enumerate() {
            for seed in 0..3 {
                let along = Space::along(DVector::zeros(3), skewed.clone()).unwrap();
                for space in [origin(), along] {
                    let at = format!("{method:?}, width {width}, reward {kind}, seed {seed}");
                    let space = Space { bounds: Some(bounds.clone()), ..space };
                    let mut search = build(&config(method), seed, space);
                    keeps_to(&bounds, &mut *search, &at, |theta| reward(&(theta / width)));
                }
            }
        }
    }
}

fn keeps_to(
    bounds: &Bounds,
    search: &mut dyn Search,
    at: &str,
    reward: impl Fn(&DVector<f64>) -> f64,
) {
    for rollout in 1..=120 {
        let Proposal { theta, .. } = search.ask(rollout, &[]);
        assert!(bounds.contains(&theta), "{at}: trial {rollout} at {theta}");
        search.tell(&Trial {
            rollout,
            reward: reward(&theta),
            theta,
            success: false,
            measured: Vec::new(),
        });
        let mean = search.mean();
        assert!(bounds.contains(mean), "{at}: mean {mean} after {rollout}");
        for Mode { mean, .. } in search.modes() {
            assert!(bounds.contains(&mean), "{at}: answer {mean} after {rollout}");
        }
    }
}

#[test]
fn a_method_takes_negative_rewards_or_says_how_to_map_them() {
    for method in METHODS {
        let name = format!("{method:?}").to_lowercase();
        let mut desk = AskTell::new(build(&config(method), 1, origin()));
        let theta = desk.ask(1).theta;
        let told = desk.tell(&Trial {
            rollout: 1,
            reward: -0.25,
            theta,
            success: false,
            measured: Vec::new(),
        });
        if !NOT_NEGATIVE.contains(&method) {
            assert_eq!(told, Ok(()), "{name}");
            continue;
        }
        let error = told.unwrap_err().to_string();
        for part in ["trial 1: its reward is -0.25", &name, "reward_map = { exp = 1.0 }"] {
            assert!(error.contains(part), "{error}");
        }
    }
    let mut by_reward = config(Method::Power);
    by_reward.power.weights = Weights::Reward;
    let error = build(&by_reward, 1, origin()).check_reward(-1.0).unwrap_err().to_string();
    assert!(error.contains("power with weights = \"reward\""), "{error}");
}

/// exp(r / 1) of r = −cost is the reward exp(−cost), bit for bit.
#[test]
fn every_method_learns_from_costs_that_are_mapped() {
    for method in METHODS {
        let mapped = SearchConfig { reward_map: RewardMap::Exp(1.0), ..config(method) };
        let mapped = drive(&mut *build(&mapped, 3, origin()), 150, |theta| -cost(theta));
        assert!(mapped.iter().all(|trial| trial.reward < 0.0));
        let plain =
            drive(&mut *build(&config(method), 3, origin()), 150, |theta| (-cost(theta)).exp());
        assert_eq!(thetas(mapped), thetas(plain), "{method:?}");

        let shifted = SearchConfig { reward_map: RewardMap::Shift(2.0), ..config(method) };
        let shifted =
            drive(&mut *build(&shifted, 3, origin()), 150, |theta| (-cost(theta)).exp() - 2.0);
        let best = shifted.iter().map(|trial| trial.reward).fold(f64::MIN, f64::max);
        assert!(best > shifted[0].reward + 0.2, "{method:?}: {best}");
    }
}

/// Ranks and differences of rewards are what these learn from: a constant says nothing.
#[test]
fn adding_a_constant_changes_nothing_where_rewards_are_compared() {
    for method in METHODS.into_iter().filter(|method| !NOT_NEGATIVE.contains(method)) {
        let run = |constant: f64| {
            let mut search = build(&config(method), 5, origin());
            let trials = drive(&mut *search, 100, |theta| (-cost(theta)).exp() + constant);
            (thetas(trials), search.mean().clone())
        };
        let (reference, negative) = (run(0.0), run(-2.0));
        for (rollout, (a, b)) in reference.0.iter().zip(&negative.0).enumerate() {
            let error = (a - b).amax();
            assert!(error < 1e-6, "{method:?}: trial {} moved by {error:e}", rollout + 1);
        }
        assert!((reference.1 - negative.1).amax() < 1e-6, "{method:?}");
    }
}

#[test]
fn rewards_at_both_ends_of_the_number_range_are_survived() {
    let rewards: [fn(&DVector<f64>) -> f64; 4] = [
        |theta| -1e300 * (1.0 + cost(theta)),
        |theta| -1e-310 * (1.0 + cost(theta)),
        |theta| if theta[0] > 0.1 { f64::MAX } else { f64::MIN },
        |theta| if theta[0] > 0.1 { 0.0 } else { -1.0 },
    ];
    for method in METHODS.into_iter().filter(|method| !NOT_NEGATIVE.contains(method)) {
        for (kind, reward) in rewards.into_iter().enumerate() {
            let mut search = build(&config(method), 2, origin());
            drive(&mut *search, 200, reward);
            let at = format!("{method:?}, reward {kind}");
            assert!(search.ask(201, &[]).theta.iter().all(|x| x.is_finite()), "{at}");
            assert!(search.snapshot(201).std.iter().all(|s| *s > 0.0), "{at}");
        }
    }
}

#[test]
fn several_searches_share_their_priors_whatever_the_sign_of_the_rewards() {
    for constant in [0.0, -3.0] {
        let starts = [1.0, -1.0].map(|x| Space::white(DVector::repeat(3, x)));
        let mut search = build_all(&config(Method::Power), 1, starts.to_vec());
        drive(&mut *search, 80, |theta| (-cost(theta)).exp() + constant);
        let priors: Vec<f64> = search.modes().iter().map(|mode| mode.prior).collect();
        assert!(priors.iter().all(|prior| *prior >= 0.0), "{priors:?}");
        assert!((priors.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{priors:?}");
    }
}

#[test]
fn a_map_that_does_not_fit_the_rewards_is_refused_with_what_to_set() {
    let search =
        |reward_map| build(&SearchConfig { reward_map, ..config(Method::Rwr) }, 1, origin());
    let refused = |map, reward| search(map).check_reward(reward).unwrap_err().to_string();
    assert_eq!(search(RewardMap::Shift(2.0)).check_reward(-2.0), Ok(()));
    let error = refused(RewardMap::Shift(2.0), -2.5);
    assert!(error.contains("-2.5") && error.contains("a larger shift"), "{error}");
    assert_eq!(search(RewardMap::Exp(10.0)).check_reward(-2000.0), Ok(()));
    for reward in [-2000.0, 2000.0] {
        let error = refused(RewardMap::Exp(1.0), reward);
        assert!(error.contains("the spread of the rewards"), "{error}");
    }
    assert!(refused(RewardMap::Exp(1.0), f64::NAN).contains("finite"));

    let far = SearchConfig { reward_map: RewardMap::Exp(0.0), ..SearchConfig::default() };
    let error = far.validate().unwrap_err().to_string();
    assert!(error.contains("learner.search.reward_map.exp is 0"), "{error}");
}
