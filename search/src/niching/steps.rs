//! Steps of a climb where trials are dear: a surrogate of log r, of the climb's own trials alone, says
//! which place is the most promising. Trials of other climbs would lead back to the tops they found.

use nalgebra::DVector;

use super::super::normals::{standard_normal, stream};
use super::smooth::Smooth;

/// Rewards below this share of the best are all the same to the surrogate.
const LEAST_SHARE: f64 = 1e-3;
/// The newest trials; the work of a step is in proportion to the square of their number.
const N_TRIALS: usize = 80;
/// Standard deviations added to the expected log r.
const OPTIMISM: f64 = 0.2;
/// A step is at most so many standard deviations of its climb long.
const REACH: f64 = 3.0;
/// The best of so many draws, of these shares of the standard deviation, is moved by rounds of ever
/// shorter moves.
const N_DRAWS: usize = 200;
const SHARES: [f64; 3] = [1.0, 0.5, 0.25];
const N_ROUNDS: i32 = 8;
const N_MOVES: usize = 25;
const SHORTER: f64 = 0.7;

/// The trials of a climb, θ in fractions of the box.
#[derive(Default)]
pub struct Steps {
    points: Vec<DVector<f64>>,
    rewards: Vec<f64>,
}

impl Steps {
    pub fn push(&mut self, point: &DVector<f64>, reward: f64) {
        if self.points.len() == N_TRIALS {
            self.points.remove(0);
            self.rewards.remove(0);
        }
        self.points.push(point.clone());
        self.rewards.push(reward);
    }

    /// The most promising place about `from`, after at least one trial, if those that are pending come out as is
    /// expected of them (kriging believer).
    pub fn next(
        &self,
        from: &DVector<f64>,
        std: f64,
        [seed, rollout]: [u64; 2],
        pending: &[DVector<f64>],
    ) -> DVector<f64> {
        let best = self.rewards.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let value = |reward: &f64| (reward / best).max(LEAST_SHARE).ln();
        let values: Vec<f64> = self.rewards.iter().map(value).collect();
        let mut surrogate = Smooth::fit(self.points.clone(), &values);
        if !pending.is_empty() {
            surrogate = surrogate.believing(&values, pending);
        }
        let score = |place: &DVector<f64>| match place.metric_distance(from) <= REACH * std {
            true => surrogate.hoped(place, OPTIMISM),
            false => f64::NEG_INFINITY,
        };
        let mut rng = stream(seed, rollout);
        // A normal step, within the box.
        let mut moved = |from: &DVector<f64>, std: f64| {
            from.map(|x| (x + std * standard_normal(&mut rng)).clamp(0.0, 1.0))
        };
        let mut highest = (f64::NEG_INFINITY, from.clone());
        let consider = |highest: &mut (f64, DVector<f64>), place: DVector<f64>| {
            let score = score(&place);
            if score > highest.0 {
                *highest = (score, place);
            }
        };
        for draw in 0..N_DRAWS {
            let place = moved(from, std * SHARES[draw % SHARES.len()]);
            consider(&mut highest, place);
        }
        for round in 0..N_ROUNDS {
            // A power the compiler knows in advance is rounded in another way, and sessions must not depend on that.
            let shorter = SHORTER.powi(std::hint::black_box(round));
            for _ in 0..N_MOVES {
                let place = moved(&highest.1, 0.5 * std * shorter);
                consider(&mut highest, place);
            }
        }
        highest.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In nine dimensions, far fewer trials than a quadratic has coefficients (55) lead to a top.
    #[test]
    fn steps_lead_to_the_top_of_a_smooth_hill() {
        let top = DVector::from_fn(9, |i, _| if i % 2 == 0 { 0.7 } else { 0.4 });
        let hill = |place: &DVector<f64>| (-4.0 * (place - &top).norm_squared()).exp();
        for seed in 0..4 {
            let mut steps = Steps::default();
            let mut best = DVector::from_element(9, 0.5);
            steps.push(&best, hill(&best));
            for rollout in 1..=30 {
                let place = steps.next(&best, 0.1, [seed, rollout], &[]);
                assert!(place.metric_distance(&best) <= REACH * 0.1);
                assert!(place.iter().all(|x| (0.0..=1.0).contains(x)));
                assert_eq!(place, steps.next(&best, 0.1, [seed, rollout], &[]));
                steps.push(&place, hill(&place));
                if hill(&place) > hill(&best) {
                    best = place;
                }
            }
            assert!(hill(&best) > 0.97, "seed {seed}: {}", hill(&best));
        }
    }

    #[test]
    fn survives_hostile_rewards_and_keeps_its_newest_trials() {
        let from = DVector::from_element(2, 0.5);
        for reward in [0.0, 1e-310, 1e300] {
            let mut steps = Steps::default();
            for rollout in 1..=100 {
                steps.push(&from, reward);
                assert!(steps.next(&from, 0.1, [1, rollout], &[]).iter().all(|x| x.is_finite()));
            }
            assert_eq!(steps.points.len(), N_TRIALS);
        }
    }
}
