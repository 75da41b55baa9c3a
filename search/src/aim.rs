//! Learning from measures: what was measured says what was wrong, where a reward says how good it was.
//!
//! Every target is a measure and the window it is to lie in. Gaussian processes (`estimate`) expect of a
//! policy what will be measured of it, from what was measured so far and, where the task can compute one,
//! from a prediction. Rollout 1 is θ₀; every other one executes, of a set of candidates, the one that most
//! likely succeeds: all measures in their windows, and more of its neighbours succeeded than failed.
//!
//! With several rollouts in flight each executes the best candidate that is not pending, and pending aims at a part count
//! as trials of it. Keeping away from the neighbourhood of pending ones made no difference (docs/adr/0034).
//!
//! After so many successes PoWER may take over, for what no target speaks of; or the search goes on to
//! succeed in every part of the windows (`cover`), so that there is a policy for every wish.

mod config;
mod cover;
mod estimate;
mod process;
mod window;

use std::collections::BTreeMap;

use nalgebra::DVector;

pub use config::{AimConfig, Target, Then};
use cover::{Cover, part_of, windows};
use estimate::{Estimate, Expected, Place};

use super::normals::{standard_normal, stream};
use super::power::{Elites, Power, PowerConfig};
use super::{RewardError, Search, SearchSnapshot, Space, rewards};
use crate::trial::{Proposal, Trial};

/// What it costs to go far from the start, per squared unit.
const RIDGE: f64 = 0.02;
/// Trials that the measures are worth against those that succeeded or failed nearby.
const PRIOR: f64 = 0.3;
/// How near that is, in units of `std`.
const NEAR: f64 = 0.4;
/// Candidates nearer to each other than this are the same but for rounding.
const SAME: f64 = 1e-9;
/// Part of the measures' say that no success outweighs.
const SHARE: f64 = 0.3;

/// The best candidates get neighbours: at first in rounds, then a few a rollout, and rarely once the search
/// succeeds.
const BEST: usize = 4;
const ROUNDS: usize = 3;
const A_ROUND: usize = 32;
const ROUND_STD: f64 = 0.4;
const A_ROLLOUT: usize = 8;
/// Candidates that need no prediction cost next to nothing.
const ROUNDS_WITHOUT_PREDICTION: usize = 8;
const ROLLOUT_STD: f64 = 0.25;
const ENOUGH_SUCCESSES: u64 = 6;
const SELDOM: u64 = 5;

/// A place that may be executed next.
struct Candidate {
    /// θ = θ₀ + std·e
    e: DVector<f64>,
    predicted: Vec<Option<f64>>,
    places: Vec<Place>,
    /// How many trials are near, and how many successes, by a kernel.
    tried: f64,
    succeeded: f64,
    /// How likely it succeeds, and that in the part that is aimed at; logarithms, not normalised.
    score: f64,
    aimed: f64,
    /// u and what is expected of every measure.
    u: f64,
    expected: Vec<Expected>,
    /// In which part what is expected of it lies.
    part: usize,
}

impl Candidate {
    /// ln p + share·u.
    fn score(&self) -> f64 {
        let p = (PRIOR * self.u.exp() + self.succeeded) / (PRIOR + self.tried);
        p.max(f64::MIN_POSITIVE).ln() + SHARE * self.u.max(f64::MIN)
    }

    /// Σⱼ ln P(measure j in its window) over the measures that have one.
    fn within(&self, windows: &[Option<[f64; 2]>]) -> f64 {
        let each = self.expected.iter().zip(windows);
        each.map(|(expected, window)| window.map_or(0.0, |w| expected.log_within(w))).sum()
    }

    fn meet(&mut self, e: &DVector<f64>, success: bool) {
        let k = (-0.5 * (&self.e - e).norm_squared() / NEAR.powi(2)).exp();
        self.tried += k;
        self.succeeded += if success { k } else { 0.0 };
    }
}

/// The search.
pub struct Aim {
    config: AimConfig,
    seed: u64,
    space: Space,
    estimates: Vec<Estimate>,
    /// Best first; none before the first trial.
    candidates: Vec<Candidate>,
    /// e and success of every trial.
    told: Vec<(DVector<f64>, bool)>,
    cover: Cover,
    n_successes: u64,
    /// The parts that rollouts in flight are aimed at.
    noted: BTreeMap<u64, usize>,
    mean: DVector<f64>,
    power: Option<Power>,
}

impl Aim {
    /// `power` shapes the search that may follow.
    pub fn new(config: AimConfig, power: PowerConfig, seed: u64, space: Space) -> Aim {
        let estimates = config.targets.iter().map(|t| Estimate::new(t, config.length)).collect();
        let floor_std = config.std * config.floor_std;
        let then = PowerConfig {
            elites: Elites::Successes,
            min_successes: config.successes as usize,
            n_initial: 0,
            floor_std,
            floor_min: power.floor_min.min(floor_std),
            ..power
        };
        let follows = config.then == Then::Power;
        let power = follows.then(|| Power::new(then, seed, space.clone()));
        let mean = space.inside(space.theta_0.clone());
        let (candidates, told) = (Vec::new(), Vec::new());
        let (n_successes, noted) = (0, BTreeMap::new());
        let cover = Cover::new(if config.then == Then::Cover { &config.targets } else { &[] });
        Aim {
            config,
            seed,
            space,
            estimates,
            candidates,
            told,
            cover,
            n_successes,
            noted,
            mean,
            power,
        }
    }

    fn is_covering(&self) -> bool {
        self.config.then == Then::Cover && self.n_successes >= self.config.successes
    }

    /// PoWER, once it has taken over.
    fn successor(&self) -> Option<&Power> {
        self.power.as_ref().filter(|_| self.n_successes >= self.config.successes)
    }

    fn theta(&self, e: &DVector<f64>) -> DVector<f64> {
        self.space.inside(&self.space.theta_0 + e * self.config.std)
    }

    /// e ~ 𝒩(0, I), only forwards along directions that grow, and not at all along late ones.
    fn draw(&self, z: impl FnMut() -> f64) -> DVector<f64> {
        let mut e = self.noise(z);
        (0..e.len()).filter(|i| self.space.direction(*i).grows).for_each(|i| e[i] = e[i].abs());
        e
    }

    fn noise(&self, mut z: impl FnMut() -> f64) -> DVector<f64> {
        DVector::from_fn(self.space.dim(), |i, _| {
            let z = z();
            if self.space.direction(i).late { 0.0 } else { z }
        })
    }

    fn predicted(&self, theta: &DVector<f64>) -> Vec<Option<f64>> {
        let predicted = self.space.prediction.as_ref().filter(|_| self.config.predict);
        let values = predicted.map_or_else(Vec::new, |prediction| prediction.of(theta));
        let value = |j| values.get(j).copied().flatten().filter(|value: &f64| value.is_finite());
        (0..self.estimates.len()).map(value).collect()
    }

    fn add(&mut self, e: DVector<f64>) {
        let theta = self.theta(&e);
        // What is executed is in the box.
        let e = (&theta - &self.space.theta_0) / self.config.std;
        let predicted = self.predicted(&theta);
        let places = vec![Place::default(); self.estimates.len()];
        let (tried, succeeded, score, aimed, part) = (0.0, 0.0, 0.0, 0.0, 0);
        let (u, expected) = (0.0, Vec::new());
        let mut candidate =
            Candidate { e, predicted, places, tried, succeeded, score, aimed, u, expected, part };
        self.told.iter().for_each(|(e, success)| candidate.meet(e, *success));
        self.candidates.push(candidate);
    }

    /// Adds `n` neighbours of the best candidates.
    fn refine(&mut self, n: usize, std: f64, mut z: impl FnMut() -> f64) {
        for i in 0..n {
            let best = self.candidates[i % BEST.min(self.candidates.len())].e.clone();
            self.add(best + self.noise(&mut z) * std);
        }
        self.rank();
    }

    /// u(e) = Σⱼ ln P(measure j in its window) − ridge |e|²; with the trials nearby as counts and u as
    /// their prior, p = (a eᵘ + Σ kᵢ okᵢ)/(a + Σ kᵢ); the score is ln p + share·u. Where a part of the
    /// windows is aimed at, ln P(measure j in that part) comes to it.
    fn rank(&mut self) {
        let targets = &self.config.targets;
        let aims = self.aims(self.cover.next(&[]));
        for candidate in &mut self.candidates {
            candidate.u = -RIDGE * candidate.e.norm_squared();
            candidate.expected.clear();
            for (j, target) in targets.iter().enumerate() {
                let (predicted, place) = (candidate.predicted[j], &mut candidate.places[j]);
                let expected = self.estimates[j].at(&candidate.e, predicted, place);
                candidate.u += expected.log_within([target.min, target.max]);
                candidate.expected.push(expected);
            }
            candidate.score = candidate.score();
            candidate.aimed = candidate.score + candidate.within(&aims).max(f64::MIN);
            if self.cover.n_parts() > 1 {
                candidate.part = part_of(targets, candidate.expected.iter().map(|e| e.mean));
            }
        }
        // A stable sort: of equals the one that was drawn first.
        self.candidates.sort_by(|a, b| b.aimed.total_cmp(&a.aimed));
        self.thin();
    }

    /// The windows that are aimed at beyond those of the targets: those of a part, once parts are covered.
    fn aims(&self, part: usize) -> Vec<Option<[f64; 2]>> {
        match self.is_covering() {
            true => windows(&self.config.targets, part),
            false => vec![None; self.config.targets.len()],
        }
    }

    /// The part that is aimed at beside the pending rollouts.
    fn next_part(&self, pending: &[Proposal]) -> usize {
        let noted = pending.iter().filter_map(|proposal| self.noted.get(&proposal.rollout));
        self.cover.next(&noted.copied().collect::<Vec<_>>())
    }

    /// The candidate to execute beside the pending ones; `None` before there are candidates.
    fn next_candidate(&self, pending: &[Proposal]) -> Option<&Candidate> {
        if pending.is_empty() {
            return self.candidates.first();
        }
        let e_of = |proposal: &Proposal| (&proposal.theta - &self.space.theta_0) / self.config.std;
        let pending_e: Vec<DVector<f64>> = pending.iter().map(e_of).collect();
        let aims = self.aims(self.next_part(pending));
        let mut best: Option<(f64, &Candidate)> = None;
        for candidate in &self.candidates {
            if pending_e.iter().any(|e| (&candidate.e - e).amax() < SAME) {
                continue;
            }
            let aimed = candidate.score + candidate.within(&aims).max(f64::MIN);
            if best.is_none_or(|(highest, _)| aimed > highest) {
                best = Some((aimed, candidate));
            }
        }
        best.map(|(_, candidate)| candidate)
    }

    /// Keeps the best candidates, as many of every part.
    fn thin(&mut self) {
        let most = (self.config.candidates + ROUNDS * A_ROUND).div_ceil(self.cover.n_parts());
        let mut kept = vec![0; self.cover.n_parts()];
        self.candidates.retain(|candidate| {
            kept[candidate.part] += 1;
            kept[candidate.part] <= most
        });
    }

    /// Where a success is most likely, whatever is aimed at.
    fn best(&self) -> &Candidate {
        let better = self.candidates.iter().reduce(|a, b| if b.score > a.score { b } else { a });
        better.expect("there are candidates after the first trial")
    }
}

impl Search for Aim {
    fn ask(&self, rollout: u64, pending: &[Proposal]) -> Proposal {
        if let Some(power) = self.successor() {
            return power.ask(rollout, pending);
        }
        let theta = match self.next_candidate(pending) {
            _ if rollout == 1 => self.space.inside(self.space.theta_0.clone()),
            Some(candidate) => self.theta(&candidate.e),
            // Before the first trial is told.
            None => {
                let mut rng = stream(self.seed, rollout);
                self.theta(&self.draw(|| standard_normal(&mut rng)))
            }
        };
        Proposal { rollout, theta }
    }

    fn note(&mut self, proposal: &Proposal, pending: &[Proposal]) {
        if self.is_covering() {
            self.noted.insert(proposal.rollout, self.next_part(pending));
        }
        if let Some(power) = &mut self.power {
            power.note(proposal, pending);
        }
    }

    fn check_reward(&self, reward: f64) -> Result<(), RewardError> {
        self.power.as_ref().map_or_else(|| rewards::finite(reward), |p| p.check_reward(reward))
    }

    fn tell(&mut self, trial: &Trial) {
        let e = (&trial.theta - &self.space.theta_0) / self.config.std;
        let predicted = self.predicted(&trial.theta);
        for (j, estimate) in self.estimates.iter_mut().enumerate() {
            let measured = trial.measured.get(j).copied().flatten();
            if let Some(value) = measured.filter(|value| value.is_finite()) {
                estimate.observe(&e, predicted[j], value);
            }
        }
        if self.cover.n_parts() > 1 {
            let noted = self.noted.remove(&trial.rollout);
            let aimed = noted.or_else(|| self.is_covering().then(|| self.cover.next(&[])));
            let targets = &self.config.targets;
            let values = trial.measured.iter().copied().collect::<Option<Vec<f64>>>();
            let is_within = |values: &Vec<f64>| {
                targets.iter().zip(values).all(|(target, value)| target.contains(*value))
            };
            let lies = values.filter(is_within).map(|values| part_of(targets, values));
            self.cover.tell(aimed, lies, trial.success);
        }
        if self.is_covering() {
            // The next aim at the same part is another policy.
            self.candidates.retain(|candidate| candidate.e != e);
        }
        self.candidates.iter_mut().for_each(|candidate| candidate.meet(&e, trial.success));
        self.told.push((e, trial.success));
        self.n_successes += u64::from(trial.success);
        if let Some(power) = &mut self.power {
            power.tell(trial);
        }
        if self.successor().is_none() {
            self.look();
        }
        self.mean = match self.successor() {
            Some(power) => power.mean().clone(),
            None => self.theta(&self.best().e),
        };
    }

    fn mean(&self) -> &DVector<f64> {
        &self.mean
    }

    fn snapshot(&self, rollout: u64) -> SearchSnapshot {
        if let Some(power) = self.successor() {
            return power.snapshot(rollout);
        }
        let std = self.config.std * ROLLOUT_STD;
        let (mean, dim) = (self.mean.clone(), self.mean.len());
        SearchSnapshot { mean, std: DVector::repeat(dim, std), floor: std }
    }

    fn doubted(&self) -> Vec<usize> {
        let doubted = self.estimates.iter().map(Estimate::was_doubted);
        doubted.enumerate().filter(|(_, doubted)| *doubted).map(|(j, _)| j).collect()
    }
}

impl Aim {
    fn rounds(&self) -> usize {
        let predicts = self.config.predict && self.space.prediction.is_some();
        if predicts { 1 } else { ROUNDS_WITHOUT_PREDICTION }
    }

    /// Draws candidates and ranks them all, after a trial.
    fn look(&mut self) {
        let n_told = self.told.len() as u64;
        let mut rng = stream(self.seed, n_told + 1);
        let mut z = || standard_normal(&mut rng);
        let is_seldom = self.n_successes >= ENOUGH_SUCCESSES && !self.is_covering();
        if self.candidates.is_empty() {
            self.add(DVector::zeros(self.space.dim()));
            for _ in 0..self.config.candidates {
                let e = self.draw(&mut z);
                self.add(e);
            }
            self.rank();
            (0..ROUNDS).for_each(|_| self.refine(A_ROUND, ROUND_STD, &mut z));
        } else if !is_seldom || n_told.is_multiple_of(SELDOM) {
            self.rank();
            (0..self.rounds()).for_each(|_| self.refine(A_ROLLOUT, ROLLOUT_STD, &mut z));
        } else {
            self.rank();
        }
    }
}

#[cfg(test)]
mod tests;
