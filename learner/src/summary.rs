//! What a rollout and a session have achieved, in a few numbers.

use std::collections::BTreeMap;

use serde::Serialize;
use shm_types::episode::FAULT_SWAPPED;
use shm_types::measures::Measures;

use crate::store::TrialRecord;

/// Trials at the end of a session that count as "late".
pub const LATE_TRIALS: usize = 20;

/// What became of a rollout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrialReport {
    pub rollout: u64,
    pub reward: f64,
    pub success: bool,
    pub fault: u64,
    /// It gave no usable episode; nothing was learnt from it.
    pub set_aside: bool,
    pub measures: Measures,
}

/// What became of a session.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    pub trials: u64,
    pub successes: u64,
    /// Trials in which the controller fell back to its damped hold.
    pub faults: u64,
    /// How many of them ended early by which fault, by its code.
    pub ended_early: BTreeMap<u64, u64>,
    /// Trials that gave no usable episode; nothing was learnt from them.
    pub set_aside: u64,
    pub first_success: Option<u64>,
    /// Share of successes among the last 20 trials, or among all if there are fewer; 0 of none.
    pub success_last20: f64,
    /// How many of these executed the search's mean, and how many of them succeeded. The others are draws
    /// around it.
    pub means_last20: u64,
    pub mean_successes_last20: u64,
    pub best_reward: f64,
    /// The first trial with the best reward.
    pub best_rollout: Option<u64>,
}

/// A fault of this code ends a rollout before its time; a swap goes on with another policy.
pub fn ends_early(fault: u64) -> bool {
    fault != 0 && fault != FAULT_SWAPPED
}

impl Summary {
    /// Summary of trials in the order of their rollouts.
    pub fn of(trials: &[TrialRecord]) -> Self {
        let late = &trials[trials.len().saturating_sub(LATE_TRIALS)..];
        let count = |trials: &[TrialRecord]| trials.iter().filter(|t| t.success).count();
        let means = || late.iter().filter(|trial| trial.is_mean);
        // What was set aside, or waits for a rating, was not rewarded: its 0 is none, and may be above all
        // others.
        let rewarded = trials.iter().filter(|trial| !trial.set_aside && !trial.unrated);
        let best = rewarded.reduce(|a, b| if b.reward > a.reward { b } else { a });
        let mut ended_early = BTreeMap::new();
        for trial in trials.iter().filter(|trial| ends_early(trial.fault)) {
            *ended_early.entry(trial.fault).or_default() += 1;
        }
        Summary {
            trials: trials.len() as u64,
            successes: count(trials) as u64,
            faults: trials.iter().filter(|trial| trial.fault != 0).count() as u64,
            ended_early,
            set_aside: trials.iter().filter(|trial| trial.set_aside).count() as u64,
            first_success: trials.iter().find(|trial| trial.success).map(|trial| trial.rollout),
            success_last20: count(late) as f64 / late.len().max(1) as f64,
            means_last20: means().count() as u64,
            mean_successes_last20: means().filter(|trial| trial.success).count() as u64,
            best_reward: best.map_or(0.0, |trial| trial.reward),
            best_rollout: best.map(|trial| trial.rollout),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;
    use search::trial::Trial;

    fn trial(rollout: u64, reward: f64, success: bool) -> TrialRecord {
        let (theta, measured) = (DVector::zeros(1), Vec::new());
        TrialRecord::of(Trial { rollout, theta, reward, success, measured }, Measures::NONE)
    }

    #[test]
    fn counts_early_and_late_successes() {
        let mut trials: Vec<_> =
            (1..=30).map(|n| trial(n, (n % 7) as f64, n == 5 || n > 25)).collect();
        [4, 19, 29].into_iter().for_each(|i| trials[i].is_mean = true);
        let expected = Summary {
            trials: 30,
            successes: 6,
            faults: 0,
            ended_early: BTreeMap::new(),
            set_aside: 0,
            first_success: Some(5),
            success_last20: 0.25,
            means_last20: 2,
            mean_successes_last20: 1,
            best_reward: 6.0,
            best_rollout: Some(6),
        };
        assert_eq!(Summary::of(&trials), expected);
        assert_eq!(Summary::of(&trials[..10]).success_last20, 0.1);
    }

    #[test]
    fn counts_what_ended_early_by_its_fault() {
        let with_fault = |n, fault| TrialRecord { fault, ..trial(n, 0.0, false) };
        let faults = [13, 0, 13, 2, FAULT_SWAPPED];
        let trials: Vec<_> = (1..).zip(faults).map(|(n, fault)| with_fault(n, fault)).collect();
        let summary = Summary::of(&trials);
        assert_eq!(summary.ended_early, BTreeMap::from([(2, 1), (13, 2)]));
        assert_eq!(summary.faults, 4);
    }

    #[test]
    fn of_nothing_is_nothing() {
        let summary = Summary::of(&[]);
        assert_eq!((summary.best_rollout, summary.first_success), (None, None));
        assert_eq!((summary.best_reward, summary.success_last20), (0.0, 0.0));
    }
}
