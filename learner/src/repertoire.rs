//! The repertoire of a session: policies for a condition, selected from its rollouts.
//!
//! From all rollouts that met the condition, selects the one whose neighbours met it too, moved to
//! their mean. Neighbours are weighed by k = exp(−|eᵢ − eⱼ|²/2ℓ²), where θ = θ₀ + L e; the chance of a
//! rollout is Σⱼ kᵢⱼ okⱼ / (1 + Σⱼ kᵢⱼ): one that stands alone counts half.

use nalgebra::{DMatrix, DVector};
use search::Space;
use thiserror::Error;

use crate::store::TrialRecord;
use crate::wish::Wish;

/// ℓ, in units of exploration.
const NEAR: f64 = 0.8;

/// The policy for a condition.
#[derive(Clone, Debug, PartialEq)]
pub struct Served {
    pub theta: DVector<f64>,
    /// The rollout it was taken from.
    pub rollout: u64,
    /// Number of rollouts that met the condition.
    pub n: usize,
    /// Estimated chance of success from the neighbourhood of that rollout, 0 to 1.
    pub chance: f64,
}

/// Why there is no policy for a condition.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum Unserved {
    #[error("no rollout of this session has succeeded yet: there is nothing to choose from")]
    NoSuccess,
    #[error(
        "none of the {successes} successful rollouts meets `{wish}`; they have {served}: relax the \
         condition, or learn it with learner.search.aim.then = \"cover\""
    )]
    Nothing { wish: String, successes: usize, served: String },
}

/// Selects the policy for `wish` from `trials`, which were searched along the directions of `space`.
pub fn serve(space: &Space, trials: &[TrialRecord], wish: &Wish) -> Result<Served, Unserved> {
    let executed: Vec<&TrialRecord> =
        trials.iter().filter(|t| t.was_executed() && !t.unrated).collect();
    let is_ok = |trial: &&TrialRecord| trial.judged_success && wish.holds(&trial.measures);
    let ok: Vec<&TrialRecord> = executed.iter().copied().filter(is_ok).collect();
    if ok.is_empty() {
        return Err(unserved(&executed, wish));
    }
    let coordinates = Coordinates::of(space);
    let places = |of: &[&TrialRecord]| -> Vec<DVector<f64>> {
        of.iter().map(|trial| coordinates.at(&trial.theta)).collect()
    };
    let (all, ours) = (places(&executed), places(&ok));
    let near = |a: &DVector<f64>, others: &[DVector<f64>]| -> f64 {
        others.iter().map(|b| kernel(a, b)).sum()
    };
    let chance = |a: &DVector<f64>| near(a, &ours) / (1.0 + near(a, &all));
    let chances: Vec<f64> = ours.iter().map(chance).collect();
    // The first of equals.
    let best = (0..ok.len())
        .reduce(|a, b| if chances[b] > chances[a] { b } else { a })
        .expect("not empty");

    let mut theta = DVector::zeros(space.dim());
    for (trial, place) in ok.iter().zip(&ours) {
        theta += &trial.theta * kernel(&ours[best], place);
    }
    theta /= near(&ours[best], &ours);
    Ok(Served { theta, rollout: ok[best].rollout, n: ok.len(), chance: chances[best] })
}

fn kernel(a: &DVector<f64>, b: &DVector<f64>) -> f64 {
    (-0.5 * (a - b).norm_squared() / NEAR.powi(2)).exp()
}

/// What the successes range over, of the measures that `wish` speaks of.
fn unserved(executed: &[&TrialRecord], wish: &Wish) -> Unserved {
    let successes: Vec<_> = executed.iter().filter(|trial| trial.judged_success).collect();
    if successes.is_empty() {
        return Unserved::NoSuccess;
    }
    let range = |name: &str| {
        let values = || successes.iter().filter_map(|trial| trial.measures.get(name));
        let (min, max) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), value| {
            (min.min(value), max.max(value))
        });
        format!("{name} between {min:.3} and {max:.3}")
    };
    let served: Vec<String> = wish.names().into_iter().map(range).collect();
    let (wish, successes) = (wish.text().to_string(), successes.len());
    Unserved::Nothing { wish, successes, served: served.join(", ") }
}

/// θ in units of exploration: e = L⁺θ, and what no direction reaches in units of the weakest one, so that
/// policies that grew from several demonstrations stay apart.
struct Coordinates {
    directions: DMatrix<f64>,
    inverse: DMatrix<f64>,
    weakest: f64,
}

impl Coordinates {
    fn of(space: &Space) -> Coordinates {
        let directions = space.exploration.clone();
        let weakest = directions.singular_values().min();
        Coordinates { directions, inverse: space.inverse(), weakest }
    }

    fn at(&self, theta: &DVector<f64>) -> DVector<f64> {
        let e = &self.inverse * theta;
        let rest = (theta - &self.directions * &e) / self.weakest;
        DVector::from_iterator(e.len() + rest.len(), e.iter().chain(&rest).copied())
    }
}

#[cfg(test)]
mod tests {
    use search::trial::Trial;
    use shm_types::measures::{Measure, Measures};

    use super::*;

    fn trial(rollout: u64, theta: [f64; 2], success: bool) -> TrialRecord {
        let apex = Measure { name: "apex_m", unit: "m", value: 0.4 + 0.1 * theta[0] };
        let (theta, measured) = (DVector::from_column_slice(&theta), Vec::new());
        let trial = Trial { rollout, theta, reward: 1.0, success, measured };
        TrialRecord::of(trial, Measures::of([apex]).unwrap())
    }

    /// Successes along a ridge, failures beside it, one success far away.
    fn trials() -> Vec<TrialRecord> {
        let mut trials = vec![trial(1, [2.9, 9.0], true)];
        for k in 0..12 {
            let x = f64::from(k) * 0.25;
            for (y, success) in [(-2.0, false), (-0.2, true), (0.2, true), (2.0, false)] {
                trials.push(trial(trials.len() as u64 + 1, [x, y], success));
            }
        }
        trials
    }

    fn wish(text: &str) -> Wish {
        Wish::parse(text, &trials()[0].measures.declared()).unwrap()
    }

    #[test]
    fn a_wish_gets_the_middle_of_what_succeeded_so() {
        let space = Space::white(DVector::zeros(2));
        let (trials, wish) = (trials(), wish("apex_m > 0.55"));
        let served = serve(&space, &trials, &wish).unwrap();
        assert_eq!(served.n, 11);
        assert!(served.theta[0] > 1.5 && served.theta[1].abs() < 0.05, "{}", served.theta);
        assert!(served.chance > 0.5 && served.rollout > 1);
        let whole = serve(&space, &trials, &super::tests::wish("true")).unwrap();
        assert!(whole.n == 25 && whole.theta[1].abs() < 0.05);
    }

    #[test]
    fn a_wish_that_nothing_serves_hears_what_is_served() {
        let space = Space::white(DVector::zeros(2));
        let error = serve(&space, &trials(), &wish("apex_m > 0.9")).unwrap_err().to_string();
        assert!(
            error.contains("none of the 25 successful rollouts") && error.contains("apex_m > 0.9")
        );
        assert!(error.contains("apex_m between 0.400 and 0.690"), "{error}");
        let none: Vec<_> = trials()
            .into_iter()
            .map(|trial| TrialRecord { judged_success: false, ..trial })
            .collect();
        assert_eq!(serve(&space, &none, &wish("true")).unwrap_err(), Unserved::NoSuccess);
    }

    /// Two starts that no direction joins are no neighbours.
    #[test]
    fn what_no_direction_reaches_is_far_away() {
        let along = DMatrix::from_column_slice(2, 1, &[0.5, 0.0]);
        let space = Space::along(DVector::zeros(2), along).unwrap();
        let trials = [trial(1, [0.0, 0.0], true), trial(2, [0.0, 3.0], false)];
        let served = serve(&space, &trials, &wish("true")).unwrap();
        assert_eq!(served.rollout, 1);
        assert!((served.chance - 0.5).abs() < 1e-9);
    }
}
