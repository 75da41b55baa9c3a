//! PoWER with covariance adaptation: Eqs. (1) and (6).
//!
//! Rollout 1 is θ₀; the `n_initial` rollouts after it are drawn around θ₀. When all of these are
//! told, the first update takes place with θ⁽ⁿ⁻¹⁾ = θ₀, and one more after each further trial.
//!
//! The paper's search learns from the best trials of all. Where the task says what success is, the
//! default has two phases: until there are a few successes it is the paper's search; from then on it
//! learns from the best *successes* only, and the floor falls with each further one. A reward that was shaped to lead to a
//! success need not tell good successes from near misses. In the second phase directions open that are
//! about how to succeed, the mean itself is executed now and then, and of several draws the one is
//! executed whose known reward is highest. Where draws fail the noise narrows, and where the mean fails it
//! is taken from fewer successes (`draws`).
//!
//! With several rollouts in flight draws are independent, and every trial counts as it comes, from however old a
//! distribution: elites are the best trials of all, drawn from wherever. Turns of the mean count pending rollouts, and no
//! mean is executed twice at once.
//!
//! Departure: the paper takes a reward for what a trial is worth. Where it may be wrong, as a person's rating, elites
//! are ranked by what the rewards of their neighbours say as well (`neighbours`).

mod draws;
mod neighbours;

use std::cmp::Ordering;
use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::{RewardError, Search, SearchSnapshot, Space, rewards};
use crate::range::{Range, range};
use crate::trial::{Proposal, Trial};

/// Which trials Eqs. (1) and (6) are computed from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Elites {
    /// The best of all.
    All,
    /// The best successes, once there are `min_successes`; the best of all before.
    Successes,
}

/// What an elite weighs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Weights {
    /// Its reward, as in Eqs. (1) and (6).
    Reward,
    /// ln(m + ½) − ln i for the i-th best of m.
    Rank,
}

/// About which mean the scatter of successful elites is taken; any other is about the old one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Scatter {
    /// Θ⁽ⁿ⁻¹⁾, as printed in Eq. (6): a step of the mean widens the next distribution.
    Old,
    /// Θ⁽ⁿ⁾, unbiased for weighted elites: their own spread.
    New,
}

/// Settings; standard deviations in scaled units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct PowerConfig {
    /// Number of elites M: the trials Eqs. (1) and (6) are computed from.
    pub n_elites: usize,
    /// Which trials may be elites.
    pub elites: Elites,
    /// Successes needed before the elites are successes only, at most `n_elites`; a single success may be luck.
    pub min_successes: usize,
    /// Weight of an elite.
    pub weights: Weights,
    /// Mean about which the scatter of successful elites is taken.
    pub scatter: Scatter,
    /// Only this many of the latest trials may be elites; 0 for all. With noisy rewards, old elites were often lucky.
    pub memory: u64,
    /// Standard deviation of the reward's noise in units of that of its repeatable part: elites are ranked by their
    /// neighbours' rewards as well. 0 takes rewards as exact.
    #[serde(default = "exact")]
    pub noise: f64,
    /// Rollouts drawn around θ₀ before the first update, after rollout 1, which is θ₀.
    pub n_initial: u64,
    /// Standard deviation of these first draws, in scaled units.
    pub initial_std: f64,
    /// Exploration floor at the start: Σ₀ = `floor_std`²·I, in scaled units.
    pub floor_std: f64,
    /// Factor on the floor per rollout, or per success where successes are the elites; 1 keeps the floor.
    pub floor_decay: f64,
    /// Lowest exploration floor, at most `floor_std`.
    pub floor_min: f64,
    /// Once successes are the elites, every so many rollouts the mean itself is executed; 0 for never.
    #[serde(default = "never")]
    pub mean_every: u64,
    /// Draws after a success, of which the one with the highest known reward, such as compliance, is executed; 1 for
    /// a plain draw.
    #[serde(default = "one")]
    pub candidates: usize,
    /// Once successes are the elites, the noise is scaled so that this share of draws succeeds; 0 does not scale it.
    #[serde(default = "as_it_comes")]
    pub success_rate: f64,
    /// Whether a failure of the executed mean halves the number of elites; each mean that succeeds adds one again.
    #[serde(default)]
    pub fewer_elites: bool,
    /// Floor of directions that open after the first successes, such as stiffness, when they open.
    pub late_std: f64,
    /// Factor on that floor per success.
    pub late_decay: f64,
    /// Lowest floor of those directions, at most `late_std`.
    pub late_min: f64,
}

// What sessions did that were stored before there was a choice.
fn never() -> u64 {
    0
}

fn one() -> usize {
    1
}

fn as_it_comes() -> f64 {
    0.0
}

fn exact() -> f64 {
    0.0
}

impl Default for PowerConfig {
    fn default() -> Self {
        PowerConfig {
            n_elites: 10,
            elites: Elites::Successes,
            min_successes: 4,
            weights: Weights::Rank,
            scatter: Scatter::New,
            memory: 0,
            noise: 0.0,
            n_initial: 15,
            initial_std: 1.0,
            floor_std: 0.5,
            floor_decay: 0.9,
            floor_min: 0.1,
            mean_every: 5,
            candidates: 5,
            success_rate: 0.9,
            fewer_elites: true,
            late_std: 0.5,
            late_decay: 0.97,
            late_min: 0.15,
        }
    }
}

impl PowerConfig {
    /// Settings and their ranges.
    pub fn ranges(&self) -> Vec<Range> {
        vec![
            range("n_elites", self.n_elites as f64, 1.0, 1e4, "1"),
            range("min_successes", self.min_successes as f64, 1.0, 1e4, "1"),
            range("memory", self.memory as f64, 0.0, 1e6, "1"),
            range("noise", self.noise, 0.0, 100.0, "1"),
            range("n_initial", self.n_initial as f64, 0.0, 1e4, "1"),
            range("initial_std", self.initial_std, 0.0, 100.0, "1"),
            range("floor_std", self.floor_std, 0.0, 100.0, "1"),
            range("floor_decay", self.floor_decay, 0.5, 1.0, "1"),
            range("floor_min", self.floor_min, 0.0, 100.0, "1").up_to(self.floor_std),
            range("mean_every", self.mean_every as f64, 0.0, 1e6, "1"),
            range("candidates", self.candidates as f64, 1.0, 1e3, "1"),
            range("success_rate", self.success_rate, 0.0, 0.99, "1"),
            range("late_std", self.late_std, 0.0, 100.0, "1"),
            range("late_decay", self.late_decay, 0.5, 1.0, "1"),
            range("late_min", self.late_min, 0.0, 100.0, "1").up_to(self.late_std),
        ]
    }
}

/// Best first; equal rewards in the order of their rollouts.
pub(super) fn by_reward(a: &Trial, b: &Trial) -> Ordering {
    b.reward.total_cmp(&a.reward).then(a.rollout.cmp(&b.rollout))
}

/// wₘ = r(Θₘ)/Σ r or by rank, of `elites` from the best down; `None` when none is above `worst`:
/// nothing was rewarded. Rewards are scaled by the best one first, so that those near the ends of
/// the number range neither overflow nor vanish.
fn weights(kind: Weights, elites: &[Trial], worst: f64) -> Option<Vec<f64>> {
    let best = elites.iter().map(|trial| trial.reward).fold(f64::NEG_INFINITY, f64::max);
    if best <= worst {
        return None;
    }
    let m = elites.len() as f64;
    let raw: Vec<f64> = match kind {
        Weights::Reward => elites.iter().map(|trial| trial.reward / best).collect(),
        Weights::Rank => (1..=elites.len()).map(|i| (m + 0.5).ln() - (i as f64).ln()).collect(),
    };
    let sum: f64 = raw.iter().sum();
    Some(raw.into_iter().map(|weight| weight / sum).collect())
}

/// Eq. (1): Θ⁽ⁿ⁾ = Θ⁽ⁿ⁻¹⁾ + Σₘ wₘ[Θₘ − Θ⁽ⁿ⁻¹⁾] over the `elites`, with wₘ = r(Θₘ)/Σ r.
pub fn power_mean(theta_old: &DVector<f64>, elites: &[Trial], weights: &[f64]) -> DVector<f64> {
    let mut mean = theta_old.clone();
    for (trial, weight) in elites.iter().zip(weights) {
        mean += (&trial.theta - theta_old) * *weight;
    }
    mean
}

/// Eq. (6) without Σ₀, as factors: fₘ = √wₘ [Θₘ − `centre`] with Σₘ fₘfₘᵀ = Σ⁽ⁿ⁾ − Σ₀. As printed,
/// the centre is Θ⁽ⁿ⁻¹⁾.
fn scatter_factors(centre: &DVector<f64>, elites: &[Trial], weights: &[f64]) -> Vec<DVector<f64>> {
    let factor = |(trial, w): (&Trial, &f64)| (&trial.theta - centre) * w.sqrt();
    elites.iter().zip(weights).map(factor).collect()
}

/// 1/(1 − Σₘ wₘ²): what the scatter of independent draws about their own weighted mean, Σ w = 1, is
/// to be multiplied with to be their covariance in the mean. For equal weights it is m/(m − 1).
fn unbiased(weights: &[f64]) -> f64 {
    let spread = 1.0 - weights.iter().map(|weight| weight * weight).sum::<f64>();
    // One trial has all of the weight: there is no scatter.
    if spread > f64::EPSILON { 1.0 / spread } else { 1.0 }
}

/// Eq. (6): Σ⁽ⁿ⁾ = Σₘ wₘ[Θₘ − Θ⁽ⁿ⁻¹⁾][Θₘ − Θ⁽ⁿ⁻¹⁾]ᵀ + Σ₀, dense (D×D).
pub fn power_covariance(
    theta_old: &DVector<f64>,
    elites: &[Trial],
    weights: &[f64],
    sigma_0: &DMatrix<f64>,
) -> DMatrix<f64> {
    let mut covariance = sigma_0.clone();
    for (trial, weight) in elites.iter().zip(weights) {
        let deviation = &trial.theta - theta_old;
        covariance += &deviation * deviation.transpose() * *weight;
    }
    covariance
}

/// The search.
pub struct Power {
    config: PowerConfig,
    seed: u64,
    space: Space,
    mean: DVector<f64>,
    /// Best first: every trial that can still become an elite.
    kept: Vec<Trial>,
    /// The same with the rewards that were told, oldest first, where these are noisy.
    told: Vec<Trial>,
    n_told: u64,
    /// The lowest reward told, 0 if none was negative: a reward above it says something.
    worst: f64,
    /// Factors of Eq. (6); `None` before the first update: N(θ₀, initial_std²·I).
    factors: Option<Vec<DVector<f64>>>,
    /// Trials that let the floor fall: successes, or all since the first update.
    n_falls: u64,
    /// Trials told since the elites are the successes; `None` before.
    n_succeeding: Option<u64>,
    last_succeeded: bool,
    /// Factor on the noise in the phase of successes, at most 1.
    spread: f64,
    /// Number of successes that are learnt from.
    n_chosen: usize,
    /// The first trial and those of the initial batch.
    initial: Vec<Trial>,
    /// The executed mean of each rollout in flight; `None` for a draw.
    noted: BTreeMap<u64, Option<DVector<f64>>>,
    /// The latest rollout told.
    newest: u64,
}

impl Power {
    pub fn new(config: PowerConfig, seed: u64, space: Space) -> Self {
        let (mean, kept, factors) = (space.inside(space.theta_0.clone()), Vec::new(), None);
        let (n_told, worst, n_falls) = (0, 0.0, 0);
        let (n_succeeding, last_succeeded, initial) = (None, false, Vec::new());
        Power {
            config,
            seed,
            space,
            mean,
            kept,
            told: Vec::new(),
            n_told,
            worst,
            factors,
            n_falls,
            n_succeeding,
            last_succeeded,
            spread: 1.0,
            n_chosen: config.n_elites,
            initial,
            noted: BTreeMap::new(),
            newest: 0,
        }
    }

    /// Standard deviation of the isotropic part of the distribution of `rollout`.
    ///
    /// Departure: the paper's Σ₀ is constant. With `floor_decay` < 1 it shrinks to `floor_min`,
    /// which raises the share of successes late in a session.
    fn floor(&self) -> f64 {
        if self.factors.is_none() {
            return self.config.initial_std;
        }
        let floor = self.config.floor_std * self.config.floor_decay.powf(self.n_falls as f64);
        floor.max(self.config.floor_min)
    }

    fn keep(&mut self, trial: &Trial) {
        if self.config.noise > 0.0 {
            return self.keep_noisy(trial);
        }
        let place = self.kept.partition_point(|other| by_reward(other, trial) == Ordering::Less);
        self.kept.insert(place, trial.clone());
        let PowerConfig { n_elites, memory, .. } = self.config;
        if memory > 0 {
            self.kept.retain(|other| other.rollout + memory > self.newest);
            return;
        }
        // Nothing is ever forgotten, so who is no elite now will not become one.
        let (mut rank, mut rank_of_success) = (0, 0);
        self.kept.retain(|other| {
            rank += 1;
            rank_of_success += usize::from(other.success);
            rank <= n_elites || (other.success && rank_of_success <= n_elites)
        });
    }

    /// The trials to learn from, best first, and whether they are the successes.
    fn elites(&self) -> (Vec<Trial>, bool) {
        let n_successes = self.kept.iter().filter(|trial| trial.success).count();
        let successful = self.config.elites == Elites::Successes
            && n_successes >= self.config.min_successes.min(self.config.n_elites);
        let chosen = self.kept.iter().filter(|trial| trial.success || !successful);
        let n = if successful { self.n_chosen } else { self.config.n_elites };
        (chosen.take(n).cloned().collect(), successful)
    }

    /// Eqs. (1) and (6), which share Θ⁽ⁿ⁻¹⁾. Without any reward mean and covariance stay. Returns
    /// whether the elites are the successes.
    fn update(&mut self) -> bool {
        let (elites, successful) = self.elites();
        let weights = weights(self.config.weights, &elites, self.worst);
        let Some(weights) = weights else { return successful };
        let mean = power_mean(&self.mean, &elites, &weights);
        let factors = if successful && self.config.scatter == Scatter::New {
            let scale = unbiased(&weights).sqrt();
            let factors = scatter_factors(&mean, &elites, &weights);
            factors.into_iter().map(|factor| factor * scale).collect()
        } else {
            scatter_factors(&self.mean, &elites, &weights)
        };
        // A weighted mean of places in the box is in it but for rounding.
        (self.factors, self.mean) = (Some(factors), self.space.inside(mean));
        successful
    }
}

impl Search for Power {
    fn ask(&self, rollout: u64, pending: &[Proposal]) -> Proposal {
        let theta = if rollout == 1 || self.is_turn_of_mean(pending) {
            self.mean.clone()
        } else {
            self.space.inside(self.best_draw(rollout, pending))
        };
        Proposal { rollout, theta }
    }

    fn note(&mut self, proposal: &Proposal, pending: &[Proposal]) {
        let mean = self.is_turn_of_mean(pending).then(|| self.mean.clone());
        self.noted.insert(proposal.rollout, mean);
    }

    fn check_reward(&self, reward: f64) -> Result<(), RewardError> {
        match self.config.weights {
            Weights::Rank => rewards::finite(reward),
            Weights::Reward => rewards::not_negative(
                reward,
                "power with weights = \"reward\" weights trials by their rewards",
            ),
        }
    }

    fn tell(&mut self, trial: &Trial) {
        self.check_reward(trial.reward).expect("the reward was checked");
        self.n_told += 1;
        self.newest = self.newest.max(trial.rollout);
        self.worst = self.worst.min(trial.reward);
        self.keep(trial);
        let noted = self.noted.remove(&trial.rollout).map(|mean| mean.is_some());
        let is_mean = noted.unwrap_or_else(|| self.is_turn_of_mean(&[]));
        self.adapt(is_mean, trial.success);
        if self.n_told <= self.config.n_initial {
            self.initial.push(trial.clone());
            return;
        }
        let successful = self.update();
        self.n_succeeding = successful.then(|| self.n_succeeding.map_or(0, |n| n + 1));
        // The first update ends the initial batch; the floor falls with what is told after it.
        let falls = match self.config.elites {
            Elites::All => self.n_told > self.config.n_initial + 1,
            Elites::Successes => successful && trial.success,
        };
        self.n_falls += u64::from(falls);
    }

    fn mean(&self) -> &DVector<f64> {
        &self.mean
    }

    fn snapshot(&self, _rollout: u64) -> SearchSnapshot {
        let floor = self.floor();
        let mut variance = DVector::from_fn(self.mean.len(), |i, _| self.floor_along(i).powi(2));
        for factor in self.factors.iter().flatten() {
            variance += factor.component_mul(factor);
        }
        let std = variance.map(f64::sqrt) * self.spread;
        SearchSnapshot { mean: self.mean.clone(), std, floor }
    }
}

#[cfg(test)]
mod tests;
