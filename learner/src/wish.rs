//! A condition on a rollout besides its success, as an expression over its measures: `apex_m > 0.6`.

use shm_types::measures::{Measures, TRUTH};

use crate::expression::{Expression, Kind, ParseError};
use crate::judge::Declared;
use crate::ratings::View;
use crate::store::TrialRecord;
use search::aim::Target;
use search::trial::Trial;

/// A wish for the measures it was parsed over.
#[derive(Clone, Debug)]
pub struct Wish(Expression);

impl Wish {
    /// `text` over the measures of a session.
    pub fn parse(text: &str, declared: &Declared) -> Result<Wish, ParseError> {
        Ok(Wish(Expression::parse(text, &kinds(declared), Kind::Truth)?))
    }

    /// That of a setting or a stored text; none where it is empty.
    pub fn parse_any(text: &str, declared: &Declared) -> Result<Option<Wish>, ParseError> {
        (!text.is_empty()).then(|| Wish::parse(text, declared)).transpose()
    }

    /// Whether a rollout is as wished; not one of which that cannot be said.
    pub fn holds(&self, measures: &Measures) -> bool {
        let values: Vec<f64> = measures.iter().map(|measure| measure.value).collect();
        values.len() == self.0.n_measures() && self.0.truth(&values).unwrap_or(false)
    }

    /// Names of the measures it speaks of.
    pub fn names(&self) -> Vec<&str> {
        self.0.occurring()
    }

    pub fn text(&self) -> &str {
        self.0.text()
    }
}

/// The wishes of a session: each holds from the trial after the one it names, until the next.
#[derive(Clone, Debug, Default)]
pub struct Wishes(Vec<(u64, Option<Wish>)>);

impl Wishes {
    pub fn of(wishes: Vec<(u64, Option<Wish>)>) -> Wishes {
        Wishes(wishes)
    }

    /// That of the trial `rollout`.
    pub fn of_rollout(&self, rollout: u64) -> Option<&Wish> {
        self.0.iter().rev().find(|(after, _)| *after < rollout).and_then(|(_, wish)| wish.as_ref())
    }

    /// That of the next trial.
    pub fn last(&self) -> Option<&Wish> {
        self.of_rollout(u64::MAX)
    }

    /// The trial `rollout` is the first under another wish than those before it.
    pub fn changes_at(&self, rollout: u64) -> bool {
        rollout > 1 && self.0.iter().any(|(after, _)| after + 1 == rollout)
    }

    /// First trial and text of each, for people.
    pub fn texts(&self) -> impl Iterator<Item = (u64, &str)> {
        self.0.iter().map(|(after, wish)| (after + 1, wish.as_ref().map_or("", Wish::text)))
    }
}

/// What a search is told of trials, by the robot's judge and by people: under a wish one that is not as wished
/// failed, and is worth no more than the worst before it.
#[derive(Clone, Debug)]
pub struct Telling {
    wish: Option<Wish>,
    view: View,
    worst: f64,
}

impl Telling {
    pub fn new(wish: Option<&Wish>) -> Telling {
        Telling { wish: wish.cloned(), view: View::default(), worst: f64::INFINITY }
    }

    /// With these ratings from here on.
    pub fn under(self, view: View) -> Telling {
        Telling { view, ..self }
    }

    /// `None` where the search is not told of it.
    pub fn trial(&self, record: &TrialRecord, targets: &[Target]) -> Option<Trial> {
        let (success, reward) = self.view.verdict(record)?;
        let trial = Trial { success, reward, ..record.trial(targets) };
        Some(match &self.wish {
            Some(wish) if !wish.holds(&record.measures) => {
                Trial { success: false, reward: trial.reward.min(self.worst), ..trial }
            }
            _ => trial,
        })
    }

    /// From the first trial on.
    pub fn anew(&self) -> Telling {
        Telling::new(self.wish.as_ref()).under(self.view.clone())
    }

    pub fn was_told(&mut self, trial: &Trial) {
        self.worst = self.worst.min(trial.reward);
    }

    /// Those of `records` that a search is told.
    pub fn all(mut self, records: &[TrialRecord], targets: &[Target]) -> Vec<Trial> {
        let tell = |record| {
            let trial = self.trial(record, targets)?;
            self.was_told(&trial);
            Some(trial)
        };
        records.iter().filter_map(tell).collect()
    }
}

/// The measures of a session as an expression sees them.
pub fn kinds(declared: &Declared) -> Vec<(&str, Kind)> {
    let kind = |unit: &str| if unit == TRUTH { Kind::Truth } else { Kind::Number };
    declared.iter().map(|(name, unit)| (name.as_str(), kind(unit))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_types::measures::Measure;

    #[test]
    fn holds_where_it_is_true_and_nowhere_else() {
        let measures = |apex_m: f64| {
            let apex = Measure { name: "apex_m", unit: "m", value: apex_m };
            Measures::of([apex, Measure::truth("caught", true)]).unwrap()
        };
        let wish = Wish::parse("apex_m > 0.3 and 1/apex_m < 3", &measures(0.0).declared()).unwrap();
        let held = [0.2, 0.4, 0.0].map(|apex_m| wish.holds(&measures(apex_m)));
        assert_eq!(held, [false, true, false]);
        assert!(!wish.holds(&Measures::NONE), "nothing was executed");
        assert_eq!(wish.names(), ["apex_m"]);
        let zero = Wish::parse("1/apex_m > 0", &measures(0.0).declared()).unwrap();
        assert!(!zero.holds(&measures(0.0)), "no value");
        let error = Wish::parse("height > 0.6", &measures(0.0).declared()).unwrap_err().to_string();
        assert!(error.contains("there is no measure `height`"), "{error}");
    }
}
