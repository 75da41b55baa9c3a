//! What every method must do with several rollouts in flight, told in any order.

use nalgebra::{DMatrix, DVector};
use rand::RngExt;

use super::aim::Target;
use super::every_method_tests::METHODS;
use super::normals::stream;
use super::*;

const ARMS: usize = 8;

fn config(method: Method) -> SearchConfig {
    let mut config = SearchConfig { method, ..SearchConfig::default() };
    // So that within the trials here each search comes to all it does.
    config.regions.n_fill = 30;
    config.regions.estimator = regions::Estimator::Dirichlet;
    config.niching.n_candidates = 3;
    config.niching.n_between_tests = 10;
    config.power.n_initial = 5;
    let target = |name: &str| Target { parts: 3, ..Target::new(name, [0.4, 1.2], 0.5) };
    config.aim.targets = ["first", "second"].map(target).to_vec();
    config
}

/// Two hills inside of the box; the start is on neither.
fn reward(theta: &DVector<f64>) -> f64 {
    let hill = |x: f64| (-theta.add_scalar(-x).norm_squared()).exp();
    hill(0.8) + 0.9 * hill(-0.8)
}

fn execute(rollout: u64, theta: DVector<f64>) -> Trial {
    let (reward, measured) = (reward(&theta), vec![Some(theta[0]), Some(theta[1])]);
    Trial { rollout, theta, reward, success: reward > 0.6, measured }
}

fn bounds() -> Bounds {
    Bounds::around(&DVector::zeros(3), 2.5)
}

fn spaces() -> [Space; 3] {
    let skewed = DMatrix::from_fn(3, 2, |i, j| [[1.0, 0.2], [0.5, -1.0], [0.3, 0.4]][i][j]);
    let white = Space::white(DVector::zeros(3));
    let along = Space::along(DVector::zeros(3), skewed).unwrap();
    [
        white.clone(),
        Space { bounds: Some(bounds()), ..white },
        Space { bounds: Some(bounds()), ..along },
    ]
}

/// `n` rollouts with up to [`ARMS`] in flight, which end in a random order. Returns all proposals.
fn interleaved(
    desk: &mut AskTell,
    order: u64,
    n: u64,
    mut asked: impl FnMut(&Proposal, &[Proposal]),
) -> Vec<Proposal> {
    let mut rng = stream(order, 0);
    let mut proposals = Vec::new();
    while (proposals.len() as u64) < n {
        let rollout = proposals.len() as u64 + 1;
        let pending: Vec<Proposal> = desk.in_flight().cloned().collect();
        if pending.len() < ARMS {
            let proposal = desk.ask(rollout);
            asked(&proposal, &pending);
            proposals.push(proposal);
        }
        // Sometimes nobody is done, sometimes several are.
        for _ in 0..rng.random_range(0..3) {
            let pending: Vec<Proposal> = desk.in_flight().cloned().collect();
            if !pending.is_empty() {
                let done = &pending[rng.random_range(0..pending.len())];
                desk.tell(&execute(done.rollout, done.theta.clone())).unwrap();
            }
        }
    }
    proposals
}

#[test]
fn no_two_rollouts_in_flight_are_the_same() {
    for method in METHODS {
        for (kind, space) in spaces().into_iter().enumerate() {
            for seed in 0..2 {
                let mut desk = AskTell::new(build(&config(method), seed, space.clone()));
                interleaved(&mut desk, seed, 150, |next, pending| {
                    let at = format!("{method:?}, space {kind}, seed {seed}");
                    assert!(next.theta.iter().all(|x| x.is_finite()), "{at}");
                    assert!(kind == 0 || bounds().contains(&next.theta), "{at}: {}", next.theta);
                    for other in pending {
                        let [a, b] = [other.rollout, next.rollout];
                        let apart = (&other.theta - &next.theta).amax();
                        assert!(apart > 1e-9, "{at}: rollouts {a} and {b}");
                    }
                });
                assert!(desk.mean().iter().all(|x| x.is_finite()), "{method:?}");
            }
        }
    }
}

#[test]
fn the_same_calls_in_the_same_order_give_the_same_bits() {
    for method in METHODS {
        let run = |order| {
            let starts = spaces()[1..].to_vec();
            let mut desk = AskTell::new(build_all(&config(method), 3, starts));
            let proposals = interleaved(&mut desk, order, 120, |_, _| {});
            (proposals, desk.mean().clone())
        };
        assert_eq!(run(1), run(1), "{method:?}");
        if method != Method::Random {
            assert_ne!(run(1), run(2), "{method:?} does not learn");
        }
    }
}

/// A search that is told of nothing but trials is the same as one that notes every proposal.
#[test]
fn one_at_a_time_notes_make_no_difference() {
    for (method, space) in METHODS.into_iter().flat_map(|m| spaces().map(|space| (m, space))) {
        let mut desk = AskTell::new(build(&config(method), 5, space.clone()));
        let mut alone = build(&config(method), 5, space);
        for rollout in 1..=150 {
            let proposal = desk.ask(rollout);
            assert_eq!(alone.ask(rollout, &[]), proposal, "{method:?}");
            let trial = execute(rollout, proposal.theta);
            desk.tell(&trial).unwrap();
            alone.tell(&trial);
        }
    }
}

#[test]
fn a_rollout_in_flight_keeps_its_proposal_until_it_is_withdrawn() {
    for method in METHODS {
        let mut desk = AskTell::new(build(&config(method), 5, spaces()[1].clone()));
        let lost = desk.ask(1);
        for rollout in 2..=60 {
            let theta = desk.ask(rollout).theta;
            desk.tell(&execute(rollout, theta)).unwrap();
            assert_eq!(desk.ask(1), lost, "{method:?}");
        }
        assert_eq!(desk.in_flight().collect::<Vec<_>>(), [&lost]);
        assert_eq!(desk.withdraw(1), Some(lost.clone()));
        assert_eq!((desk.in_flight().count(), desk.withdraw(1)), (0, None));
        let error = desk.tell(&execute(1, lost.theta)).unwrap_err();
        assert_eq!(error, TellError::NotAsked { rollout: 1 });
    }
}

/// With eight arms a search finds about what it finds with one, in the mean over seeds.
#[test]
fn searches_still_learn_with_many_arms() {
    for method in METHODS {
        let (mut one, mut many) = (0.0, 0.0);
        for seed in 0..4 {
            let desk = || AskTell::new(build(&config(method), seed, spaces()[1].clone()));
            let best = |desk: &AskTell| {
                desk.modes().iter().map(|mode| reward(&mode.mean)).fold(0.0, f64::max)
            };
            let (mut with_one, mut with_many) = (desk(), desk());
            for rollout in 1..=150 {
                let theta = with_one.ask(rollout).theta;
                with_one.tell(&execute(rollout, theta)).unwrap();
            }
            interleaved(&mut with_many, seed, 150, |_, _| {});
            one += best(&with_one) / 4.0;
            many += best(&with_many) / 4.0;
        }
        assert!(many > 0.85 * one, "{method:?}: {many} instead of {one}");
    }
}
