//! What people said: ratings of trials, and demonstrations that were added.

use rusqlite::params;

use super::rows::{Event, from_hex, hex, insert_event, integer, see_anew, signed};
use super::{Store, StoreError};
use crate::ratings::{Rating, Ratings};
use search::SearchSnapshot;

/// A demonstration that was added to a session, as it took effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Added {
    /// Id of the letter that brought it.
    pub letter: u64,
    /// It is a start from the trial after this one on.
    pub after: u64,
    pub file: String,
    pub text: String,
}

impl Store {
    /// All ratings, in the order in which they took effect.
    pub fn ratings(&self) -> Result<Ratings, StoreError> {
        let query = "SELECT letter, after, rollout, rating FROM ratings ORDER BY id";
        let mut statement = self.sql(self.connection.prepare(query))?;
        let rows = self.sql(statement.query_map([], |row| {
            let (after, rollout) = (integer(row.get(1)?), integer(row.get(2)?));
            Ok((row.get::<_, String>(0)?, after, rollout, row.get::<_, Option<f64>>(3)?))
        }))?;
        let rating = |row: rusqlite::Result<(String, u64, u64, Option<f64>)>| {
            let (letter, after, rollout, rating) = self.sql(row)?;
            let letter = self.letter(&letter)?;
            if rating.is_some_and(|rating| !rating.is_finite()) {
                return Err(self.corrupt(format!("the rating of trial {rollout} is not a number")));
            }
            Ok(Rating { letter, after, rollout, rating })
        };
        let all = rows.map(rating).collect::<Result<_, StoreError>>()?;
        Ok(Ratings::of(self.meta.learner.people, all))
    }

    /// The demonstrations that were added, the oldest first.
    pub fn added(&self) -> Result<Vec<Added>, StoreError> {
        let query = "SELECT letter, after, file, text FROM demonstrations ORDER BY id";
        let mut statement = self.sql(self.connection.prepare(query))?;
        let rows = self.sql(statement.query_map([], |row| {
            let after = integer(row.get(1)?);
            Ok((row.get::<_, String>(0)?, after, row.get(2)?, row.get(3)?))
        }))?;
        let added = |row: rusqlite::Result<(String, u64, String, String)>| {
            let (letter, after, file, text) = self.sql(row)?;
            Ok(Added { letter: self.letter(&letter)?, after, file, text })
        };
        rows.map(added).collect()
    }

    /// From the next trial on. A proposal that waits was made without it and is forgotten; `search` is what the
    /// stored trials say now.
    pub fn put_said(
        &mut self,
        ratings: &[Rating],
        added: &[Added],
        search: &SearchSnapshot,
    ) -> Result<(), StoreError> {
        let after = self.trial_count()?;
        self.transaction(|transaction| {
            see_anew(transaction, after, search)?;
            for Rating { letter, after, rollout, rating } in ratings {
                let query =
                    "INSERT INTO ratings (letter, after, rollout, rating) VALUES (?1, ?2, ?3, ?4)";
                let row = params![hex(*letter), signed(*after), signed(*rollout), rating];
                transaction.execute(query, row)?;
            }
            for Added { letter, after, file, text } in added {
                let query =
                    "INSERT INTO demonstrations (letter, after, file, text) VALUES (?1, ?2, ?3, ?4)";
                transaction.execute(query, params![hex(*letter), signed(*after), file, text])?;
                let text = format!("from rollout {} on the search also starts from {file}", after + 1);
                insert_event(transaction, &Event { kind: "demonstration".into(), text })?;
            }
            Ok(())
        })
    }

    fn letter(&self, text: &str) -> Result<u64, StoreError> {
        from_hex(text).ok_or_else(|| self.corrupt(format!("letter `{text}` has no number")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::tests::{asked, policy, session, snapshot, store_trial};

    #[test]
    fn what_was_said_comes_back_and_takes_the_proposal_back() {
        let directory = tempfile::TempDir::new().unwrap();
        let (path, mut store) = session(&directory);
        store.put_proposal(&asked(1), &policy(1)).unwrap();
        store_trial(&mut store, 1, Some(2)).unwrap();
        let said = |letter, rating| Rating { letter, after: 1, rollout: 1, rating };
        let ratings = [said(u64::MAX, Some(0.1 + 0.2)), said(7, None)];
        let added = Added { letter: 8, after: 1, file: "a.csv".into(), text: "t_s\n".into() };
        store.put_said(&ratings, std::slice::from_ref(&added), &snapshot()).unwrap();
        assert_eq!(store.in_flight().unwrap(), []);
        store.put_proposal(&asked(2), &policy(2)).unwrap();
        drop(store);

        let store = Store::open(&path).unwrap();
        assert_eq!(store.ratings().unwrap().all(), ratings);
        assert_eq!(store.added().unwrap(), [added]);
        assert!(store.events().unwrap().iter().any(|event| event.kind == "demonstration"));
    }

    #[test]
    fn only_trials_are_rated() {
        let directory = tempfile::TempDir::new().unwrap();
        let (_, mut store) = session(&directory);
        let rating = Rating { letter: 1, after: 0, rollout: 1, rating: Some(7.0) };
        assert!(store.put_said(&[rating], &[], &snapshot()).is_err());
        assert!(store.ratings().unwrap().all().is_empty());
    }
}
