//! Trials of a session under its conditions and ratings, each of which applies from a rollout on.

use crate::ratings::Ratings;
use crate::store::TrialRecord;
use crate::wish::{Telling, Wishes};

/// Conditions and ratings of a session.
#[derive(Clone, Debug, Default)]
pub struct History {
    pub wishes: Wishes,
    pub ratings: Ratings,
}

impl History {
    /// The proposals of `rollout` and on see some trial otherwise than those before did.
    pub fn changes_at(&self, rollout: u64) -> bool {
        self.wishes.changes_at(rollout) || self.ratings.changes_at(rollout)
    }

    /// The proposals of `rollout` and on see all trials but `newest` as those before did.
    pub fn changes_only_at(&self, rollout: u64, newest: u64) -> bool {
        !self.wishes.changes_at(rollout) && self.ratings.only_rates_at(rollout, newest)
    }

    /// How a search that proposes `rollout` is told of trials, from the first one on.
    pub fn telling(&self, rollout: u64) -> Telling {
        Telling::new(self.wishes.of_rollout(rollout)).under(self.ratings.view(rollout))
    }

    /// Puts into `trials` what counts now: success as it was wished for then.
    pub fn show(&self, trials: &mut [TrialRecord]) {
        let view = self.ratings.view(u64::MAX);
        for trial in trials {
            view.show(trial);
            let wish = self.wishes.of_rollout(trial.rollout);
            trial.success =
                trial.judged_success && wish.is_none_or(|wish| wish.holds(&trial.measures));
        }
    }

    /// The same for what the proposal of `rollout` knows, whatever is wished: for the repertoire.
    pub fn seen(&self, trials: &[TrialRecord], rollout: u64) -> Vec<TrialRecord> {
        let view = self.ratings.view(rollout);
        let mut seen = trials.to_vec();
        seen.iter_mut().for_each(|trial| view.show(trial));
        seen
    }
}
