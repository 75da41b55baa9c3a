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
//! With several rollouts in flight all probes of a test are tried at once, a climb goes on while it is tested, and arms
//! that have nothing else to do try even places for the next start, none twice. A pending proposal counts as
//! visited. What is told late counts where it still can: even places always, a draw for the climb it was drawn
//! in; a place beside an optimum that is not waited for any more is a place for the next start.
//!
//! The work of a trial does not grow with their number; the nearest known optimum is looked for
//! once per test.

mod climb;
mod config;
mod optima;
mod smooth;
mod steps;

use std::collections::BTreeMap;

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

/// What the search waits for.
enum Stage {
    /// Even places.
    Even,
    /// A place beside this optimum.
    Beside(usize),
    /// Places between `at` and this optimum, those of [`PROBES`] that are not told.
    Test {
        at: Trial,
        optimum: usize,
        told: [bool; PROBES.len()],
    },
    Climb,
}

/// What a rollout is for; a place beside or a probe in the stage of this number, a draw in the climb of this one.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Purpose {
    Even,
    Beside { stage: u64 },
    Probe { stage: u64, probe: usize },
    Climb { climb: u64 },
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
    /// Even places told for the next start.
    even: Vec<Trial>,
    noted: BTreeMap<u64, Purpose>,
    n_stages: u64,
    n_climbs: u64,
    n_starts: u64,
    /// Even places that were asked for.
    n_even: u64,
}

impl Niching {
    pub fn new(config: NichingConfig, seed: u64, space: Space) -> Self {
        let Space { theta_0, bounds, .. } = space;
        let bounds = bounds.unwrap_or_else(|| Bounds::around(&theta_0, config.half_width));
        let filling = Filling::new(bounds.dim(), seed);
        let (stage, climb, even, noted) = (Stage::Even, None, Vec::new(), BTreeMap::new());
        let optima = Optima { all: Vec::new(), answer_share: config.answer_share };
        let mean = bounds.clamp(&theta_0);
        let (n_stages, n_climbs, n_starts, n_even) = (0, 0, 0, 0);
        let theta_0 = mean.clone();
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
            even,
            noted,
            n_stages,
            n_climbs,
            n_starts,
            n_even,
        }
    }

    fn enter(&mut self, stage: Stage) {
        self.stage = stage;
        self.n_stages += 1;
    }

    fn set_out(&mut self, climb: Climb) {
        self.climb = Some(climb);
        self.n_climbs += 1;
    }

    /// What a further rollout is for beside the pending ones.
    fn purpose(&self, pending: &[Proposal]) -> Purpose {
        let noted: Vec<&Purpose> =
            pending.iter().filter_map(|proposal| self.noted.get(&proposal.rollout)).collect();
        let stage = self.n_stages;
        let (beside, draw) = (Purpose::Beside { stage }, Purpose::Climb { climb: self.n_climbs });
        match &self.stage {
            Stage::Beside(_) if !noted.contains(&&beside) => beside,
            Stage::Climb => draw,
            Stage::Test { told, .. } => {
                let probes = (0..PROBES.len()).filter(|probe| !told[*probe]);
                let mut probes = probes.map(|probe| Purpose::Probe { stage, probe });
                let climbs = self.climb.as_ref().is_some_and(|climb| !climb.is_over());
                let otherwise = if climbs { draw } else { Purpose::Even };
                probes.find(|probe| !noted.contains(&probe)).unwrap_or(otherwise)
            }
            _ => Purpose::Even,
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
                    self.enter(Stage::Test { at, optimum, told: Default::default() });
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
            self.set_out(Climb::new(self.config.climb, at, std));
            self.enter(Stage::Climb);
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
            self.set_out(Climb::new(self.config.climb, at, std));
        }
        self.enter(Stage::Climb);
    }

    /// By turns an even start and one beside the optimum with the fewest of them.
    fn next_start(&mut self) {
        self.n_starts += 1;
        self.enter(Stage::Even);
        if self.config.start_std > 0.0 || self.n_starts.is_multiple_of(2) {
            return;
        }
        let answers = self.optima.answers();
        if let Some(optimum) = answers.into_iter().min_by_key(|i| self.optima.all[*i].n_looks) {
            self.optima.all[optimum].n_looks += 1;
            self.enter(Stage::Beside(optimum));
        }
    }

    /// A start, once there are enough even places to choose one from.
    fn choose_start(&mut self) {
        if self.even.len() < self.config.n_candidates {
            return;
        }
        let mut even: Vec<Trial> = self.even.drain(..self.config.n_candidates).collect();
        even.sort_by(by_reward);
        let best = even.swap_remove(0);
        // A start amidst the optima lies too low for a valley to show.
        if self.config.start_std > 0.0 { self.go_on(best) } else { self.test(best) }
    }

    /// A probe of the present test was told.
    fn probed(&mut self, probe: usize, reward: f64) {
        let Stage::Test { at, optimum, told } = &mut self.stage else { return };
        told[probe] = true;
        let (lower, all) =
            (at.reward.min(self.optima.all[*optimum].trial.reward), told.iter().all(|told| *told));
        let (at, optimum) = (at.clone(), *optimum);
        if reward < lower * (1.0 - ROUNDING) {
            self.is_new(at);
        } else if all {
            self.is_known(at, optimum);
        }
    }

    /// A trial of the present climb was told.
    fn climbed(&mut self, trial: Trial) {
        let Some(climb) = self.climb.as_mut() else { return };
        climb.tell(trial);
        self.mean = self.bounds.clamp(&self.bounds.at(climb.gaussian().mean.as_slice()));
        let is_due = climb.is_over() || climb.n_told().is_multiple_of(self.config.n_between_tests);
        if is_due && matches!(self.stage, Stage::Climb) {
            let best = climb.best().clone();
            self.test(best);
        }
    }
}

impl Search for Niching {
    fn ask(&self, rollout: u64, pending: &[Proposal]) -> Proposal {
        let place = match (self.purpose(pending), &self.stage) {
            (Purpose::Beside { .. }, Stage::Beside(optimum)) => {
                self.place_beside(*optimum, rollout)
            }
            (Purpose::Probe { probe, .. }, Stage::Test { at, optimum, .. }) => {
                at.theta.lerp(&self.optima.all[*optimum].trial.theta, PROBES[probe])
            }
            (Purpose::Climb { .. }, _) => {
                let climb = self.climb.as_ref().expect("draws are asked for in a climb only");
                let places = pending.iter().map(|p| self.bounds.fractions(&p.theta));
                climb.place(self.seed, rollout, &places.collect::<Vec<_>>())
            }
            _ => self.start(rollout),
        };
        let theta = self.bounds.at(place.map(|x| x.clamp(0.0, 1.0)).as_slice());
        Proposal { rollout, theta: self.bounds.clamp(&theta) }
    }

    fn note(&mut self, proposal: &Proposal, pending: &[Proposal]) {
        let purpose = self.purpose(pending);
        self.n_even += u64::from(purpose == Purpose::Even);
        self.noted.insert(proposal.rollout, purpose);
    }

    fn check_reward(&self, reward: f64) -> Result<(), RewardError> {
        rewards::not_negative(
            reward,
            "niching answers with the optima within a share of the best reward",
        )
    }

    fn tell(&mut self, trial: &Trial) {
        self.check_reward(trial.reward).expect("the reward was checked");
        if !self.noted.contains_key(&trial.rollout) {
            self.note(&Proposal { rollout: trial.rollout, theta: trial.theta.clone() }, &[]);
        }
        let purpose = self.noted.remove(&trial.rollout).expect("it was noted");
        let trial = Trial { theta: self.bounds.fractions(&trial.theta), ..trial.clone() };
        match purpose {
            Purpose::Climb { climb } if climb == self.n_climbs => self.climbed(trial),
            Purpose::Probe { stage, probe } if stage == self.n_stages => {
                self.probed(probe, trial.reward);
            }
            Purpose::Beside { stage } if stage == self.n_stages => self.test(trial),
            Purpose::Even | Purpose::Beside { .. } => self.even.push(trial),
            // Too late for its climb or test.
            Purpose::Climb { .. } | Purpose::Probe { .. } => {}
        }
        if matches!(self.stage, Stage::Even) {
            self.choose_start();
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
