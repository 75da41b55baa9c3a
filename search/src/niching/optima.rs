//! The memory of the niching search: the tops of the hills it has climbed.

use nalgebra::{DMatrix, DVector};

use crate::power::by_reward;
use crate::trial::Trial;
use crate::{Bounds, Mode};

/// The top of a hill; its θ and its standard deviations in fractions of the box.
pub struct Optimum {
    pub trial: Trial,
    /// Standard deviations of the climb that found it, at its end.
    pub std: DVector<f64>,
    /// Starts beside it so far.
    pub n_looks: u64,
}

impl Optimum {
    pub fn distance(&self, theta: &DVector<f64>) -> f64 {
        (&self.trial.theta - theta).norm()
    }
}

pub struct Optima {
    pub all: Vec<Optimum>,
    /// Optima with this share of the best reward are answers.
    pub answer_share: f64,
}

impl Optima {
    /// The optimum nearest to a place.
    pub fn nearest(&self, theta: &DVector<f64>) -> Option<usize> {
        let distance = |i: &usize| self.all[*i].distance(theta);
        (0..self.all.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }

    /// Distance from an optimum to its nearest neighbour, at most one width of the box.
    pub fn spacing(&self, optimum: usize) -> f64 {
        let from = &self.all[optimum].trial.theta;
        let others = self.all.iter().enumerate().filter(|(i, _)| *i != optimum);
        others.map(|(_, other)| other.distance(from)).fold(1.0, f64::min)
    }

    /// The reward from which on an optimum is an answer.
    pub fn threshold(&self) -> f64 {
        let best = self.all.iter().map(|optimum| optimum.trial.reward).fold(0.0, f64::max);
        self.answer_share * best
    }

    /// The optima that are answers.
    pub fn answers(&self) -> Vec<usize> {
        let threshold = self.threshold();
        (0..self.all.len()).filter(|i| self.all[*i].trial.reward >= threshold).collect()
    }

    /// The answers, best first, with priors in proportion to their rewards.
    pub fn modes(&self, bounds: &Bounds) -> Vec<Mode> {
        let answers = self.answers();
        let mut best: Vec<&Optimum> = answers.into_iter().map(|i| &self.all[i]).collect();
        best.sort_by(|a, b| by_reward(&a.trial, &b.trial));
        // Scaled by the best reward first: sums of rewards need not be finite.
        let highest = best.first().map_or(1.0, |first| first.trial.reward);
        let share = |optimum: &Optimum| match highest {
            0.0 => 1.0,
            _ => optimum.trial.reward / highest,
        };
        let sum: f64 = best.iter().map(|optimum| share(optimum)).sum();
        let width = &bounds.max - &bounds.min;
        let mode = |optimum: &Optimum| {
            let std = optimum.std.component_mul(&width);
            Mode {
                prior: share(optimum) / sum,
                mean: bounds.clamp(&bounds.at(optimum.trial.theta.as_slice())),
                covariance: DMatrix::from_diagonal(&std.map(|s| s * s)),
            }
        };
        best.into_iter().map(mode).collect()
    }
}
