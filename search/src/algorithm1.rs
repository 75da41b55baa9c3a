//! Algorithm 1 as the paper prints it: EM on a Gaussian mixture with split and merge.
//!
//! What the paper leaves open is a setting, or stated where it is decided. With several rollouts in flight each is drawn
//! from the present mixture, and trials count whichever mixture they were drawn from, as in the paper: its elites
//! are of all trials.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::gaussian::Gaussian;
use super::mixture::{About, EmStep, Mixture};
use super::normals::stream;
use super::split_merge::{Split, merge, split};
use super::{Mode, RewardError, Search, SearchSnapshot, Space, rewards};
use crate::range::{Range, range};
use crate::trial::{Proposal, Trial};

/// Settings; variances in squared units of θ.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct Algorithm1Config {
    /// Number of elites M of each component; 0 for all trials.
    pub n_elites: usize,
    /// Trials before the first update, which follows the last of them.
    pub n_initial: usize,
    /// Variance of the initial mixture 𝒩(θ₀, `initial_variance`·I).
    pub initial_variance: f64,
    /// Exploration floor Σ₀ = `floor_variance`·I.
    pub floor_variance: f64,
    /// Steps of Eq. (7) after each trial.
    pub em_steps: usize,
    /// Threshold Tˢ: a split must raise the weighted log-likelihood by more.
    pub split_threshold: f64,
    /// Threshold Tᴹ: a merge must lower the weighted log-likelihood by less.
    pub merge_threshold: f64,
    /// Largest number of components K.
    pub max_components: usize,
}

impl Default for Algorithm1Config {
    fn default() -> Self {
        Algorithm1Config {
            n_elites: 5,
            n_initial: 5,
            initial_variance: 2.0,
            floor_variance: 3.0,
            em_steps: 1,
            split_threshold: 2e-4,
            merge_threshold: 2e-6,
            max_components: 10,
        }
    }
}

impl Algorithm1Config {
    /// Settings and their ranges.
    pub fn ranges(&self) -> Vec<Range> {
        vec![
            range("n_elites", self.n_elites as f64, 0.0, 1e4, "1"),
            range("n_initial", self.n_initial as f64, 1.0, 1e4, "1"),
            range("initial_variance", self.initial_variance, 0.0, 1e6, "1"),
            range("floor_variance", self.floor_variance, 0.0, 1e6, "1"),
            range("em_steps", self.em_steps as f64, 1.0, 100.0, "1"),
            range("split_threshold", self.split_threshold, 0.0, 1e3, "1"),
            range("merge_threshold", self.merge_threshold, 0.0, 1e3, "1"),
            range("max_components", self.max_components as f64, 1.0, 100.0, "1"),
        ]
    }
}

/// What split and merge tests after one trial found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Event {
    /// max(Lˢ) − L̂ of lines 9–11; `None` when there was no test.
    pub split_gain: Option<f64>,
    /// L̂ − max(Lᴹ) of lines 19–21; `None` when there was no test.
    pub merge_loss: Option<f64>,
    pub split: bool,
    pub merged: bool,
}

/// The search.
pub struct Algorithm1 {
    config: Algorithm1Config,
    seed: u64,
    space: Space,
    mixture: Mixture,
    /// Centre of the dominant component, in the box: a split of Eq. (9) may put it outside.
    mean: DVector<f64>,
    trials: Vec<Trial>,
    last_event: Event,
}

impl Algorithm1 {
    pub fn new(config: Algorithm1Config, seed: u64, space: Space) -> Self {
        let mean = space.inside(space.theta_0.clone());
        let mixture = Mixture::single(Gaussian::isotropic(mean.clone(), config.initial_variance));
        let (trials, last_event) = (Vec::new(), Event::default());
        Algorithm1 { config, seed, space, mixture, mean, trials, last_event }
    }

    pub fn mixture(&self) -> &Mixture {
        &self.mixture
    }

    /// What happened after the last trial told.
    pub fn last_event(&self) -> Event {
        self.last_event
    }

    /// Lines 4–11: the split that raises the likelihood most, if by more than Tˢ.
    fn try_split(&mut self, event: &mut Event) {
        if self.mixture.components.len() >= self.config.max_components {
            return;
        }
        let n = self.mixture.components.len();
        let candidates = (0..n).map(|i| split(&self.mixture, i, Split::default()));
        if let Some((gain, best)) = self.best_change(candidates) {
            event.split_gain = Some(gain);
            event.split = gain > self.config.split_threshold;
            if event.split {
                self.mixture = best;
            }
        }
    }

    /// Lines 12–21: the merge that lowers the likelihood least, if by less than Tᴹ. Departure: for
    /// K = 1 there is no pair, and the paper's maximum over none is skipped.
    fn try_merge(&mut self, event: &mut Event) {
        let n = self.mixture.components.len();
        let pairs = (0..n).flat_map(|j| (j + 1..n).map(move |k| (j, k)));
        let candidates = pairs.map(|(j, k)| merge(&self.mixture, j, k));
        if let Some((gain, best)) = self.best_change(candidates) {
            event.merge_loss = Some(-gain);
            event.merged = -gain < self.config.merge_threshold;
            if event.merged {
                self.mixture = best;
            }
        }
    }

    /// The first of the candidates with the highest likelihood, and how much it gains on the
    /// mixture.
    fn best_change(&self, candidates: impl Iterator<Item = Mixture>) -> Option<(f64, Mixture)> {
        let now = self.mixture.log_likelihood(&self.trials)?;
        let mut best: Option<(f64, Mixture)> = None;
        for candidate in candidates {
            let gain = candidate.log_likelihood(&self.trials)? - now;
            if best.as_ref().is_none_or(|(highest, _)| gain > *highest) {
                best = Some((gain, candidate));
            }
        }
        best
    }
}

impl Search for Algorithm1 {
    /// Line 2, as [`Mixture::sample`].
    fn ask(&self, rollout: u64, _pending: &[Proposal]) -> Proposal {
        let mut rng = stream(self.seed, rollout);
        Proposal { rollout, theta: self.mixture.sample(&mut rng, self.space.bounds.as_ref()) }
    }

    fn check_reward(&self, reward: f64) -> Result<(), RewardError> {
        rewards::not_negative(reward, "algorithm1 weights trials by their rewards")
    }

    /// Lines 3–21.
    fn tell(&mut self, trial: &Trial) {
        self.check_reward(trial.reward).expect("the reward was checked");
        self.trials.push(trial.clone());
        let mut event = Event::default();
        if self.trials.len() >= self.config.n_initial {
            let dim = trial.theta.len();
            let sigma_0 = DMatrix::from_diagonal_element(dim, dim, self.config.floor_variance);
            let step = EmStep { n_elites: self.config.n_elites, sigma_0, about: About::OldMean };
            for _ in 0..self.config.em_steps {
                self.mixture = self.mixture.em_step(&self.trials, &step);
            }
            self.try_split(&mut event);
            self.try_merge(&mut event);
        }
        self.last_event = event;
        self.mean = self.space.inside(self.mixture.dominant().gaussian.mean().clone());
    }

    fn mean(&self) -> &DVector<f64> {
        &self.mean
    }

    fn snapshot(&self, _rollout: u64) -> SearchSnapshot {
        let dominant = &self.mixture.dominant().gaussian;
        let std = dominant.covariance().diagonal().map(f64::sqrt);
        let floor = self.config.floor_variance.sqrt();
        SearchSnapshot { mean: self.mean.clone(), std, floor }
    }

    fn modes(&self) -> Vec<Mode> {
        let inside = |mode: Mode| Mode { mean: self.space.inside(mode.mean), ..mode };
        self.mixture.modes().into_iter().map(inside).collect()
    }
}

#[cfg(test)]
mod tests;
