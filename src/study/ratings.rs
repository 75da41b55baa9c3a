//! Pancake flipping by ratings alone: a person who sees how far the pancake turned and whether it was caught, and
//! now and then presses the wrong key, beside the robot's own reward.

use std::f64::consts::PI;

use anyhow::Result;
use learner::people::{BEST, PeopleConfig};
use rand::RngExt;
use search::normals::stream;
use shm_types::measures::Measures;

use super::Sample;
use super::pancake::{Bench, learn_by, summary};
use super::runs::Came;
use crate::config::Config;

/// Stream of the rater's errors, beyond those of the worlds.
const ERRORS: u64 = 6 << 32;
/// Part of a rating for the catch; the rest is for the turn.
const CATCH: f64 = 5.0;

/// Who judges.
struct Case {
    name: &'static str,
    /// The share of ratings that are any number; `None` where the robot's own reward is learnt from.
    errors: Option<f64>,
    /// What the session takes ratings for.
    people: PeopleConfig,
}

fn cases() -> Vec<Case> {
    let none = PeopleConfig::default();
    let alone = PeopleConfig { weight: 1.0, ..none };
    let exact = PeopleConfig { noise: 0.0, ..alone };
    let case = |name, errors, people| Case { name, errors, people };
    vec![
        case("own reward", None, none),
        case("ratings", Some(0.0), alone),
        case("ratings, 20 % wrong", Some(0.2), alone),
        case("ratings, 40 % wrong", Some(0.4), alone),
        case("taken as exact", Some(0.0), exact),
        case("taken as exact, 20 % wrong", Some(0.2), exact),
        case("taken as exact, 40 % wrong", Some(0.4), exact),
    ]
}

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    for case in cases() {
        samples.extend(run(&case, seed)?);
    }
    Ok(samples)
}

fn run(case: &Case, seed: u64) -> Result<Vec<Sample>> {
    let mut config = Config::default();
    (config.learner.seed, config.learner.people) = (seed, case.people);
    let bench = Bench::new(config, false)?;
    let (mut plant, mut succeeded) = (bench.plant(&bench.world), Vec::new());
    let (mut executed, _) = learn_by(&bench, |problem, rollout, theta| {
        let judged = bench.judged_on(problem, theta, &mut plant)?;
        succeeded.push(judged.1);
        let came = bench.came(&judged);
        let Some(errors) = case.errors else { return Ok(came) };
        let rating = rating(&judged.0, errors, seed, rollout);
        let (success, reward) = case.people.weigh((judged.1, judged.2), rating);
        Ok(Came { success, reward, ..came })
    })?;
    // The table counts what happened, not how it was rated.
    for (one, success) in executed.iter_mut().zip(succeeded) {
        one.trial.success = success;
    }
    Ok(summary(case.name, &executed))
}

/// What the rater says of a rollout, in whole numbers.
fn rating(measures: &Measures, errors: f64, seed: u64, rollout: u64) -> f64 {
    let mut rng = stream(seed, ERRORS + rollout);
    if rng.random_range(0.0..1.0) < errors {
        return f64::from(rng.random_range(0..=BEST as u32));
    }
    let turn = measures.get("flip_angle_rad").unwrap_or(0.0).abs() / PI;
    let caught = f64::from(u8::from(measures.has("caught")));
    ((BEST - CATCH) * turn.min(1.0) + CATCH * caught).round()
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_types::measures::Measure;

    #[test]
    fn the_rater_sees_turn_and_catch_and_errs_as_often_as_said() {
        let seen = |turn_rad, caught| {
            let turn = Measure { name: "flip_angle_rad", unit: "rad", value: turn_rad };
            Measures::of([turn, Measure::truth("caught", caught)]).unwrap()
        };
        assert_eq!(rating(&seen(PI, true), 0.0, 1, 1), 10.0);
        assert_eq!(rating(&seen(0.5 * PI, false), 0.0, 1, 1), 3.0);
        assert_eq!(rating(&seen(0.0, false), 0.0, 1, 1), 0.0);
        let wrong = (0..1000).filter(|n| rating(&seen(PI, true), 0.22, 1, *n) != 10.0).count();
        assert!((150..250).contains(&wrong), "{wrong}");
    }
}
