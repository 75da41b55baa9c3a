//! One search from each of several starts, in turn: several demonstrations, several ways to do it.
//!
//! What one start leads to is a mode (Sec. 4.1). The searches share the rollouts but learn alone: in
//! a hundred parameters a mixture fitted by EM cannot tell two ways apart from so few trials, while
//! whoever demonstrates twice has told them apart already.

use std::collections::BTreeSet;

use nalgebra::DVector;

use super::{Mode, RewardError, Search, SearchSnapshot};
use crate::trial::{Proposal, Trial};

/// Trials of a search by which it is judged, its newest.
const RECENT: usize = 10;

pub(super) struct Several {
    searches: Vec<Box<dyn Search>>,
    /// The newest rewards of each.
    recent: Vec<Vec<f64>>,
}

impl Several {
    /// Precondition: at least one search.
    pub fn new(searches: Vec<Box<dyn Search>>) -> Several {
        let recent = vec![Vec::new(); searches.len()];
        Several { searches, recent }
    }

    /// Which search rollout `rollout` belongs to, and its number there.
    fn place(&self, rollout: u64) -> (usize, u64) {
        let (n, k) = (rollout - 1, self.searches.len() as u64);
        ((n % k) as usize, n / k + 1)
    }

    /// Mean reward of the newest trials of search `k`; above the worst of them all if that one is
    /// negative, so that shares of merits are shares.
    fn merit(&self, k: usize) -> f64 {
        let worst = self.recent.iter().flatten().copied().fold(0.0, f64::min);
        let recent = &self.recent[k];
        recent.iter().map(|reward| reward - worst).sum::<f64>() / recent.len().max(1) as f64
    }
}

impl Search for Several {
    fn ask(&self, rollout: u64) -> Proposal {
        let (k, own) = self.place(rollout);
        Proposal { rollout, theta: self.searches[k].ask(own).theta }
    }

    fn check_reward(&self, reward: f64) -> Result<(), RewardError> {
        self.searches[0].check_reward(reward)
    }

    fn tell(&mut self, trial: &Trial) {
        let (k, own) = self.place(trial.rollout);
        self.searches[k].tell(&Trial { rollout: own, ..trial.clone() });
        self.recent[k].push(trial.reward);
        if self.recent[k].len() > RECENT {
            self.recent[k].remove(0);
        }
    }

    /// Of the search that does best at present.
    fn mean(&self) -> &DVector<f64> {
        let best = (0..self.searches.len())
            .reduce(|a, b| if self.merit(b) > self.merit(a) { b } else { a })
            .expect("there is a search");
        self.searches[best].mean()
    }

    fn snapshot(&self, rollout: u64) -> SearchSnapshot {
        let (k, own) = self.place(rollout);
        self.searches[k].snapshot(own)
    }

    /// By any of them.
    fn doubted(&self) -> Vec<usize> {
        let all: BTreeSet<usize> = self.searches.iter().flat_map(|s| s.doubted()).collect();
        all.into_iter().collect()
    }

    /// The modes of all; a search's prior is its share of the recent rewards.
    fn modes(&self) -> Vec<Mode> {
        let merits: Vec<f64> = (0..self.searches.len()).map(|k| self.merit(k)).collect();
        let sum: f64 = merits.iter().sum();
        let share = |k: usize| {
            if sum > 0.0 { merits[k] / sum } else { 1.0 / self.searches.len() as f64 }
        };
        let mut modes: Vec<Mode> = Vec::new();
        for (k, search) in self.searches.iter().enumerate() {
            let own = search.modes().into_iter();
            modes.extend(own.map(|mode| Mode { prior: share(k) * mode.prior, ..mode }));
        }
        modes.sort_by(|a, b| b.prior.total_cmp(&a.prior));
        modes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{SearchConfig, Space, build_all};

    /// Hills of height 1 at (4, 4) and 0.8 at (−4, −4).
    fn reward(theta: &DVector<f64>) -> f64 {
        let hill = |x: f64| (-0.2 * theta.add_scalar(-x).norm_squared()).exp();
        hill(4.0) + 0.8 * hill(-4.0)
    }

    #[test]
    fn each_start_keeps_its_own_hill() {
        let starts = [3.0, -3.0].map(|x| Space::white(DVector::repeat(2, x)));
        let mut search = build_all(&SearchConfig::default(), 1, starts.to_vec());
        for rollout in 1..=120 {
            let theta = search.ask(rollout).theta;
            let trial = Trial {
                rollout,
                reward: reward(&theta),
                theta,
                success: false,
                measured: Vec::new(),
            };
            search.tell(&trial);
        }
        let modes = search.modes();
        assert_eq!(modes.len(), 2);
        assert!((modes.iter().map(|mode| mode.prior).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(modes[0].prior > modes[1].prior, "the higher hill comes first");
        for (mode, x) in modes.iter().zip([4.0, -4.0]) {
            assert!((mode.mean.add_scalar(-x)).norm() < 1.0, "{}", mode.mean);
        }
        assert_eq!(search.mean(), &modes[0].mean);
    }
}
