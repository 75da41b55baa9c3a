//! A session as its learner tells it: rewards, successes, modes.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use shm_types::measures::Measures;
use shm_types::news::{
    MeasuresNews, ModeNews, TRIAL_MEAN, TRIAL_SUCCESS, TRIAL_UNDER_WISH, TrialNews,
};

/// Trials remembered.
const TRIALS: usize = 1000;

/// One trial in the reward curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial {
    pub rollout: u64,
    pub reward: f64,
    pub success: bool,
    pub is_mean: bool,
    pub is_under_wish: bool,
}

/// What is told first are trials of before, however old.
const HISTORY: Duration = Duration::from_secs(1);

/// The newest session that was told of; without a trial nothing was.
#[derive(Default)]
pub struct WatchedSession {
    first_told: Option<Instant>,
    last_told: Option<Instant>,
    id: u64,
    /// In the order of their rollouts.
    pub trials: VecDeque<Trial>,
    /// Rollouts the session is to have.
    pub rollouts: u64,
    pub modes: Vec<ModeNews>,
    /// Measures of the newest trial received.
    pub measures: Option<Measures>,
}

impl WatchedSession {
    /// Takes what was told; what cannot be believed is passed over.
    pub fn take(&mut self, news: &TrialNews) {
        let Ok(modes) = news.validate() else { return };
        let first_told = *self.first_told.get_or_insert_with(Instant::now);
        if news.session != self.id {
            let first_told = Some(first_told);
            *self = WatchedSession { id: news.session, first_told, ..WatchedSession::default() };
        }
        self.rollouts = news.rollouts;
        let success = news.has(TRIAL_SUCCESS);
        let is_mean = news.has(TRIAL_MEAN);
        let is_under_wish = news.has(TRIAL_UNDER_WISH);
        let (rollout, reward) = (news.rollout, news.reward);
        let trial = Trial { rollout, reward, success, is_mean, is_under_wish };
        // What is told again, to a new controller's services or because it was rated, is known already.
        if let Some(known) = self.trials.iter_mut().find(|known| known.rollout == rollout) {
            *known = trial;
        } else if self.trials.back().is_none_or(|last| rollout > last.rollout) {
            if first_told.elapsed() >= HISTORY {
                self.last_told = Some(Instant::now());
            }
            self.trials.push_back(trial);
            if self.trials.len() > TRIALS {
                self.trials.pop_front();
            }
        }
        if !modes.is_empty() {
            self.modes = modes.to_vec();
        }
    }

    /// Takes what was measured of a trial.
    pub fn measured(&mut self, news: &MeasuresNews) {
        if news.validate().is_ok() && news.session == self.id {
            self.measures = Some(news.measures);
        }
    }

    /// Rollout and reward of the best trial: the modes know of those that were not seen.
    pub fn best(&self) -> Option<(u64, f64)> {
        let seen = self.trials.iter().map(|trial| (trial.rollout, trial.reward));
        let told = self.modes.iter().filter(|mode| mode.best_rollout > 0);
        let told = told.map(|mode| (mode.best_rollout, mode.best_reward));
        seen.chain(told).reduce(|a, b| if b.1 > a.1 { b } else { a })
    }

    /// The rollout from which on the session's successes must be as wished.
    pub fn wished_since(&self) -> Option<u64> {
        let wished = self.trials.iter().rev().take_while(|trial| trial.is_under_wish);
        wished.last().map(|trial| trial.rollout)
    }

    /// Since the newest trial, unless it is from before anybody watched.
    pub fn trial_age(&self) -> Option<Duration> {
        self.last_told.map(|at| at.elapsed())
    }

    /// Share of successes among the last 20 draws; where the search executes its own mean is no draw.
    pub fn success_last20(&self) -> f64 {
        let draws = self.trials.iter().rev().filter(|trial| !trial.is_mean).take(20);
        let late: Vec<bool> = draws.map(|trial| trial.success).collect();
        late.iter().filter(|success| **success).count() as f64 / late.len().max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_types::SCHEMA;
    use shm_types::news::MAX_MODES;

    fn news(session: u64, rollout: u64, reward: f64) -> TrialNews {
        TrialNews {
            schema: SCHEMA,
            session,
            rollout,
            rollouts: 100,
            policy_digest: 0,
            fault: 0,
            flags: if reward > 1.0 { TRIAL_SUCCESS } else { 0 },
            reward,
            n_modes: 0,
            modes: [ModeNews::ZERO; MAX_MODES],
        }
    }

    #[test]
    fn what_is_told_twice_counts_once_and_a_late_comer_learns_of_the_best() {
        let mut watched = WatchedSession::default();
        assert_eq!(watched.best(), None);
        for (rollout, reward) in [(7, 0.5), (8, 1.5), (7, 0.5), (8, 1.5), (9, 0.2)] {
            watched.take(&news(1, rollout, reward));
        }
        watched.take(&news(1, 10, f64::NAN));
        assert_eq!(watched.trials.len(), 3);
        assert_eq!(watched.best(), Some((8, 1.5)));
        assert_eq!(watched.success_last20(), 1.0 / 3.0);
        watched.take(&news(1, 8, 1.75));
        assert_eq!((watched.trials.len(), watched.best()), (3, Some((8, 1.75))), "rated since");
        let mut judged = TrialNews { n_modes: 1, ..news(1, 10, 0.1) };
        judged.modes[0] = ModeNews { best_rollout: 3, best_reward: 4.0, ..ModeNews::ZERO };
        watched.take(&judged);
        assert_eq!(watched.best(), Some((3, 4.0)), "from before anybody watched");
        assert_eq!(watched.wished_since(), None);
        for rollout in 11..14 {
            watched.take(&TrialNews { flags: TRIAL_UNDER_WISH, ..news(1, rollout, 0.1) });
        }
        assert_eq!(watched.wished_since(), Some(11));
        watched.take(&news(2, 1, 0.3));
        assert_eq!((watched.trials.len(), watched.best()), (1, Some((1, 0.3))), "another session");
    }
}
