//! The worlds of Sec. 4.2 that methods are compared on: space, reward, score and what is reported of a run.

use nalgebra::DVector;
use physics::landscape;
use physics::skittles::TARGETS;
use search::trial::Trial;
use search::{Bounds, Search, Space};

use super::Sample;
use super::landscape::{N_TRIALS, START, point};
use super::runs::{self, best_reward, late_reward};
use super::skittles::{self, Regions};

/// Names of the skittles' tasks, in the order of [`TARGETS`].
const SKITTLES: [&str; 3] = ["skittles A", "skittles B", "skittles C"];

/// A world, and what is known of it beforehand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// From the paper's start, without a box.
    Landscape,
    LandscapeBox,
    /// With the skittle at this one of [`TARGETS`], in the box of throws.
    Skittles(usize),
}

pub const TASKS: [Task; 5] =
    [Task::Landscape, Task::LandscapeBox, Task::Skittles(0), Task::Skittles(1), Task::Skittles(2)];

impl Task {
    pub fn name(self) -> &'static str {
        match self {
            Task::Landscape => "landscape",
            Task::LandscapeBox => "landscape in its box",
            Task::Skittles(index) => SKITTLES[index],
        }
    }

    /// Searches that are told a box begin in its middle.
    pub fn space(self) -> Space {
        let bounds = match self {
            Task::Landscape => return Space::white(DVector::from_column_slice(&START)),
            Task::LandscapeBox => {
                Bounds::new(2, &landscape::BOX.0, &landscape::BOX.1).expect("the box is not empty")
            }
            Task::Skittles(_) => skittles::bounds(),
        };
        Space { bounds: Some(bounds.clone()), ..Space::white(bounds.at(&[0.5, 0.5])) }
    }

    /// What a trial earns.
    pub fn reward(self, theta: &DVector<f64>) -> f64 {
        match self {
            Task::Skittles(index) => skittles::reward(TARGETS[index], theta),
            _ => landscape::height(&point(theta)),
        }
    }

    /// The search's trials.
    pub fn run(self, search: &mut dyn Search) -> Vec<Trial> {
        runs::trials(search, N_TRIALS, |_, theta| self.reward(theta), |_| {})
    }

    /// The first answer of a search, with its height.
    fn answer(self, search: &dyn Search) -> (DVector<f64>, f64) {
        let theta = search.modes().swap_remove(0).mean;
        let reward = self.reward(&theta);
        (theta, reward)
    }

    /// Share of the true regions in which an answer lies.
    fn share_of_regions(index: usize, search: &dyn Search) -> f64 {
        let regions = Regions::of(index);
        regions.answered(&search.modes()) as f64 / regions.n as f64
    }

    /// What settings are tuned by: on the landscape the rates of a best trial and of an answer of
    /// at least 0.9 of the peak, in halves; on the skittles the share of the regions answered.
    pub fn score(self, trials: &[Trial], search: &dyn Search) -> f64 {
        if let Task::Skittles(index) = self {
            return Task::share_of_regions(index, search);
        }
        let best = f64::from(best_reward(trials) >= 0.9 * landscape::PEAK_VALUE);
        let answer = f64::from(self.answer(search).1 >= 0.9 * landscape::PEAK_VALUE);
        0.5 * (best + answer)
    }

    pub fn samples(self, method: &str, trials: &[Trial], search: &dyn Search) -> Vec<Sample> {
        let metric = |name: &str| format!("{}: {name}", self.name());
        let late = late_reward(trials);
        let last = Sample::mean(method, &metric("reward of last 20"), late);
        let n_answers = search.modes().len() as f64;
        if let Task::Skittles(index) = self {
            let share = Task::share_of_regions(index, search);
            let right = share == 1.0 && search.modes().len() == Regions::of(index).n;
            return vec![
                Sample::rate(method, &metric("each region answered once"), right),
                Sample::mean(method, &metric("regions answered"), share),
                Sample::mean(method, &metric("answers"), n_answers),
                last,
            ];
        }
        let high = |reward: f64| reward >= 0.9 * landscape::PEAK_VALUE;
        let (answer, height) = self.answer(search);
        let near = super::landscape::near(&point(&answer), landscape::PEAK);
        vec![
            Sample::rate(method, &metric("best >= 0.9"), high(best_reward(trials))),
            Sample::rate(method, &metric("answer >= 0.9"), high(height)),
            Sample::rate(method, &metric("answer near peak"), near),
            Sample::mean(method, &metric("answers"), n_answers),
            last,
        ]
    }
}
