//! The better mixture search: importance-corrected, tempered, with its own number of components.
//!
//! EM on trials drawn from its own density fits r·q and so narrows with every step; only a large Σ₀
//! keeps it alive, and then forbids exploitation. Here each trial counts
//!
//! ```text
//! w_m = r_m^β / q̄(θ_m)^γ
//! ```
//!
//! where q̄ is the average of all distributions drawn from so far, and β rises from below one to
//! well above: first the mixture covers whatever is rewarded, in the end it stands on the best
//! solutions. All is invariant to r → c·r.
//!
//! With several rollouts in flight a trial is weighted by the density it was drawn from, which may be an older one, and
//! pending proposals count as trials in the novelty of a draw. β and the share of wide draws go by the trials told.
//!
//! Departure: the weights are biased. A trial is the most novel of `n_candidates` draws, so its
//! density is not q but q times how often a draw there is the most novel one, n·F(novelty)ⁿ⁻¹ with
//! the distribution F of the novelty of a draw. Places far from all trials are tried more often than
//! q̄ says and count too much; `n_candidates = 1` is free of it. F depends on all trials at that
//! time and would have to be known at every θ, for every past sampler. We keep the choice because
//! coverage is worth more than the bias costs: without it fewer runs end at the peak (study
//! `landscape`, docs/paper.md).

mod proposals;
mod weighted;

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::gaussian::{Gaussian, log_add};
use super::mixture::{Mixture, draw_within};
use super::normals::stream;
use super::{Mode, RewardError, Search, SearchSnapshot, Space, rewards};
use crate::range::{Range, range};
use crate::trial::{Proposal, Trial};
use proposals::{Past, Sampler};
use weighted::{Fit, Regulariser, Weighted};

/// Trials kept; beyond them the one with the least weight goes.
const MAX_TRIALS: usize = 256;
/// Trials with less of the weights than this take no part in a fit.
const MIN_WEIGHT: f64 = 1e-5;

/// Settings; standard deviations in units of θ.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct TemperedConfig {
    /// Trials until β and the share of wide draws have reached their final values.
    pub horizon: u64,
    /// Trials before the first update, which follows the last of them.
    pub n_initial: u64,
    /// Standard deviation of the initial mixture 𝒩(θ₀, `initial_std`²·I).
    pub initial_std: f64,
    /// Exploration floor Σ₀ = `floor_std`²·I.
    pub floor_std: f64,
    /// Number of trials that the initial covariance counts as in later ones.
    pub pseudo_count: f64,
    /// Inverse temperature β of the first trials.
    pub beta_start: f64,
    /// Inverse temperature β of the last trials.
    pub beta_end: f64,
    /// Share of wide draws among the first trials.
    pub wide_start: f64,
    /// Share of wide draws among the last trials.
    pub wide_end: f64,
    /// Volume of a wide draw's ellipsoid relative to that of Σᵢ.
    pub wide_volume: f64,
    /// Draws of which the most novel is proposed.
    pub n_candidates: usize,
    /// Largest number of components K.
    pub max_components: usize,
    /// Trials after which one is forgotten, for rewards that drift; 0 for never.
    pub memory: u64,
}

impl Default for TemperedConfig {
    fn default() -> Self {
        TemperedConfig {
            horizon: 200,
            n_initial: 5,
            initial_std: 1.4,
            floor_std: 0.2,
            pseudo_count: 1.0,
            beta_start: 0.5,
            beta_end: 10.0,
            wide_start: 0.7,
            wide_end: 0.15,
            wide_volume: 6.0,
            n_candidates: 10,
            max_components: 10,
            memory: 0,
        }
    }
}

impl TemperedConfig {
    /// Settings and their ranges.
    pub fn ranges(&self) -> Vec<Range> {
        vec![
            range("horizon", self.horizon as f64, 1.0, 1e6, "1"),
            range("n_initial", self.n_initial as f64, 1.0, 1e4, "1"),
            range("initial_std", self.initial_std, 1e-9, 1e6, "1"),
            range("floor_std", self.floor_std, 0.0, 1e6, "1"),
            range("pseudo_count", self.pseudo_count, 0.0, 1e3, "1"),
            range("beta_start", self.beta_start, 1e-3, 100.0, "1"),
            range("beta_end", self.beta_end, 1e-3, 100.0, "1"),
            range("wide_start", self.wide_start, 0.0, 1.0, "1"),
            range("wide_end", self.wide_end, 0.0, 1.0, "1"),
            range("wide_volume", self.wide_volume, 1.0, 1e6, "1"),
            range("n_candidates", self.n_candidates as f64, 1.0, 1e3, "1"),
            range("max_components", self.max_components as f64, 1.0, 100.0, "1"),
            range("memory", self.memory as f64, 0.0, 1e6, "1"),
        ]
    }

    /// `start` … `end` over the trials: slowly at first, so that there is time to look around.
    fn at(&self, n_told: u64, start: f64, end: f64) -> f64 {
        let progress = (n_told as f64 / self.horizon as f64).min(1.0);
        start + (end - start) * progress * progress
    }

    /// What earlier draws count less in q̄ after each further trial.
    fn log_decay(&self) -> f64 {
        if self.memory == 0 { 0.0 } else { (-1.0 / self.memory as f64).ln_1p() }
    }
}

/// A trial as the fits need it.
struct Remembered {
    /// Which of the trials told, from 1.
    number: u64,
    theta: DVector<f64>,
    log_reward: f64,
    /// log Σ q(θ) over the distributions drawn from so far.
    log_drawn: f64,
}

/// The search.
pub struct Tempered {
    config: TemperedConfig,
    seed: u64,
    space: Space,
    mixture: Mixture,
    sampler: Arc<Sampler>,
    past: Past,
    trials: Vec<Remembered>,
    n_told: u64,
    /// What the rollouts in flight were drawn from.
    noted: BTreeMap<u64, Arc<Sampler>>,
}

impl Tempered {
    pub fn new(config: TemperedConfig, seed: u64, space: Space) -> Self {
        let start = Gaussian::isotropic(space.theta_0.clone(), config.initial_std.powi(2));
        let mixture = Mixture::single(start);
        let sampler = Arc::new(sampler(&config, &mixture, 0));
        let (past, trials, n_told) = (Past::default(), Vec::new(), 0);
        let noted = BTreeMap::new();
        Tempered { config, seed, space, mixture, sampler, past, trials, n_told, noted }
    }

    pub fn mixture(&self) -> &Mixture {
        &self.mixture
    }

    /// Keeps the trial, and q̄ of all trials kept up to date: one more draw for the earlier ones,
    /// all draws for the new one.
    fn remember(&mut self, trial: &Trial) {
        self.n_told += 1;
        let sampler = self.noted.remove(&trial.rollout).unwrap_or_else(|| self.sampler.clone());
        let log_decay = self.config.log_decay();
        let thetas = self.thetas(|_| true);
        let densities = thetas.map_or(Vec::new(), |thetas| sampler.log_densities(&thetas));
        for (trial, density) in self.trials.iter_mut().zip(densities) {
            trial.log_drawn = log_add(trial.log_drawn + log_decay, density);
        }
        self.past.push(sampler, log_decay);
        self.trials.push(Remembered {
            number: self.n_told,
            theta: trial.theta.clone(),
            log_reward: trial.reward.ln(),
            log_drawn: self.past.log_density(&trial.theta),
        });
    }

    /// Departure: the paper keeps every trial. Here one that is older than `memory` goes, and the
    /// one with the least weight where there are more than [`MAX_TRIALS`]: an update costs the
    /// same after ten thousand trials.
    fn forget(&mut self) {
        if self.config.memory > 0 {
            let oldest = (self.n_told + 1).saturating_sub(self.config.memory);
            self.trials.retain(|trial| trial.number >= oldest);
        }
        if self.trials.len() > MAX_TRIALS {
            let weights = self.log_weights();
            let least = (0..weights.len()).min_by(|&a, &b| weights[a].total_cmp(&weights[b]));
            self.trials.remove(least.expect("there are trials"));
        }
    }

    /// θ of the trials whose index is `wanted` (D×n); `None` of none.
    fn thetas(&self, wanted: impl Fn(usize) -> bool) -> Option<DMatrix<f64>> {
        let trials = self.trials.iter().enumerate().filter(|(i, _)| wanted(*i));
        let columns: Vec<DVector<f64>> = trials.map(|(_, trial)| trial.theta.clone()).collect();
        (!columns.is_empty()).then(|| DMatrix::from_columns(&columns))
    }

    /// log w_m. γ = min(1, 2/D): log q̄ spreads in proportion to the dimension, and with all of it
    /// one trial would outweigh all others in many dimensions.
    fn log_weights(&self) -> Vec<f64> {
        let beta = self.config.at(self.n_told, self.config.beta_start, self.config.beta_end);
        let gamma = (2.0 / self.space.dim() as f64).min(1.0);
        self.trials.iter().map(|t| beta * t.log_reward - gamma * t.log_drawn).collect()
    }

    /// The trials that matter; `None` without any reward.
    fn weighted(&self) -> Option<Weighted> {
        let log_weights = self.log_weights();
        let best = log_weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if best == f64::NEG_INFINITY {
            return None;
        }
        let relative: Vec<f64> = log_weights.iter().map(|weight| (weight - best).exp()).collect();
        let least = MIN_WEIGHT * relative.iter().sum::<f64>();
        let thetas = self.thetas(|i| relative[i] > least)?;
        let kept: Vec<f64> = relative.into_iter().filter(|weight| *weight > least).collect();
        let sum: f64 = kept.iter().sum();
        let weights: Vec<f64> = kept.into_iter().map(|weight| weight / sum).collect();
        let n_effective = 1.0 / weights.iter().map(|weight| weight * weight).sum::<f64>();
        Some(Weighted { thetas, weights, n_effective })
    }

    /// log of q(θ)·dᴰ with the distance d to the nearest trial, told or pending: of the mass that the empty
    /// ball around θ holds, but for a constant.
    fn novelty(&self, theta: &DVector<f64>, log_density: f64, pending: &[Proposal]) -> f64 {
        let told = self.trials.iter().map(|trial| &trial.theta);
        let all = told.chain(pending.iter().map(|proposal| &proposal.theta));
        let distances = all.map(|other| (other - theta).norm_squared());
        let nearest = distances.fold(f64::INFINITY, f64::min);
        let log_distance = if nearest.is_finite() { 0.5 * nearest.ln() } else { 0.0 };
        log_density + theta.len() as f64 * log_distance
    }
}

/// What trials are drawn from when `n_told` were told.
fn sampler(config: &TemperedConfig, mixture: &Mixture, n_told: u64) -> Sampler {
    let wide_share = config.at(n_told, config.wide_start, config.wide_end);
    Sampler::new(mixture.clone(), wide_share, config.wide_volume)
}

impl Search for Tempered {
    /// Proposes the draw that represents the most mass not yet covered by trials, so that q is
    /// covered evenly instead of by chance.
    fn ask(&self, rollout: u64, pending: &[Proposal]) -> Proposal {
        let mut rng = stream(self.seed, rollout);
        let bounds = self.space.bounds.as_ref();
        let draws: Vec<DVector<f64>> = (0..self.config.n_candidates)
            .map(|_| draw_within(bounds, || self.sampler.draw(&mut rng)))
            .collect();
        let densities = self.sampler.log_densities(&DMatrix::from_columns(&draws));
        let novelty = draws.iter().zip(densities).map(|(theta, q)| self.novelty(theta, q, pending));
        let novelty: Vec<f64> = novelty.collect();
        let best = (0..draws.len()).max_by(|&a, &b| novelty[a].total_cmp(&novelty[b]));
        Proposal { rollout, theta: draws[best.expect("n_candidates ≥ 1")].clone() }
    }

    fn note(&mut self, proposal: &Proposal, _pending: &[Proposal]) {
        self.noted.insert(proposal.rollout, self.sampler.clone());
    }

    fn check_reward(&self, reward: f64) -> Result<(), RewardError> {
        rewards::not_negative(reward, "tempered weights trials by powers of their rewards")
    }

    fn tell(&mut self, trial: &Trial) {
        self.check_reward(trial.reward).expect("the reward was checked");
        self.remember(trial);
        self.forget();
        if self.n_told < self.config.n_initial {
            return;
        }
        if let Some(trials) = self.weighted() {
            let regulariser = Regulariser {
                variance: self.config.initial_std.powi(2),
                pseudo_count: self.config.pseudo_count,
                floor: self.config.floor_std.powi(2),
            };
            let mut fit = Fit::new(self.mixture.clone(), &trials, regulariser);
            fit.em_step();
            fit.select(self.n_told, self.config.max_components);
            self.mixture = fit.into_mixture();
        }
        self.sampler = Arc::new(sampler(&self.config, &self.mixture, self.n_told));
    }

    fn mean(&self) -> &DVector<f64> {
        self.mixture.dominant().gaussian.mean()
    }

    fn snapshot(&self, _rollout: u64) -> SearchSnapshot {
        let dominant = &self.mixture.dominant().gaussian;
        let std = dominant.covariance().diagonal().map(f64::sqrt);
        SearchSnapshot { mean: dominant.mean().clone(), std, floor: self.config.floor_std }
    }

    fn modes(&self) -> Vec<Mode> {
        self.mixture.modes()
    }
}

#[cfg(test)]
mod tests;
