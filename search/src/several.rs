//! One search from each of several starts, in turn: several demonstrations, several ways to do it.
//!
//! What one start leads to is a mode (Sec. 4.1). The searches share the rollouts but learn alone: in
//! a hundred parameters a mixture fitted by EM cannot tell two ways apart from so few trials, while
//! two demonstrations tell them apart already.
//!
//! With several rollouts in flight each search is told of its own pending ones, by their numbers there; turns go
//! by the number of a rollout, so they do not depend on the order in which trials are told.
//!
//! A start may join later: it has its first turn in the rollout after those it came after, and the rollouts
//! before belong to whom they belonged.

use std::collections::BTreeSet;

use nalgebra::DVector;

use super::{Mode, RewardError, Search, SearchSnapshot};
use crate::trial::{Proposal, Trial};

/// Trials of a search by which it is judged, its newest.
const RECENT: usize = 10;

pub(super) struct Several {
    searches: Vec<Box<dyn Search>>,
    /// After how many rollouts each joined, in rising order; the first one after none.
    joined: Vec<u64>,
    /// The newest rewards of each.
    recent: Vec<Vec<f64>>,
}

impl Several {
    /// Each with the number of rollouts after which it joined. Precondition: at least one search, the first
    /// of which joined after none, and rising numbers.
    pub fn new(searches: Vec<(u64, Box<dyn Search>)>) -> Several {
        let (joined, searches): (Vec<u64>, Vec<Box<dyn Search>>) = searches.into_iter().unzip();
        let recent = vec![Vec::new(); searches.len()];
        Several { searches, joined, recent }
    }

    /// Which search rollout `rollout` belongs to, and its number there. Between two joins the searches take
    /// turns, those first that have just joined.
    fn place(&self, rollout: u64) -> (usize, u64) {
        let mut own = vec![0_u64; self.searches.len()];
        let mut begin = 0;
        loop {
            // Those of this stage: the first ones joined before it.
            let n_before = self.joined.iter().filter(|after| **after < begin).count() as u64;
            let n = self.joined.iter().filter(|after| **after <= begin).count() as u64;
            let end = self.joined.iter().copied().find(|after| *after > begin).unwrap_or(u64::MAX);
            let turn = |offset: u64| ((n_before + offset) % n) as usize;
            let length = end.min(rollout) - begin;
            // In whole rounds everybody has one turn; then the rest.
            own[..n as usize].iter_mut().for_each(|count| *count += length / n);
            (0..length % n).for_each(|offset| own[turn(offset)] += 1);
            if rollout <= end {
                let whose = turn(length - 1);
                return (whose, own[whose]);
            }
            begin = end;
        }
    }

    /// Those of `pending` that belong to search `k`, with their numbers there.
    fn pending_of(&self, k: usize, pending: &[Proposal]) -> Vec<Proposal> {
        let placed = pending.iter().map(|proposal| (self.place(proposal.rollout), proposal));
        let own = placed.filter(|((whose, _), _)| *whose == k);
        own.map(|((_, own), p)| Proposal { rollout: own, theta: p.theta.clone() }).collect()
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
    fn ask(&self, rollout: u64, pending: &[Proposal]) -> Proposal {
        let (k, own) = self.place(rollout);
        let pending = self.pending_of(k, pending);
        Proposal { rollout, theta: self.searches[k].ask(own, &pending).theta }
    }

    fn note(&mut self, proposal: &Proposal, pending: &[Proposal]) {
        let (k, own) = self.place(proposal.rollout);
        let pending = self.pending_of(k, pending);
        self.searches[k].note(&Proposal { rollout: own, ..proposal.clone() }, &pending);
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

    /// The mean of the currently best search.
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
    use crate::{SearchConfig, Space, build_all, build_joined};

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
            let theta = search.ask(rollout, &[]).theta;
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

    #[test]
    fn who_joins_later_is_first_and_leaves_the_rollouts_before_to_the_others() {
        let search = |after| {
            let space = Space::white(DVector::zeros(1));
            (after, crate::build(&SearchConfig::default(), 1, space))
        };
        let places = |joined: &[u64]| -> Vec<(usize, u64)> {
            let several = Several::new(joined.iter().map(|after| search(*after)).collect());
            (1..=9).map(|rollout| several.place(rollout)).collect()
        };
        let plain = [(0, 1), (1, 1), (0, 2), (1, 2), (0, 3), (1, 3), (0, 4), (1, 4), (0, 5)];
        assert_eq!(places(&[0, 0]), plain);
        let late = [(0, 1), (0, 2), (0, 3), (1, 1), (0, 4), (1, 2), (0, 5), (1, 3), (0, 6)];
        assert_eq!(places(&[0, 3]), late);
        let twice = [(0, 1), (1, 1), (0, 2), (2, 1), (0, 3), (3, 1), (0, 4), (1, 2), (2, 2)];
        assert_eq!(places(&[0, 1, 3, 5]), twice);
    }

    /// Trials told before a cell joined are told again to the same search and lead to the same proposals.
    #[test]
    fn a_start_that_joins_changes_nothing_for_the_others() {
        let spaces = |joined: &[(u64, f64)]| {
            let space = |(after, x): &(u64, f64)| (*after, Space::white(DVector::repeat(2, *x)));
            joined.iter().map(space).collect::<Vec<_>>()
        };
        let mut alone = build_joined(&SearchConfig::default(), 1, spaces(&[(0, 3.0)]));
        let mut both = build_joined(&SearchConfig::default(), 1, spaces(&[(0, 3.0), (30, -3.0)]));
        for rollout in 1..=30 {
            let theta = alone.ask(rollout, &[]).theta;
            assert_eq!(both.ask(rollout, &[]).theta, theta);
            let (reward, success, measured) = (reward(&theta), false, Vec::new());
            let trial = Trial { rollout, theta, reward, success, measured };
            alone.tell(&trial);
            both.tell(&trial);
        }
        assert_eq!(both.ask(31, &[]).theta, DVector::repeat(2, -3.0), "the new start");
        assert_eq!(both.ask(32, &[]).theta, alone.ask(31, &[]).theta);
    }
}
