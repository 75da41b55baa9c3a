//! Judges that are people: ratings of rollouts, from 0 to 10, weighed with the robot's own reward.
//!
//! r = (1 − w)·own + w·`full_marks`·rating/10. A rollout without a rating counts by the robot's own reward;
//! where only ratings count (w = 1) the search does not learn from it until it is rated.

use serde::{Deserialize, Serialize};

use search::range::{Range, range};

/// The best rating; the worst is 0.
pub const BEST: f64 = 10.0;

/// `[learner.people]`: the weight of ratings, and when the learner asks people.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct PeopleConfig {
    /// Weight w of ratings in a reward: 0 uses none, 1 uses only ratings.
    pub weight: f64,
    /// Whether learning waits for the rating of each rollout.
    pub wait: bool,
    /// Reward of the best rating, on the scale of the task's reward.
    pub full_marks: f64,
    /// With w = 1, a rollout with this rating or better is a success.
    pub success_from: f64,
    /// Standard deviation of the ratings' errors in units of that of ratings without errors: `power` ranks
    /// its elites by their neighbours' ratings as well. 0 takes every rating as exact.
    #[serde(default = "exact")]
    pub noise: f64,
    /// A search without a success asks for a demonstration after this many rollouts without improvement; 0: never.
    pub ask_after: u64,
}

// What sessions did that were stored before there was a choice.
fn exact() -> f64 {
    0.0
}

impl Default for PeopleConfig {
    fn default() -> Self {
        PeopleConfig {
            weight: 0.0,
            wait: true,
            full_marks: 5.0,
            success_from: 7.0,
            // About that of one random rating in five.
            noise: 0.7,
            ask_after: 0,
        }
    }
}

impl PeopleConfig {
    /// Settings and their ranges.
    pub fn ranges(&self) -> [Range; 5] {
        [
            range("weight", self.weight, 0.0, 1.0, "1"),
            range("full_marks", self.full_marks, 1e-6, 1e6, "1"),
            range("success_from", self.success_from, 0.0, BEST, "1"),
            range("noise", self.noise, 0.0, 100.0, "1"),
            range("ask_after", self.ask_after as f64, 0.0, 100_000.0, "1"),
        ]
    }

    pub fn takes_ratings(&self) -> bool {
        self.weight > 0.0
    }

    pub fn takes_ratings_alone(&self) -> bool {
        self.weight == 1.0
    }

    /// σ of rewards in which ratings have their share, the least `noise` of a `power` search.
    pub fn reward_noise(&self) -> f64 {
        self.weight * self.noise
    }

    /// Success and reward of a rated rollout; `own` is the verdict of the robot's judge.
    pub fn weigh(&self, own: (bool, f64), rating: f64) -> (bool, f64) {
        let worth = self.full_marks * rating / BEST;
        match self.takes_ratings_alone() {
            true => (rating >= self.success_from, worth),
            false => (own.0, (1.0 - self.weight) * own.1 + self.weight * worth),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rating_is_weighed_with_the_robots_own_reward() {
        let config = |weight| PeopleConfig { weight, full_marks: 4.0, ..PeopleConfig::default() };
        assert_eq!(config(0.5).weigh((true, 1.0), 10.0), (true, 2.5));
        assert_eq!(config(0.25).weigh((false, 2.0), 0.0), (false, 1.5));
        assert_eq!(config(1.0).weigh((true, 9.0), 5.0), (false, 2.0), "the judge is not heard");
        assert_eq!(config(1.0).weigh((false, -9.0), 7.0), (true, 2.8));
    }

    #[test]
    fn ratings_are_noisy_by_their_share_and_exact_in_sessions_that_were_stored_without_a_choice() {
        let config = |weight| PeopleConfig { weight, ..PeopleConfig::default() };
        assert_eq!(config(0.0).reward_noise(), 0.0);
        assert!(config(1.0).reward_noise() > 0.0);
        assert_eq!(config(0.5).reward_noise(), 0.5 * config(1.0).reward_noise());
        let stored: PeopleConfig = serde_json::from_str(r#"{"weight": 1.0}"#).unwrap();
        assert_eq!(stored.reward_noise(), 0.0);
    }
}
