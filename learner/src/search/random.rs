//! Random search around the demonstration: the baseline every learner has to beat.

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::normals::{standard_normal, stream};
use super::{Search, SearchSnapshot, Space};
use crate::range::{Range, range};
use crate::trial::{Proposal, Trial};

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RandomConfig {
    /// σ in scaled units.
    pub std: f64,
}

impl Default for RandomConfig {
    fn default() -> Self {
        RandomConfig { std: 0.5 }
    }
}

impl RandomConfig {
    /// Settings and their ranges.
    pub fn ranges(&self) -> Vec<Range> {
        vec![range("std", self.std, 0.0, 100.0)]
    }
}

/// θ ~ 𝒩(θ₀, σ²I); it never learns.
pub struct Random {
    config: RandomConfig,
    seed: u64,
    theta_0: DVector<f64>,
}

impl Random {
    pub fn new(config: RandomConfig, seed: u64, space: Space) -> Self {
        Random { config, seed, theta_0: space.theta_0 }
    }
}

impl Search for Random {
    /// Rollout 1 is θ₀ itself, as in every method, so that all start with the same trial.
    fn ask(&self, rollout: u64) -> Proposal {
        let mut theta = self.theta_0.clone();
        if rollout > 1 {
            let mut rng = stream(self.seed, rollout);
            theta.iter_mut().for_each(|x| *x += self.config.std * standard_normal(&mut rng));
        }
        Proposal { rollout, theta }
    }

    fn tell(&mut self, _trial: &Trial) {}

    fn mean(&self) -> &DVector<f64> {
        &self.theta_0
    }

    fn snapshot(&self, _rollout: u64) -> SearchSnapshot {
        let std = DVector::from_element(self.theta_0.len(), self.config.std);
        SearchSnapshot { mean: self.theta_0.clone(), std, floor: self.config.std }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_around_the_start_and_ignores_rewards() {
        let start = DVector::from_element(2000, 3.0);
        let mut search = Random::new(RandomConfig { std: 0.5 }, 1, Space::white(start.clone()));
        assert_eq!(search.ask(1).theta, start);
        let before = search.ask(2);
        search.tell(&Trial {
            rollout: 2,
            theta: before.theta.clone(),
            reward: 9.0,
            success: false,
        });
        assert_eq!(search.ask(2), before);
        let deviation = &before.theta - &start;
        assert!((deviation.norm() / 2000_f64.sqrt() - 0.5).abs() < 0.03);
    }
}
