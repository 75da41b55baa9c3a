//! What of the distribution is executed, and what its success says of the distribution.

use nalgebra::DMatrix;

use super::*;
use crate::Search;
use crate::space::{Direction, Known, Space};
use crate::trial::Trial;

/// Three parameters: the first grows, the last is late.
fn staged(config: PowerConfig) -> Power {
    let directions = vec![
        Direction { grows: true, late: false },
        Direction::default(),
        Direction { grows: false, late: true },
    ];
    let space = Space { directions, ..Space::white(DVector::zeros(3)) };
    Power::new(config, 7, space)
}

fn executes(search: &mut Power, rollouts: std::ops::RangeInclusive<u64>, success: bool) {
    for rollout in rollouts {
        let theta = search.ask(rollout, &[]).theta;
        // More of the first parameter pays.
        let reward = 1.0 + theta[0].tanh();
        search.tell(&Trial { rollout, theta, reward, success, measured: Vec::new() });
    }
}

#[test]
fn what_grows_is_tried_forwards_first() {
    let config = PowerConfig { n_initial: 12, ..PowerConfig::default() };
    let mut search = staged(config);
    executes(&mut search, 1..=1, false);
    let first = |search: &Power, sign: f64| {
        (2..30).all(|rollout| sign * search.ask(rollout, &[]).theta[0] >= 0.0)
    };
    let second = (2..30).filter(|&rollout| search.ask(rollout, &[]).theta[1] < 0.0).count();
    assert!(first(&search, 1.0) && second > 5, "only what grows");
    executes(&mut search, 2..=8, false);
    assert!(first(&search, 1.0), "what was tried says so too");

    let mut less = staged(config);
    for rollout in 1..=4 {
        let theta = less.ask(rollout, &[]).theta;
        less.tell(&Trial {
            rollout,
            reward: 2.0 - theta[0].tanh(),
            theta,
            success: false,
            measured: Vec::new(),
        });
    }
    assert!(!first(&less, 1.0), "forwards pays less");
    let mut good = staged(config);
    executes(&mut good, 1..=1, true);
    assert!(!first(&good, 1.0), "a start that succeeds is not too slow");
}

#[test]
fn late_directions_open_with_the_phase_of_successes() {
    let config = PowerConfig {
        n_initial: 3,
        min_successes: 2,
        mean_every: 0,
        late_std: 0.4,
        late_decay: 0.5,
        late_min: 0.15,
        ..PowerConfig::default()
    };
    let mut search = staged(config);
    executes(&mut search, 1..=9, false);
    assert!((10..40).all(|rollout| search.ask(rollout, &[]).theta[2] == 0.0), "closed");
    executes(&mut search, 10..=11, true);
    // The update after the second success opens it, and that success let its floor fall already.
    assert!((search.floor_along(2) - 0.2).abs() < 1e-12, "{}", search.floor_along(2));
    assert!((search.floor_along(1) - 0.45).abs() < 1e-12, "the others have their own floor");
    assert!(search.ask(12, &[]).theta[2] != 0.0);
    executes(&mut search, 12..=14, true);
    assert_eq!(search.floor_along(2), 0.15);
}

#[test]
fn in_the_phase_of_successes_the_mean_is_executed_now_and_then() {
    let config =
        PowerConfig { n_initial: 3, min_successes: 2, mean_every: 4, ..PowerConfig::default() };
    let mut search = staged(config);
    let is_mean = |search: &Power, rollout| search.ask(rollout, &[]).theta == *search.mean();
    let mut means = Vec::new();
    for rollout in 1..=20 {
        if rollout > 1 && is_mean(&search, rollout) {
            means.push(rollout);
        }
        executes(&mut search, rollout..=rollout, rollout >= 7);
    }
    // Succeeding since the update after rollout 8: three draws, a mean, and so on.
    assert_eq!(means, [12, 16, 20]);
}

#[test]
fn after_a_success_the_candidate_with_the_highest_known_reward_is_executed() {
    let known = Known {
        weights: DVector::from_element(1, 1.0),
        offsets: DVector::zeros(1),
        gradients: DMatrix::from_row_slice(1, 3, &[0.0, 1.0, 1.0]),
        least: -1e9,
    };
    let config =
        PowerConfig { n_initial: 3, min_successes: 2, mean_every: 0, ..PowerConfig::default() };
    let with = |candidates| {
        let mut search = staged(PowerConfig { candidates, ..config });
        search.space.known = Some(known.clone());
        executes(&mut search, 1..=8, false);
        executes(&mut search, 9..=12, true);
        search
    };
    let (one, five) = (with(1), with(5));
    let mean_of = |search: &Power| {
        (13..213).map(|rollout| known.of(&search.ask(rollout, &[]).theta)).sum::<f64>() / 200.0
    };
    // The larger of five of a normal distribution lies 1.16 of its deviations above the mean.
    let spread =
        (13..213).map(|rollout| known.of(&one.ask(rollout, &[]).theta).powi(2)).sum::<f64>();
    let deviation = (spread / 200.0 - mean_of(&one).powi(2)).sqrt();
    let gain = (mean_of(&five) - mean_of(&one)) / deviation;
    assert!(gain > 0.8, "{gain}");
    let mut failed = with(5);
    executes(&mut failed, 13..=13, false);
    let plain = failed.draw(14, &[]);
    assert_eq!(failed.ask(14, &[]).theta, plain, "after a failure a plain draw");
}

#[test]
fn where_draws_fail_the_noise_narrows_until_they_succeed_as_often_as_asked() {
    let config = PowerConfig {
        n_initial: 3,
        min_successes: 2,
        mean_every: 0,
        success_rate: 0.75,
        ..PowerConfig::default()
    };
    let mut search = staged(config);
    executes(&mut search, 1..=8, false);
    assert_eq!(search.spread, 1.0, "before there are successes it is the paper's search");
    executes(&mut search, 9..=10, true);
    executes(&mut search, 11..=11, true);
    assert_eq!(search.spread, 1.0, "never wider than Eq. (6) says");
    let wide = search.snapshot(12).std;
    executes(&mut search, 12..=12, false);
    let narrower = GROWTH.powi(-3);
    assert!(
        (search.snapshot(13).std - wide * narrower).amax() < 1e-12,
        "one failure, three successes"
    );
    executes(&mut search, 13..=15, true);
    assert!((search.spread - 1.0).abs() < 1e-12, "and three successes take it back");
    executes(&mut search, 16..=60, false);
    assert_eq!(search.spread, NARROWEST);

    let mut as_it_comes = staged(PowerConfig { success_rate: 0.0, ..config });
    executes(&mut as_it_comes, 1..=10, true);
    executes(&mut as_it_comes, 11..=20, false);
    assert_eq!(as_it_comes.spread, 1.0);
}

#[test]
fn a_mean_that_fails_is_taken_from_fewer_successes() {
    let config = PowerConfig {
        n_elites: 8,
        n_initial: 3,
        min_successes: 2,
        mean_every: 2,
        ..PowerConfig::default()
    };
    // Every second rollout of the phase of successes is the mean.
    let after = |means: &[bool]| {
        let mut search = staged(config);
        executes(&mut search, 1..=8, true);
        let mut rollout = 9;
        for &succeeds in means {
            while !search.is_turn_of_mean(&[]) {
                executes(&mut search, rollout..=rollout, true);
                rollout += 1;
            }
            executes(&mut search, rollout..=rollout, succeeds);
            rollout += 1;
        }
        search
    };
    let n = |means: &[bool]| after(means).n_chosen;
    assert_eq!([n(&[]), n(&[true]), n(&[false]), n(&[false, true])], [8, 8, 4, 5]);
    assert_eq!(n(&[false; 5]), FEWEST, "never from one alone");
    let search = after(&[false]);
    let (elites, successful) = search.elites();
    assert!(successful && elites.len() == 4 && elites.iter().all(|trial| trial.success));
    let off = PowerConfig { fewer_elites: false, ..config };
    let mut off = staged(off);
    executes(&mut off, 1..=8, true);
    executes(&mut off, 9..=20, false);
    assert_eq!(off.n_chosen, 8);
}
