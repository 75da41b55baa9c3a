//! All optima of a known box within a large budget: many short searches by Eqs. (1) and (6), and a
//! memory of the optima found, so that none is climbed twice.
//!
//! A start is a place in the box, by turns the best of a few that fill the space evenly, or one
//! beside a known optimum at the distance at which that optimum has its nearest neighbour: optima
//! that are close together lead to others of their scale. Before and during a climb, trials between
//! its best place and the nearest known optimum tell whether a valley lies between (the hill-valley
//! test of Ursem, CEC 1999); without one, the hill is known and the climb ends. All of this happens
//! in fractions of the box, and by rank: only [`Search::modes`] compares rewards by size.
//!
//! The work of a trial does not grow with their number; the nearest known optimum is looked for
//! once per test.

use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::climb::{Climb, ClimbConfig};
use super::normals::{standard_normal, stream};
use super::power::by_reward;
use super::{Bounds, Mode, Search, SearchSnapshot, Space};
use crate::range::{Range, range};
use crate::trial::{Proposal, Trial};

/// Where between two places a valley is looked for, in this order.
const PROBES: [f64; 3] = [0.5, 0.25, 0.75];
/// A reward is lower than another one if it is so by this share: beyond rounding.
const ROUNDING: f64 = 1e-12;
/// Places nearer to each other than this many standard deviations a climb ends with are the same.
const RESOLUTION: f64 = 10.0;
/// The stream that shifts the even places; no rollout has this number.
const SHIFT_STREAM: u64 = 0;

/// Settings; lengths in widths of the box.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NichingConfig {
    /// Even places of which the best becomes a start.
    pub n_candidates: usize,
    /// Standard deviation of a climb's first trials, in distances to the nearest known optimum …
    pub relative_std: f64,
    /// … and at most.
    pub initial_std: f64,
    /// A valley to the nearest known optimum is looked for after so many trials of a climb.
    pub n_between_tests: u64,
    /// Optima with this share of the best reward are answers, and worth a look at their neighbours.
    pub answer_share: f64,
    /// θ₀ ± this is the box where none is known.
    pub half_width: f64,
    pub climb: ClimbConfig,
}

impl Default for NichingConfig {
    fn default() -> Self {
        NichingConfig {
            n_candidates: 4,
            relative_std: 0.3,
            initial_std: 0.1,
            n_between_tests: 30,
            answer_share: 0.9,
            half_width: 3.0,
            climb: ClimbConfig::default(),
        }
    }
}

impl NichingConfig {
    /// Settings and their ranges.
    pub fn ranges(&self) -> Vec<Range> {
        let own = vec![
            range("n_candidates", self.n_candidates as f64, 1.0, 1e4),
            range("relative_std", self.relative_std, 1e-3, 10.0),
            range("initial_std", self.initial_std, 1e-6, 10.0),
            range("n_between_tests", self.n_between_tests as f64, 1.0, 1e6),
            range("answer_share", self.answer_share, 0.0, 1.0),
            range("half_width", self.half_width, 1e-6, 1e6),
        ];
        [own, self.climb.ranges()].concat()
    }
}

/// The top of a hill; its θ in fractions of the box.
struct Optimum {
    trial: Trial,
    /// Standard deviation of the climb that found it, at its end.
    std: DVector<f64>,
    /// Starts beside it so far.
    n_looks: u64,
}

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
    mean: DVector<f64>,
    optima: Vec<Optimum>,
    stage: Stage,
    climb: Option<Climb>,
    n_starts: u64,
    n_even: u64,
}

impl Niching {
    pub fn new(config: NichingConfig, seed: u64, space: Space) -> Self {
        let Space { theta_0, bounds, .. } = space;
        let bounds = bounds.unwrap_or_else(|| Bounds {
            min: theta_0.add_scalar(-config.half_width),
            max: theta_0.add_scalar(config.half_width),
        });
        let (stage, climb) = (Stage::Even(Vec::new()), None);
        let (mean, optima) = (bounds.clamp(&theta_0), Vec::new());
        Niching { config, seed, bounds, mean, optima, stage, climb, n_starts: 0, n_even: 0 }
    }

    /// Place number `n_even` of the additive recurrence with the powers of the generalised golden
    /// ratio φ^(D+1) = φ + 1, shifted by the seed: it fills the box evenly, however many there are.
    fn even_place(&self) -> DVector<f64> {
        let dim = self.bounds.dim();
        let mut phi: f64 = 2.0;
        for _ in 0..30 {
            phi = (1.0 + phi).powf(1.0 / (dim as f64 + 1.0));
        }
        let mut rng = stream(self.seed, SHIFT_STREAM);
        DVector::from_fn(dim, |i, _| {
            let shift: f64 = rng.random();
            (shift + self.n_even as f64 * phi.powi(-(i as i32 + 1))).fract()
        })
    }

    /// A random direction, and a distance about that of the optimum's nearest neighbour.
    fn place_beside(&self, optimum: usize, rollout: u64) -> DVector<f64> {
        let mut rng = stream(self.seed, rollout);
        let from = &self.optima[optimum].trial.theta;
        let direction = from.map(|_| standard_normal(&mut rng)).normalize();
        let others = self.optima.iter().enumerate().filter(|(i, _)| *i != optimum);
        let nearest = others.map(|(_, other)| (&other.trial.theta - from).norm());
        let distance = nearest.fold(1.0, f64::min) * f64::powf(2.0, rng.random_range(-2.0..1.0));
        from + direction * distance
    }

    /// The optimum nearest to a place.
    fn nearest(&self, theta: &DVector<f64>) -> Option<usize> {
        let distance = |i: &usize| (&self.optima[*i].trial.theta - theta).norm_squared();
        (0..self.optima.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }

    /// Looks for a valley between `at` and what is known.
    fn test(&mut self, at: Trial) {
        match self.nearest(&at.theta) {
            None => self.is_new(at),
            Some(optimum) => {
                let distance = (&self.optima[optimum].trial.theta - &at.theta).norm();
                if distance <= RESOLUTION * self.config.climb.end_std {
                    self.is_known(at, optimum);
                } else {
                    self.stage = Stage::Test { at, optimum, probe: 0 };
                }
            }
        }
    }

    /// `at` is on a hill without a known top: start climbing it, go on, or there is its top. A climb
    /// that went far may have ended on a ridge: another one follows, as wide as it went.
    fn is_new(&mut self, at: Trial) {
        let Some(climb) = self.climb.take_if(|climb| climb.is_over()) else {
            return self.go_on(at);
        };
        let way = climb.way();
        if way > RESOLUTION * self.config.climb.end_std && at.reward >= self.answer_threshold() {
            let std = (0.5 * way).min(self.config.initial_std);
            self.climb = Some(Climb::new(self.config.climb, at, std));
            self.stage = Stage::Climb;
        } else {
            let std = climb.gaussian().marginal_std();
            self.optima.push(Optimum { trial: at, std, n_looks: 0 });
            self.next_start();
        }
    }

    /// `at` is on the hill of a known optimum. If it is above that one, the climb that found the
    /// optimum ended below the top, and this one is worth going on.
    fn is_known(&mut self, at: Trial, optimum: usize) {
        let known = &mut self.optima[optimum].trial;
        let above = known.reward < at.reward * (1.0 - ROUNDING);
        let over = self.climb.as_ref().is_some_and(Climb::is_over);
        if above && !over {
            return self.go_on(at);
        }
        if above {
            *known = at;
        }
        self.climb = None;
        self.next_start();
    }

    fn go_on(&mut self, at: Trial) {
        if self.climb.is_none() {
            let distance = |i: usize| (&self.optima[i].trial.theta - &at.theta).norm();
            let distance = self.nearest(&at.theta).map_or(f64::INFINITY, distance);
            let std = (self.config.relative_std * distance).min(self.config.initial_std);
            self.climb = Some(Climb::new(self.config.climb, at, std));
        }
        self.stage = Stage::Climb;
    }

    /// By turns an even start and one beside the optimum with the fewest of them.
    fn next_start(&mut self) {
        self.n_starts += 1;
        self.stage = Stage::Even(Vec::new());
        if self.n_starts.is_multiple_of(2) {
            return;
        }
        let threshold = self.answer_threshold();
        let worth = (0..self.optima.len()).filter(|i| self.optima[*i].trial.reward >= threshold);
        if let Some(optimum) = worth.min_by_key(|i| self.optima[*i].n_looks) {
            self.optima[optimum].n_looks += 1;
            self.stage = Stage::Beside(optimum);
        }
    }

    /// The reward from which on an optimum is an answer.
    fn answer_threshold(&self) -> f64 {
        let best = self.optima.iter().map(|optimum| optimum.trial.reward).fold(0.0, f64::max);
        self.config.answer_share * best
    }
}

impl Search for Niching {
    fn ask(&self, rollout: u64) -> Proposal {
        let place = match &self.stage {
            Stage::Even(_) => self.even_place(),
            Stage::Beside(optimum) => self.place_beside(*optimum, rollout),
            Stage::Test { at, optimum, probe } => {
                at.theta.lerp(&self.optima[*optimum].trial.theta, PROBES[*probe])
            }
            Stage::Climb => {
                let climb = self.climb.as_ref().expect("the stage is Climb only with one");
                climb.gaussian().sample(self.seed, rollout)
            }
        };
        let theta = self.bounds.at(place.map(|x| x.clamp(0.0, 1.0)).as_slice());
        Proposal { rollout, theta: self.bounds.clamp(&theta) }
    }

    fn tell(&mut self, trial: &Trial) {
        assert!(trial.reward.is_finite() && trial.reward >= 0.0, "reward {}", trial.reward);
        let trial = Trial { theta: self.bounds.fractions(&trial.theta), ..trial.clone() };
        match std::mem::replace(&mut self.stage, Stage::Climb) {
            Stage::Even(mut told) => {
                self.n_even += 1;
                told.push(trial);
                if told.len() < self.config.n_candidates {
                    self.stage = Stage::Even(told);
                } else {
                    told.sort_by(by_reward);
                    self.test(told.swap_remove(0));
                }
            }
            Stage::Beside(_) => self.test(trial),
            Stage::Test { at, optimum, probe } => {
                let lower = at.reward.min(self.optima[optimum].trial.reward);
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
                self.mean = self.bounds.at(climb.gaussian().mean.as_slice());
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

    /// The optima within `answer_share` of the best, with priors in proportion to their rewards.
    fn modes(&self) -> Vec<Mode> {
        let threshold = self.answer_threshold();
        let mut best: Vec<&Optimum> =
            self.optima.iter().filter(|optimum| optimum.trial.reward >= threshold).collect();
        best.sort_by(|a, b| by_reward(&a.trial, &b.trial));
        let width = &self.bounds.max - &self.bounds.min;
        let Some(first) = best.first() else {
            let SearchSnapshot { mean, std, .. } = self.snapshot(u64::MAX);
            let covariance = DMatrix::from_diagonal(&std.map(|s| s * s));
            return vec![Mode { prior: 1.0, mean, covariance }];
        };
        // Scaled by the best reward first: sums of rewards need not be finite.
        let scale = first.trial.reward.max(f64::MIN_POSITIVE);
        let share = |optimum: &Optimum| (optimum.trial.reward / scale).max(f64::MIN_POSITIVE);
        let sum: f64 = best.iter().map(|optimum| share(optimum)).sum();
        let mode = |optimum: &Optimum| {
            let std = optimum.std.component_mul(&width);
            let covariance = DMatrix::from_diagonal(&std.map(|s| s * s));
            let mean = self.bounds.clamp(&self.bounds.at(optimum.trial.theta.as_slice()));
            Mode { prior: share(optimum) / sum, mean, covariance }
        };
        best.into_iter().map(mode).collect()
    }
}
