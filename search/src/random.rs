//! Random search, uniform in the box or normal around the demonstration: the baseline every learner
//! has to beat. Rollouts in flight make no difference to it.

use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::normals::{standard_normal, stream};
use super::power::by_reward;
use super::{Mode, Search, SearchSnapshot, Space};
use crate::range::{Range, range};
use crate::trial::{Proposal, Trial};

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct RandomConfig {
    /// Standard deviation around θ₀ in scaled units, where no box is known.
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
        vec![range("std", self.std, 0.0, 100.0, "1")]
    }
}

/// θ uniform in the box if there is one, θ ~ 𝒩(θ₀, σ²I) otherwise. Its distribution never learns;
/// its answer is the best trial.
pub struct Random {
    config: RandomConfig,
    seed: u64,
    space: Space,
    /// θ₀, or the centre of the box.
    mean: DVector<f64>,
    best: Option<Trial>,
}

impl Random {
    pub fn new(config: RandomConfig, seed: u64, space: Space) -> Self {
        let mean = match &space.bounds {
            Some(bounds) => bounds.at(&vec![0.5; space.dim()]),
            None => space.theta_0.clone(),
        };
        Random { config, seed, space, mean, best: None }
    }

    fn std(&self) -> DVector<f64> {
        match &self.space.bounds {
            Some(bounds) => (&bounds.max - &bounds.min) / f64::sqrt(12.0),
            None => DVector::from_element(self.space.dim(), self.config.std),
        }
    }
}

impl Search for Random {
    /// Rollout 1 is θ₀ itself, as in every method, so that all start with the same trial.
    fn ask(&self, rollout: u64, _pending: &[Proposal]) -> Proposal {
        let mut rng = stream(self.seed, rollout);
        let theta = match &self.space.bounds {
            _ if rollout == 1 => self.space.theta_0.clone(),
            Some(bounds) => {
                let fractions: Vec<f64> = (0..self.space.dim()).map(|_| rng.random()).collect();
                bounds.at(&fractions)
            }
            None => self.mean.map(|x| x + self.config.std * standard_normal(&mut rng)),
        };
        Proposal { rollout, theta }
    }

    fn tell(&mut self, trial: &Trial) {
        if self.best.as_ref().is_none_or(|best| by_reward(trial, best).is_lt()) {
            self.best = Some(trial.clone());
        }
    }

    fn mean(&self) -> &DVector<f64> {
        &self.mean
    }

    fn snapshot(&self, _rollout: u64) -> SearchSnapshot {
        let std = self.std();
        SearchSnapshot { mean: self.mean.clone(), floor: std.min(), std }
    }

    fn modes(&self) -> Vec<Mode> {
        let mean = self.best.as_ref().map_or(&self.mean, |best| &best.theta).clone();
        let covariance = DMatrix::from_diagonal(&self.std().map(|s| s * s));
        vec![Mode { prior: 1.0, mean, covariance }]
    }
}

#[cfg(test)]
mod tests {
    use super::super::Bounds;
    use super::*;

    fn trial(rollout: u64, theta: DVector<f64>, reward: f64) -> Trial {
        Trial { rollout, theta, reward, success: false, measured: Vec::new() }
    }

    #[test]
    fn samples_around_the_start_and_answers_with_the_best_trial() {
        let start = DVector::from_element(2000, 3.0);
        let mut search = Random::new(RandomConfig { std: 0.5 }, 1, Space::white(start.clone()));
        assert_eq!(search.ask(1, &[]).theta, start);
        let before = search.ask(2, &[]);
        search.tell(&trial(2, before.theta.clone(), 9.0));
        search.tell(&trial(3, start.clone(), 8.0));
        assert_eq!(search.ask(2, &[]), before);
        assert_eq!(search.modes()[0].mean, before.theta);
        let deviation = &before.theta - &start;
        assert!((deviation.norm() / 2000_f64.sqrt() - 0.5).abs() < 0.03);
    }

    #[test]
    fn fills_the_box_evenly() {
        let bounds = Some(Bounds::new(2, &[-1.0, 10.0], &[1.0, 30.0]).unwrap());
        let start = Space::white(DVector::from_vec(vec![0.5, 11.0]));
        let search = Random::new(RandomConfig::default(), 4, Space { bounds, ..start });
        assert_eq!(search.mean().as_slice(), [0.0, 20.0]);
        let thetas: Vec<DVector<f64>> =
            (2..2002).map(|rollout| search.ask(rollout, &[]).theta).collect();
        let share = |inside: &dyn Fn(&DVector<f64>) -> bool| {
            thetas.iter().filter(|theta| inside(theta)).count() as f64 / 2000.0
        };
        assert!(thetas.iter().all(|t| t[0].abs() <= 1.0 && (10.0..=30.0).contains(&t[1])));
        for edge in [0.25, 0.5, 0.75] {
            assert!((share(&|t| t[0] < 2.0 * edge - 1.0) - edge).abs() < 0.04);
            assert!((share(&|t| t[1] < 10.0 + 20.0 * edge) - edge).abs() < 0.04);
        }
    }
}
