//! The regions of high reward in a known box, and how many there are: fill, count, climb, bridge.
//!
//! The first trials fill the box evenly, and an estimator counts peaks among them: rather too many
//! than too few. Each peak then is a region, which climbs from its best trial; regions that stay low
//! are given up. Where two regions may be one, trials are spent between them: a surrogate of log r
//! shows the way on which the reward may stay highest, and the most doubtful place on it is tried.
//! Regions are one when a way is known on which the reward does not fall below a share of the best,
//! however curved: an optimum may be a ridge, which no Gaussian describes.
//!
//! With several rollouts in flight a bridge is tried once and the others climb: the region with the fewest climbs,
//! pending ones included, and away from the pending places, which the surrogate is told as if they had come out as it
//! expects (kriging believer). A trial told late belongs to the region it was meant for, whatever that was merged with.
//!
//! All of this happens in fractions of the box. The work of a trial is O(n²), and O(n) for each place of
//! the map while several regions are high. Sec. 4.2 counts by split and merge of a mixture instead
//! ([`super::algorithm1`]).

mod bridge;
mod clusters;
mod config;
mod dirichlet;
mod lanes;
mod map;
mod persistence;
mod spectral;
mod surrogate;

use std::cmp::Reverse;
use std::collections::BTreeMap;

use clusters::of_good_trials;
pub use config::{Estimator, RegionsConfig};
use map::Map;
use nalgebra::{DMatrix, DVector};
use persistence::peaks;
use surrogate::Belief;

use super::filling::Filling;
use super::normals::{standard_normal, stream};
use super::{Bounds, Mode, RewardError, Search, SearchSnapshot, Space, rewards};
use crate::trial::{Proposal, Trial};

/// Rewards below this share of the best are all the same to the surrogate.
const LEAST_SHARE: f64 = 0.02;
/// A step of a climb is the most promising of so many, drawn with these shares of `climb_std`.
const N_DRAWS: usize = 40;
const CLIMB_SHARES: [f64; 5] = [1.0, 0.5, 0.25, 0.12, 0.06];
/// Standard deviations added to the expected reward of a step.
const CLIMB_OPTIMISM: f64 = 0.5;

/// Places nearer to each other than this, in widths of the box, are the same but for rounding.
const SAME: f64 = 1e-9;

/// A connected set of good trials.
#[derive(Clone, Debug)]
struct Region {
    /// The trials.
    members: Vec<usize>,
    /// The one with the highest reward.
    best: usize,
    n_climbs: u32,
}

/// What the next trial is for.
#[derive(Clone, Debug)]
enum Step {
    Fill,
    /// A better trial of this region.
    Climb(usize),
    /// A point between two regions.
    Bridge {
        regions: [usize; 2],
        point: DVector<f64>,
    },
}

/// What a rollout in flight is for; of its regions, the best trials at that time, as regions may merge.
enum Purpose {
    Fill,
    Climb(usize),
    Bridge([usize; 2]),
}

pub struct Regions {
    config: RegionsConfig,
    seed: u64,
    bounds: Bounds,
    filling: Filling,
    /// In fractions of the box.
    points: Vec<DVector<f64>>,
    rewards: Vec<f64>,
    /// `None` until the box is filled.
    map: Option<Map>,
    regions: Vec<Region>,
    n_bridges: usize,
    step: Step,
    noted: BTreeMap<u64, Purpose>,
    mean: DVector<f64>,
}

impl Regions {
    pub fn new(config: RegionsConfig, seed: u64, space: Space) -> Self {
        let Space { theta_0, bounds, .. } = space;
        let bounds = bounds.unwrap_or_else(|| Bounds::around(&theta_0, config.half_width));
        Regions {
            config,
            seed,
            filling: Filling::new(bounds.dim(), seed),
            points: Vec::new(),
            rewards: Vec::new(),
            map: None,
            regions: Vec::new(),
            n_bridges: 0,
            step: Step::Fill,
            noted: BTreeMap::new(),
            mean: bounds.clamp(&theta_0),
            bounds,
        }
    }

    fn best_reward(&self) -> f64 {
        self.rewards.iter().copied().fold(0.0, f64::max)
    }

    /// Whether the best of `region` has this share of the best reward.
    fn reaches(&self, region: &Region, share: f64) -> bool {
        self.rewards[region.best] >= share * self.best_reward()
    }

    /// log(r / best): what the surrogate is about.
    fn values(&self) -> Vec<f64> {
        let best = self.best_reward().max(f64::MIN_POSITIVE);
        self.rewards.iter().map(|reward| (reward / best).max(LEAST_SHARE).ln()).collect()
    }

    /// The box is filled: the first regions.
    fn count(&mut self) {
        let (points, rewards) = (&self.points, &self.rewards);
        let labels = match self.config.estimator {
            Estimator::Persistence => peaks(points, rewards, self.config.persistence),
            Estimator::Dirichlet => of_good_trials(points, rewards, dirichlet::groups),
            Estimator::Spectral => {
                of_good_trials(points, rewards, |good, _| spectral::groups(good))
            }
        };
        let mut names = labels.clone();
        names.sort_unstable();
        names.dedup();
        for name in names {
            let members = (0..labels.len()).filter(|&trial| labels[trial] == name).collect();
            self.regions.push(self.region(members, 0));
        }
        self.map = Some(Map::new(&self.points, &self.values()));
    }

    fn region(&self, members: Vec<usize>, n_climbs: u32) -> Region {
        let highest = |a: &usize, b: &usize| self.rewards[*a].total_cmp(&self.rewards[*b]);
        let best = members.iter().copied().rev().max_by(highest).expect("regions have members");
        Region { members, best, n_climbs }
    }

    /// What was just told belongs to `region`.
    fn join(&mut self, region: usize, n_climbs: u32) {
        let Region { mut members, n_climbs: before, .. } = self.regions[region].clone();
        members.push(self.rewards.len() - 1);
        self.regions[region] = self.region(members, before + n_climbs);
    }

    fn merge(&mut self, a: usize, b: usize) {
        let other = self.regions.remove(b);
        let members = [self.regions[a].members.as_slice(), &other.members].concat();
        self.regions[a] = self.region(members, self.regions[a].n_climbs.max(other.n_climbs));
    }

    /// The nearest of some regions to the trial just told; the first of equals.
    fn nearest(&self, regions: impl IntoIterator<Item = usize>) -> usize {
        let point = self.points.last().expect("a trial was told");
        let distance = |region: &usize| {
            let members = self.regions[*region].members.iter();
            members.map(|&t| self.points[t].metric_distance(point)).fold(f64::INFINITY, f64::min)
        };
        let nearest = regions.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest.expect("there are regions")
    }

    /// The region of an earlier trial.
    fn region_of(&self, trial: usize) -> usize {
        let region = self.regions.iter().position(|region| region.members.contains(&trial));
        region.expect("every trial belongs to a region")
    }

    /// Merges what is known to be connected, and decides what the next trial is for.
    fn plan(&mut self) -> Step {
        self.bridge().unwrap_or_else(|| Step::Climb(self.next_climb(&[])))
    }

    /// The promising region with the fewest climbs, those that are pending included.
    fn next_climb(&self, pending: &[Proposal]) -> usize {
        let mut n_climbs: Vec<u32> = self.regions.iter().map(|region| region.n_climbs).collect();
        for proposal in pending {
            if let Some(Purpose::Climb(trial)) = self.noted.get(&proposal.rollout) {
                n_climbs[self.region_of(*trial)] += 1;
            }
        }
        // The longer a region has climbed, the higher it must be.
        let promising = |region: &usize| {
            let region = &self.regions[*region];
            let patience = f64::from(region.n_climbs) / f64::from(self.config.patience);
            self.reaches(region, self.config.answer_share * patience.min(1.0))
        };
        let next = (0..self.regions.len()).filter(promising).min_by_key(|r| n_climbs[*r]);
        next.expect("the region of the best trial is promising")
    }

    /// What a further rollout is for beside the pending ones.
    fn step(&self, pending: &[Proposal]) -> Step {
        let is_pending = |point: &DVector<f64>| {
            let places = pending.iter().map(|proposal| self.bounds.fractions(&proposal.theta));
            places.into_iter().any(|place| place.metric_distance(point) < SAME)
        };
        match &self.step {
            Step::Climb(_) if !pending.is_empty() => Step::Climb(self.next_climb(pending)),
            Step::Bridge { point, .. } if is_pending(point) => {
                Step::Climb(self.next_climb(pending))
            }
            step => step.clone(),
        }
    }

    fn purpose(&self, pending: &[Proposal]) -> Purpose {
        let best = |region: usize| self.regions[region].best;
        match self.step(pending) {
            Step::Fill => Purpose::Fill,
            Step::Climb(region) => Purpose::Climb(best(region)),
            Step::Bridge { regions, .. } => Purpose::Bridge(regions.map(best)),
        }
    }

    /// The most promising of some random steps from the best trial of `region`.
    fn climb(&self, region: usize, rollout: u64, pending: &[Proposal]) -> DVector<f64> {
        let map = self.map.as_ref().expect("climbs begin when the box is filled");
        let best = &self.points[self.regions[region].best];
        let mut rng = stream(self.seed, rollout);
        let draw = |draw: usize| {
            let std = self.config.climb_std * CLIMB_SHARES[draw % CLIMB_SHARES.len()];
            best.map(|x| (x + std * standard_normal(&mut rng)).clamp(0.0, 1.0))
        };
        let draws: Vec<DVector<f64>> = (0..N_DRAWS).map(draw).collect();
        let score = |belief: &Belief| belief.mean + CLIMB_OPTIMISM * belief.std;
        let pending: Vec<DVector<f64>> =
            pending.iter().map(|proposal| self.bounds.fractions(&proposal.theta)).collect();
        let beliefs = map.beliefs_beside(&pending, &self.values(), &draws);
        let believed = beliefs.into_iter().zip(draws);
        let highest = believed.max_by(|a, b| score(&a.0).total_cmp(&score(&b.0)));
        highest.expect("there are draws").1
    }

    /// The regions that have `answer_share` of the best reward, each with its good trials; those with
    /// most of them first.
    fn answers(&self) -> Vec<(&Region, Vec<usize>)> {
        let least = self.config.connected * self.best_reward();
        let is_good = |trial: &usize| self.rewards[*trial] >= least;
        let good = |region: &Region| region.members.iter().copied().filter(is_good).collect();
        let high = self.regions.iter().filter(|r| self.reaches(r, self.config.answer_share));
        let mut answers: Vec<(&Region, Vec<usize>)> = high.map(|r| (r, good(r))).collect();
        answers.sort_by_key(|(_, good)| Reverse(good.len()));
        answers
    }

    /// Mean: the best trial. Covariance: of the good trials about it, weighted by reward. Prior: its
    /// share of the `n_good` good trials of all answers.
    fn mode(&self, region: &Region, good: &[usize], n_good: usize) -> Mode {
        let width = &self.bounds.max - &self.bounds.min;
        let resolution = self.config.climb_std * CLIMB_SHARES[CLIMB_SHARES.len() - 1];
        let mut covariance = DMatrix::from_diagonal(&width.map(|w| (resolution * w).powi(2)));
        let sum: f64 = good.iter().map(|&t| self.rewards[t] / self.rewards[region.best]).sum();
        for &trial in good {
            let step = (&self.points[trial] - &self.points[region.best]).component_mul(&width);
            let weight = self.rewards[trial] / self.rewards[region.best] / sum;
            covariance += &step * step.transpose() * weight;
        }
        let mean = self.theta(&self.points[region.best]);
        Mode { prior: good.len() as f64 / n_good as f64, mean, covariance }
    }

    fn theta(&self, point: &DVector<f64>) -> DVector<f64> {
        self.bounds.clamp(&self.bounds.at(point.as_slice()))
    }
}

impl Search for Regions {
    fn ask(&self, rollout: u64, pending: &[Proposal]) -> Proposal {
        let point = match self.step(pending) {
            Step::Fill => self.filling.place(rollout),
            Step::Climb(region) => self.climb(region, rollout, pending),
            Step::Bridge { point, .. } => point,
        };
        Proposal { rollout, theta: self.theta(&point) }
    }

    fn note(&mut self, proposal: &Proposal, pending: &[Proposal]) {
        self.noted.insert(proposal.rollout, self.purpose(pending));
    }

    fn check_reward(&self, reward: f64) -> Result<(), RewardError> {
        rewards::not_negative(reward, "regions compares rewards by their share of the best")
    }

    /// The box goes on being filled as long as nothing is rewarded.
    fn tell(&mut self, trial: &Trial) {
        self.check_reward(trial.reward).expect("the reward was checked");
        let noted = self.noted.remove(&trial.rollout);
        let purpose = noted.unwrap_or_else(|| self.purpose(&[]));
        let point = self.bounds.fractions(&trial.theta);
        self.points.push(point.clone());
        self.rewards.push(trial.reward);
        let values = self.values();
        if let Some(map) = &mut self.map {
            map.push(point, &values);
        }
        if let Step::Fill = self.step {
            if self.points.len() < self.config.n_fill || self.best_reward() <= 0.0 {
                return;
            }
            self.count();
        } else {
            match purpose {
                Purpose::Fill => self.join(self.nearest(0..self.regions.len()), 0),
                Purpose::Climb(trial) => self.join(self.region_of(trial), 1),
                Purpose::Bridge(trials) => {
                    self.n_bridges += 1;
                    self.join(self.nearest(trials.map(|trial| self.region_of(trial))), 0);
                }
            }
        }
        self.step = self.plan();
        if let Some((region, _)) = self.answers().first() {
            self.mean = self.theta(&self.points[region.best]);
        }
    }

    fn mean(&self) -> &DVector<f64> {
        &self.mean
    }

    fn snapshot(&self, _rollout: u64) -> SearchSnapshot {
        let width = &self.bounds.max - &self.bounds.min;
        let std = match self.step {
            // Of the uniform distribution.
            Step::Fill => width / 12_f64.sqrt(),
            _ => width * self.config.climb_std,
        };
        SearchSnapshot { mean: self.mean.clone(), std, floor: 0.0 }
    }

    /// The regions that have `answer_share` of the best reward.
    fn modes(&self) -> Vec<Mode> {
        let answers = self.answers();
        if answers.is_empty() {
            let SearchSnapshot { mean, std, .. } = self.snapshot(0);
            let covariance = DMatrix::from_diagonal(&std.component_mul(&std));
            return vec![Mode { prior: 1.0, mean, covariance }];
        }
        let n_good = answers.iter().map(|(_, good)| good.len()).sum();
        answers.iter().map(|(region, good)| self.mode(region, good, n_good)).collect()
    }
}

#[cfg(test)]
mod tests;
