//! All optima of a known box within a large budget: many short searches by Eqs. (1) and (6), and a
//! memory of the optima found, so that none is climbed twice.
//!
//! A start is a place in the box, by turns the best of a few that fill the space evenly, or one
//! beside a known optimum at the distance at which that optimum has its nearest neighbour: optima
//! that are close together lead to others of their scale. Before and during a climb, trials between
//! its best place and the nearest known optimum tell whether a valley lies between (the hill-valley
//! test of Ursem, CEC 1999); without one, the hill is known and the climb ends. All of this happens
//! in fractions of the box, and by rank: only [`Search::modes`] compares rewards by size, and the
//! surrogate of a climb, for those who have hundreds of trials and not thousands.
//!
//! The work of a trial does not grow with their number; the nearest known optimum is looked for
//! once per test.

mod climb;
mod config;
mod optima;
mod smooth;
mod steps;

use climb::Climb;
pub use config::NichingConfig;
use nalgebra::{DMatrix, DVector};
use optima::{Optima, Optimum};
use rand::RngExt;

use super::filling::Filling;
use super::normals::{standard_normal, stream};
use super::power::by_reward;
use super::{Bounds, Mode, RewardError, Search, SearchSnapshot, Space, rewards};
use crate::trial::{Proposal, Trial};

/// Where between two places a valley is looked for, in this order.
const PROBES: [f64; 3] = [0.5, 0.25, 0.75];
/// A reward is lower than another one if it is so by this share: beyond rounding.
const ROUNDING: f64 = 1e-12;
/// Places nearer to each other than this many standard deviations a climb ends with are the same.
const RESOLUTION: f64 = 10.0;

/// What the next trial is for.
enum Stage {
    /// An even place, and those told so far.
    Even(Vec<Trial>),
    /// A place beside this optimum.
    Beside(usize),
    /// A place between `at` and this optimum, the `probe`-th of [`PROBES`].
    Test {
        at: Trial,
        optimum: usize,
        probe: usize,
    },
    Climb,
}

pub struct Niching {
    config: NichingConfig,
    seed: u64,
    bounds: Bounds,
    filling: Filling,
    theta_0: DVector<f64>,
    mean: DVector<f64>,
    optima: Optima,
    stage: Stage,
    climb: Option<Climb>,
    n_starts: u64,
    n_even: u64,
}

impl Niching {
    pub fn new(config: NichingConfig, seed: u64, space: Space) -> Self {
        let Space { theta_0, bounds, .. } = space;
        let bounds = bounds.unwrap_or_else(|| Bounds::around(&theta_0, config.half_width));
        let filling = Filling::new(bounds.dim(), seed);
        let (stage, climb) = (Stage::Even(Vec::new()), None);
        let optima = Optima { all: Vec::new(), answer_share: config.answer_share };
        let mean = bounds.clamp(&theta_0);
        let (n_starts, n_even, theta_0) = (0, 0, mean.clone());
        Niching {
            config,
            seed,
            bounds,
            filling,
            theta_0,
            mean,
            optima,
            stage,
            climb,
            n_starts,
            n_even,
        }
    }

    /// By turns a random direction and a distance about that of the optimum's nearest neighbour,
    /// and the way from one answer to another (as in differential evolution): what repeats is found.
    fn place_beside(&self, optimum: usize, rollout: u64) -> DVector<f64> {
        let mut rng = stream(self.seed, rollout);
        let from = &self.optima.all[optimum].trial.theta;
        let answers = self.optima.answers();
        if self.optima.all[optimum].n_looks.is_multiple_of(2) && answers.len() > 2 {
            let mut any =
                || &self.optima.all[answers[rng.random_range(0..answers.len())]].trial.theta;
            let inside = |place: &DVector<f64>| place.iter().all(|x| (0.0..=1.0).contains(x));
            let place = (0..20).map(|_| from + any() - any()).find(inside);
            return place.unwrap_or_else(|| from.clone());
        }
        let direction = from.map(|_| standard_normal(&mut rng)).normalize();
        let distance = self.optima.spacing(optimum) * f64::powf(2.0, rng.random_range(-2.0..1.0));
        from + direction * distance
    }

    /// Looks for a valley between `at` and what is known.
    fn test(&mut self, at: Trial) {
        match self.optima.nearest(&at.theta) {
            None => self.is_new(at),
            Some(optimum) => {
                if self.optima.all[optimum].distance(&at.theta)
                    <= RESOLUTION * self.config.climb.end_std
                {
                    self.is_known(at, optimum);
                } else {
                    self.stage = Stage::Test { at, optimum, probe: 0 };
                }
            }
        }
    }

    /// The start of a climb that is not beside an optimum.
    fn start(&self, rollout: u64) -> DVector<f64> {
        if self.config.start_std == 0.0 {
            return self.filling.place(self.n_even);
        }
        let start = self.bounds.fractions(&self.theta_0);
        let std = if self.n_even == 0 { 0.0 } else { self.config.start_std };
        let mut rng = stream(self.seed, rollout);
        start.map(|x| x + std * standard_normal(&mut rng))
    }

    /// `at` is on a hill without a known top: start climbing it, go on, or there is its top. A climb
    /// that went far may have ended on a ridge: another one follows, as wide as it went.
    fn is_new(&mut self, at: Trial) {
        let Some(climb) = self.climb.take_if(|climb| climb.is_over()) else {
            return self.go_on(at);
        };
        let way = climb.way();
        let is_far = way > RESOLUTION * self.config.climb.end_std && !climb.has_succeeded();
        if is_far && at.reward >= self.optima.threshold() {
            let std = (0.5 * way).min(self.config.initial_std);
            self.climb = Some(Climb::new(self.config.climb, at, std));
            self.stage = Stage::Climb;
        } else {
            let std = climb.gaussian().marginal_std();
            self.optima.all.push(Optimum { trial: at, std, n_looks: 0 });
            self.next_start();
        }
    }

    /// `at` is on the hill of a known optimum. If it is above that one, the climb that found the
    /// optimum ended below the top: this one is worth going on, and at its end takes the place.
    fn is_known(&mut self, at: Trial, optimum: usize) {
        let above = self.optima.all[optimum].trial.reward < at.reward * (1.0 - ROUNDING);
        let over = self.climb.as_ref().is_some_and(Climb::is_over);
        if above && over {
            self.optima.all.swap_remove(optimum);
            // It may be on the hill of another one, too.
            return self.test(at);
        }
        if above {
            return self.go_on(at);
        }
        self.climb = None;
        self.next_start();
    }

    fn go_on(&mut self, at: Trial) {
        if self.climb.is_none() {
            let distance = |i: usize| self.optima.all[i].distance(&at.theta);
            let distance = self.optima.nearest(&at.theta).map_or(f64::INFINITY, distance);
            let std = (self.config.relative_std * distance).min(self.config.initial_std);
            self.climb = Some(Climb::new(self.config.climb, at, std));
        }
        self.stage = Stage::Climb;
    }

    /// By turns an even start and one beside the optimum with the fewest of them.
    fn next_start(&mut self) {
        self.n_starts += 1;
        self.stage = Stage::Even(Vec::new());
        if self.config.start_std > 0.0 || self.n_starts.is_multiple_of(2) {
            return;
        }
        let answers = self.optima.answers();
        if let Some(optimum) = answers.into_iter().min_by_key(|i| self.optima.all[*i].n_looks) {
            self.optima.all[optimum].n_looks += 1;
            self.stage = Stage::Beside(optimum);
        }
    }
}

impl Search for Niching {
    fn ask(&self, rollout: u64, _pending: &[Proposal]) -> Proposal {
        let place = match &self.stage {
            Stage::Even(_) => self.start(rollout),
            Stage::Beside(optimum) => self.place_beside(*optimum, rollout),
            Stage::Test { at, optimum, probe } => {
                at.theta.lerp(&self.optima.all[*optimum].trial.theta, PROBES[*probe])
            }
            Stage::Climb => {
                let climb = self.climb.as_ref().expect("the stage is Climb only with one");
                climb.place(self.seed, rollout)
            }
        };
        let theta = self.bounds.at(place.map(|x| x.clamp(0.0, 1.0)).as_slice());
        Proposal { rollout, theta: self.bounds.clamp(&theta) }
    }

    fn check_reward(&self, reward: f64) -> Result<(), RewardError> {
        rewards::not_negative(
            reward,
            "niching answers with the optima within a share of the best reward",
        )
    }

    fn tell(&mut self, trial: &Trial) {
        self.check_reward(trial.reward).expect("the reward was checked");
        let trial = Trial { theta: self.bounds.fractions(&trial.theta), ..trial.clone() };
        match std::mem::replace(&mut self.stage, Stage::Climb) {
            Stage::Even(mut told) => {
                self.n_even += 1;
                told.push(trial);
                if told.len() < self.config.n_candidates {
                    self.stage = Stage::Even(told);
                    return;
                }
                told.sort_by(by_reward);
                let best = told.swap_remove(0);
                // A start amidst the optima lies too low for a valley to show.
                if self.config.start_std > 0.0 { self.go_on(best) } else { self.test(best) }
            }
            Stage::Beside(_) => self.test(trial),
            Stage::Test { at, optimum, probe } => {
                let lower = at.reward.min(self.optima.all[optimum].trial.reward);
                if trial.reward < lower * (1.0 - ROUNDING) {
                    self.is_new(at);
                } else if probe + 1 < PROBES.len() {
                    self.stage = Stage::Test { at, optimum, probe: probe + 1 };
                } else {
                    self.is_known(at, optimum);
                }
            }
            Stage::Climb => {
                let climb = self.climb.as_mut().expect("the stage is Climb only with one");
                climb.tell(trial);
                self.mean = self.bounds.clamp(&self.bounds.at(climb.gaussian().mean.as_slice()));
                if climb.is_over() || climb.n_told().is_multiple_of(self.config.n_between_tests) {
                    let best = climb.best().clone();
                    self.test(best);
                }
            }
        }
    }

    /// Where the present climb is, or the last one was.
    fn mean(&self) -> &DVector<f64> {
        &self.mean
    }

    fn snapshot(&self, _rollout: u64) -> SearchSnapshot {
        let width = &self.bounds.max - &self.bounds.min;
        let std = match &self.climb {
            Some(climb) => climb.gaussian().marginal_std().component_mul(&width),
            None => width / f64::sqrt(12.0),
        };
        SearchSnapshot { mean: self.mean.clone(), floor: std.min(), std }
    }

    /// The optima within `answer_share` of the best.
    fn modes(&self) -> Vec<Mode> {
        if !self.optima.all.is_empty() {
            return self.optima.modes(&self.bounds);
        }
        let SearchSnapshot { mean, std, .. } = self.snapshot(u64::MAX);
        let covariance = DMatrix::from_diagonal(&std.map(|s| s * s));
        vec![Mode { prior: 1.0, mean, covariance }]
    }
}

#[cfg(test)]
mod tests;
