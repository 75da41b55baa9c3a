//! What people say of a session: letters, taken between rollouts; and when the learner turns to people.

use std::collections::BTreeSet;

use super::Learner;
use crate::error::LearnerError;
use crate::history::History;
use crate::mail::Says;
use crate::people::BEST;
use crate::problem::Problem;
use crate::ratings::Rating;
use crate::replay::told_anew;
use crate::store::{Added, TrialRecord};

/// Rollouts that may be in flight when learning begins to wait for ratings.
const MAX_RATED_TOGETHER: usize = 64;

/// A letter that was taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Taken {
    /// The trials that it is about.
    pub rollouts: Vec<u64>,
    /// What it said, for the log.
    pub text: String,
}

/// What letters add to a session.
#[derive(Default)]
struct New {
    ratings: Vec<Rating>,
    added: Vec<Added>,
}

impl Learner {
    /// People have said something, or the wish has changed: what is asked for from now on waits for it.
    pub fn has_news(&mut self) -> bool {
        self.has_other_wish() || !self.mail.read().is_empty()
    }

    /// Takes what people have said since the last time, from the next proposal on: durable when this returns.
    /// To be called when no rollout is executed and the session is settled ([`Learner::is_settled`]), as
    /// proposals that wait are taken back.
    pub fn take_mail(&mut self) -> Result<Vec<Taken>, LearnerError> {
        self.follow_wish()?;
        let letters = self.mail.read();
        if letters.is_empty() {
            return Ok(Vec::new());
        }
        let ratings = self.history.ratings.all().iter().map(|rating| rating.letter);
        let added = self.store.added()?;
        let mut known: BTreeSet<u64> =
            added.iter().map(|added| added.letter).chain(ratings).collect();
        let (mut new, mut taken) = (New::default(), Vec::new());
        for post in &letters {
            if !known.insert(post.letter.id) {
                continue; // a kill came between taking and removing it
            }
            match self.understood(post.letter.id, &post.letter.says, &mut new) {
                Ok(one) => taken.push(one),
                Err(reason) => post.refuse(&reason),
            }
        }
        if !taken.is_empty() {
            self.see_anew(&new)?;
        }
        letters.iter().for_each(|post| post.remove());
        Ok(taken)
    }

    /// Adds to `new` what a letter says; or why it says nothing that can be.
    fn understood(&self, letter: u64, says: &Says, new: &mut New) -> Result<Taken, String> {
        let after = self.trials.len() as u64;
        let rating = |rollout, rating| Rating { letter, after, rollout, rating };
        match says {
            Says::Rating { rollout, rating: value } => {
                self.expect_ratable(*rollout)?;
                if let Some(value) = value.filter(|value| !(0.0..=BEST).contains(value)) {
                    return Err(format!("a rating of {value}: use 0 to {BEST}"));
                }
                new.ratings.push(rating(*rollout, *value));
                let text = match value {
                    Some(value) => format!("rollout {rollout} is rated {value}"),
                    None => format!("the rating of rollout {rollout} is withdrawn"),
                };
                Ok(Taken { rollouts: vec![*rollout], text })
            }
            Says::Comparison { rollout, than, is_better } => {
                self.expect_ratable(*rollout)?;
                self.expect_ratable(*than)?;
                // Letters that came together know of each other.
                let so_far = self.history.ratings.with(new.ratings.iter().copied());
                let (other, value) = so_far.compared(*than, *is_better);
                new.ratings.extend(other.map(|other| rating(*than, Some(other))));
                new.ratings.push(rating(*rollout, Some(value)));
                let word = if *is_better { "better" } else { "worse" };
                let text = format!(
                    "rollout {rollout} is {word} than rollout {than}: it is rated {value:.2}"
                );
                Ok(Taken { rollouts: vec![*than, *rollout], text })
            }
            Says::Demonstration { file, text } => {
                let added = Added { letter, after, file: file.clone(), text: text.clone() };
                self.grown(std::slice::from_ref(&added)).map_err(|error| error.to_string())?;
                new.added.push(added);
                Ok(Taken {
                    rollouts: Vec::new(),
                    text: format!("the search now also starts from {file}"),
                })
            }
        }
    }

    /// That ratings count here, and that there is something to rate.
    fn expect_ratable(&self, rollout: u64) -> Result<(), String> {
        if !self.store.meta().learner.people.takes_ratings() {
            return Err(
                "learner.people.weight of this session is 0, so ratings do not count".into()
            );
        }
        match self.trials.iter().find(|trial| trial.rollout == rollout) {
            Some(trial) if trial.was_executed() => Ok(()),
            _ => Err(format!("rollout {rollout} was not executed and cannot be rated")),
        }
    }

    /// The problem with more starts.
    fn grown(&self, added: &[Added]) -> Result<Problem, LearnerError> {
        self.problem.clone().with_added(&self.config, added)
    }

    /// The search from here on: it is told all trials as they are seen now.
    fn see_anew(&mut self, new: &New) -> Result<(), LearnerError> {
        let problem = self.grown(&new.added)?.with_prediction(&self.config, self.judge.predictor());
        let ratings = self.history.ratings.with(new.ratings.iter().copied());
        let history = History { wishes: self.history.wishes.clone(), ratings };
        let next = self.trials.len() as u64 + 1;
        let (search, telling) =
            told_anew(&self.config, &problem, history.telling(next), &self.trials)?;
        self.store.put_said(&new.ratings, &new.added, &search.snapshot(next))?;
        history.show(&mut self.trials);
        (self.problem, self.search, self.telling) = (problem, search, telling);
        self.history = history;
        self.in_flight.clear();
        Ok(())
    }

    /// The oldest of the newest rollouts, where learning waits for its rating.
    pub fn awaits_rating(&self) -> Option<u64> {
        let newest = self.trials.iter().rev().take(MAX_RATED_TOGETHER);
        newest.filter(|trial| self.waits_for_rating_of(trial)).map(|trial| trial.rollout).min()
    }

    /// Whether learning continues: this trial is rated, or its rating is withdrawn.
    fn waits_for_rating_of(&self, trial: &TrialRecord) -> bool {
        let people = &self.config.people;
        let waits = people.takes_ratings() && people.wait;
        waits && trial.was_executed() && !self.history.ratings.speaks_of(trial.rollout)
    }

    /// The search stands still: without a success so far, and for `learner.people.ask_after` rollouts no better
    /// than before. A demonstration that was added gives it as many again.
    pub fn stands_still(&self) -> bool {
        let ask_after = self.config.people.ask_after;
        if ask_after == 0 || self.trials.iter().any(|trial| trial.success) {
            return false;
        }
        let since = self.problem.grew_after();
        let counts =
            |trial: &&TrialRecord| trial.told > since && !trial.set_aside && !trial.unrated;
        let best = self.trials.iter().filter(counts);
        let best = best.reduce(|a, b| if b.reward > a.reward { b } else { a });
        best.is_some_and(|best| self.trials.len() as u64 - best.told >= ask_after)
    }
}
