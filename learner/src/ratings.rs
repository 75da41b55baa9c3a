//! What people said of a session's rollouts, as it took effect.
//!
//! A rating may come late, change, or be withdrawn. Each of these is an event that names the number of trials
//! after which it took effect, so what the search knew at any rollout can be told again, bit for bit.

use std::collections::HashMap;

use shm_types::episode::FAULT_POLICY_REFUSED;

use crate::people::{BEST, PeopleConfig};
use crate::store::TrialRecord;

/// What a rollout is taken for that another one is compared with, before anybody has rated it.
const UNRATED: f64 = 5.0;
/// A better rollout gets this part of what the other one lacks to the best rating, a worse one loses this part.
const STEP: f64 = 0.25;

/// A rating of a rollout, as it took effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rating {
    /// Id of the letter that said it.
    pub letter: u64,
    /// The proposals after this many trials know of it.
    pub after: u64,
    pub rollout: u64,
    /// 0 to 10, or none any more.
    pub rating: Option<f64>,
}

/// Everything that was said of a session's rollouts, in the order in which it took effect.
#[derive(Clone, Debug, Default)]
pub struct Ratings {
    config: PeopleConfig,
    all: Vec<Rating>,
}

impl Ratings {
    pub fn of(config: PeopleConfig, all: Vec<Rating>) -> Ratings {
        Ratings { config, all }
    }

    pub fn all(&self) -> &[Rating] {
        &self.all
    }

    /// What the letter `id` said, if it was taken.
    pub fn of_letter(&self, id: u64) -> impl Iterator<Item = &Rating> {
        self.all.iter().filter(move |rating| rating.letter == id)
    }

    /// Somebody has rated this rollout, or has said that there is no rating.
    pub fn speaks_of(&self, rollout: u64) -> bool {
        self.all.iter().any(|rating| rating.rollout == rollout)
    }

    /// The proposal of `rollout` is the first to know of a rating.
    pub fn changes_at(&self, rollout: u64) -> bool {
        self.taken_at(rollout).next().is_some()
    }

    /// All that is new at `rollout` is about the trial `newest`.
    pub fn only_rates_at(&self, rollout: u64, newest: u64) -> bool {
        self.taken_at(rollout).all(|rating| rating.rollout == newest)
    }

    fn taken_at(&self, rollout: u64) -> impl Iterator<Item = &Rating> {
        self.all.iter().filter(move |rating| rating.after + 1 == rollout)
    }

    /// What the proposal of `rollout` knows.
    pub fn view(&self, rollout: u64) -> View {
        let known = self.all.iter().filter(|rating| rating.after < rollout);
        let ratings = known.map(|rating| (rating.rollout, rating.rating)).collect();
        View { config: self.config, ratings }
    }

    /// With ratings that take effect now.
    pub fn with(&self, new: impl IntoIterator<Item = Rating>) -> Ratings {
        let all = self.all.iter().copied().chain(new).collect();
        Ratings { config: self.config, all }
    }

    /// The rating of a rollout that is better or worse than the one `than`, and the rating assumed for that one if
    /// it has none. Two that were told apart are never rated the same.
    pub fn compared(&self, than: u64, is_better: bool) -> (Option<f64>, f64) {
        let known = self.view(u64::MAX).rating(than);
        let other = known.unwrap_or(UNRATED);
        let rating = match is_better {
            true => other + STEP * (BEST - other),
            false => other - STEP * other,
        };
        (known.is_none().then_some(UNRATED), rating)
    }
}

/// The ratings that a proposal knows of.
#[derive(Clone, Debug, Default)]
pub struct View {
    config: PeopleConfig,
    ratings: HashMap<u64, Option<f64>>,
}

impl View {
    pub fn rating(&self, rollout: u64) -> Option<f64> {
        self.ratings.get(&rollout).copied().flatten()
    }

    /// Success and reward of a trial as a search is told of it; `None` where it is not: it was set aside, or
    /// ratings alone count and it has none.
    pub fn verdict(&self, trial: &TrialRecord) -> Option<(bool, f64)> {
        let own = (trial.own_success, trial.own_reward);
        // A policy that was refused has failed, with or without ratings.
        let is_judged = trial.fault == FAULT_POLICY_REFUSED || !self.config.takes_ratings_alone();
        match self.rating(trial.rollout).filter(|_| self.config.takes_ratings()) {
            _ if trial.set_aside => None,
            Some(rating) => Some(self.config.weigh(own, rating)),
            None => is_judged.then_some(own),
        }
    }

    /// Puts what counts into a trial that is shown.
    pub fn show(&self, trial: &mut TrialRecord) {
        let verdict = self.verdict(trial);
        trial.rating = self.rating(trial.rollout);
        trial.unrated = verdict.is_none() && !trial.set_aside;
        let nothing =
            if trial.unrated { (false, 0.0) } else { (trial.own_success, trial.own_reward) };
        (trial.judged_success, trial.reward) = verdict.unwrap_or(nothing);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;
    use search::trial::Trial;
    use shm_types::measures::Measures;

    fn trial(rollout: u64, success: bool, reward: f64) -> TrialRecord {
        let (theta, measured) = (DVector::zeros(1), Vec::new());
        TrialRecord::of(Trial { rollout, theta, reward, success, measured }, Measures::NONE)
    }

    fn rating(letter: u64, after: u64, rollout: u64, rating: Option<f64>) -> Rating {
        Rating { letter, after, rollout, rating }
    }

    #[test]
    fn a_proposal_knows_what_was_said_before_it_and_the_last_word_counts() {
        let config = PeopleConfig { weight: 1.0, full_marks: 10.0, ..PeopleConfig::default() };
        let said = [
            rating(1, 1, 1, Some(3.0)),
            rating(2, 1, 1, Some(4.0)),
            rating(3, 3, 1, Some(8.0)),
            rating(4, 4, 1, None),
        ];
        let ratings = Ratings::of(config, said.to_vec());
        let known = |rollout| ratings.view(rollout).verdict(&trial(1, true, 9.0));
        assert_eq!(known(1), None, "nobody has rated it");
        assert_eq!((known(2), known(3)), (Some((false, 4.0)), Some((false, 4.0))));
        assert_eq!((known(4), known(5)), (Some((true, 8.0)), None));
        let changes: Vec<u64> = (1..7).filter(|rollout| ratings.changes_at(*rollout)).collect();
        assert_eq!(changes, [2, 4, 5]);
        assert!(ratings.only_rates_at(2, 1) && !ratings.only_rates_at(4, 3));

        let mut shown = trial(1, true, 9.0);
        ratings.view(4).show(&mut shown);
        assert_eq!((shown.reward, shown.judged_success, shown.rating), (8.0, true, Some(8.0)));
        ratings.view(5).show(&mut shown);
        assert!(shown.unrated && !shown.judged_success && shown.reward == 0.0);
        assert_eq!((shown.own_reward, shown.own_success), (9.0, true), "what the judge said stays");
        let refused = TrialRecord { fault: FAULT_POLICY_REFUSED, ..trial(2, false, 0.0) };
        assert_eq!(ratings.view(5).verdict(&refused), Some((false, 0.0)));
        let aside = TrialRecord { set_aside: true, ..trial(1, false, 0.0) };
        assert_eq!(ratings.view(4).verdict(&aside), None);
    }

    #[test]
    fn without_a_weight_ratings_are_nothing() {
        let ratings = Ratings::of(PeopleConfig::default(), vec![rating(1, 1, 1, Some(0.0))]);
        assert_eq!(ratings.view(9).verdict(&trial(1, true, 9.0)), Some((true, 9.0)));
    }

    #[test]
    fn comparisons_never_end_in_a_draw() {
        let config = PeopleConfig { weight: 1.0, ..PeopleConfig::default() };
        let mut ratings = Ratings::of(config, Vec::new());
        let (other, mut last) = ratings.compared(1, true);
        assert_eq!((other, last), (Some(5.0), 6.25));
        for rollout in 2..40 {
            ratings = ratings.with([rating(rollout, rollout, rollout, Some(last))]);
            let (other, next) = ratings.compared(rollout, true);
            assert!(other.is_none() && next > last && next < BEST, "{last} {next}");
            assert!(ratings.compared(rollout, false).1 < last);
            last = next;
        }
    }
}
