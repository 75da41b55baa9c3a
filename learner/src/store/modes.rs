//! The tables `modes` and `forbidden`.

use nalgebra::{DMatrix, DVector};
use rusqlite::params;
use shm_types::policy::PolicyMsg;

use super::rows::{PolicyKind, blob, insert_policy, integer, signed, vector};
use super::{Store, StoreError};
use crate::modes::{ModeReport, assess, forbidden_by, mode_policy_id};
use search::Mode;

impl Store {
    /// Replaces the modes by those found now, with the policy of each; a policy that is stored
    /// already stays.
    pub fn put_modes(&mut self, modes: &[(ModeReport, PolicyMsg)]) -> Result<(), StoreError> {
        let texts: Result<Vec<String>, _> =
            modes.iter().map(|(_, policy)| self.policy_text(policy)).collect();
        let texts = texts?;
        let known: Result<Vec<bool>, _> = modes
            .iter()
            .map(|(_, policy)| Ok(self.policy(policy.policy_id)?.is_some()))
            .collect::<Result<_, StoreError>>();
        let known = known?;
        self.transaction(|transaction| {
            transaction.execute("DELETE FROM modes", [])?;
            for (((report, policy), text), is_known) in modes.iter().zip(&texts).zip(&known) {
                if !is_known {
                    insert_policy(transaction, PolicyKind::Mode, policy, text)?;
                }
                let covariance = DVector::from_column_slice(report.mode.covariance.as_slice());
                transaction.execute(
                    "INSERT INTO modes (mode, prior, mean, covariance, policy_id, trials, \
                     best_rollout, best_reward, tolerance) \
                     VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9)",
                    params![
                        report.number as i64,
                        report.mode.prior,
                        blob(&report.mode.mean),
                        blob(&covariance),
                        signed(policy.policy_id),
                        report.n_trials as i64,
                        report.best.map(|(rollout, _)| signed(rollout)),
                        report.best.map(|(_, reward)| reward),
                        report.tolerance,
                    ],
                )?;
            }
            Ok(())
        })
    }

    /// The modes found when the search last stopped, by falling prior, each with the number of its
    /// policy; none before.
    pub fn modes(&self) -> Result<Vec<(Mode, u64)>, StoreError> {
        let query = "SELECT mode, prior, mean, covariance, policy_id FROM modes ORDER BY mode";
        let mut statement = self.sql(self.connection.prepare(query))?;
        let rows = self.sql(statement.query_map([], |row| {
            let policy_id = integer(row.get(4)?);
            Ok((integer(row.get(0)?), row.get(1)?, row.get(2)?, row.get(3)?, policy_id))
        }))?;
        rows.map(|row| {
            let (number, prior, mean, covariance, policy_id): (_, _, Vec<u8>, Vec<u8>, _) =
                self.sql(row)?;
            mode(prior, &mean, &covariance)
                .map(|mode| (mode, policy_id))
                .ok_or_else(|| self.corrupt(format!("mode {number} is damaged")))
        })
        .collect::<Result<_, StoreError>>()
    }

    /// Whether the stored modes are what all its trials lead to: no learner was killed since.
    pub fn has_current_modes(&self) -> Result<bool, StoreError> {
        let (modes, trials) = (self.modes()?, self.trial_count()?);
        let is_current = |((_, id), number)| id == mode_policy_id(trials, number);
        Ok(!modes.is_empty() && modes.into_iter().zip(1..).all(is_current))
    }

    /// The stored modes, judged by its trials, each with the number of its policy.
    pub fn mode_reports(&self) -> Result<Vec<(ModeReport, u64)>, StoreError> {
        let (modes, ids): (Vec<Mode>, Vec<u64>) = self.modes()?.into_iter().unzip();
        if modes.is_empty() {
            return Ok(Vec::new());
        }
        let telling = self.history()?.telling(u64::MAX);
        let mut trials = self.trials()?;
        trials.sort_by_key(|trial| trial.told);
        let told = telling.all(&trials, self.meta().learner.search.targets());
        let forbidden = self.forbidden()?;
        let thetas = told.iter().map(|trial| &trial.theta).chain(&forbidden);
        let mut dims = modes.iter().map(|mode| &mode.mean).chain(thetas).map(|theta| theta.len());
        if dims.next().is_some_and(|dim| dims.any(|other| other != dim)) {
            let what = "its modes and its trials do not have the same parameters";
            return Err(self.corrupt(what.into()));
        }
        Ok(assess(&modes, &told, &forbidden).into_iter().zip(ids).collect())
    }

    /// Forbids the mode whose mean is `mean`, and those that may come to lie there.
    pub fn forbid(&mut self, mean: &DVector<f64>) -> Result<(), StoreError> {
        self.transaction(|transaction| {
            transaction.execute("INSERT INTO forbidden (mean) VALUES (?1)", [blob(mean)])?;
            Ok(())
        })
    }

    /// Allows the mode `number`, from 1, again: every place that forbids it is forgotten.
    pub fn allow(&mut self, number: usize) -> Result<(), StoreError> {
        let modes: Vec<Mode> = self.modes()?.into_iter().map(|(mode, _)| mode).collect();
        let forbids = |place: &DVector<f64>| {
            forbidden_by(place, &modes).into_iter().any(|index| index + 1 == number)
        };
        let places: Vec<_> = self.forbidden()?.into_iter().filter(forbids).collect();
        self.transaction(|transaction| {
            for place in &places {
                transaction.execute("DELETE FROM forbidden WHERE mean = ?1", [blob(place)])?;
            }
            Ok(())
        })
    }

    /// Means of the forbidden modes.
    pub fn forbidden(&self) -> Result<Vec<DVector<f64>>, StoreError> {
        let query = "SELECT id, mean FROM forbidden ORDER BY id";
        let mut statement = self.sql(self.connection.prepare(query))?;
        let rows = self.sql(
            statement.query_map([], |row| Ok((integer(row.get(0)?), row.get::<_, Vec<u8>>(1)?))),
        )?;
        rows.map(|row| {
            let (id, bytes) = self.sql(row)?;
            vector(&bytes).ok_or_else(|| self.corrupt(format!("forbidden mode {id} is damaged")))
        })
        .collect()
    }
}

/// `None` if the numbers are no mode: not finite, or of shapes that do not fit.
fn mode(prior: f64, mean: &[u8], covariance: &[u8]) -> Option<Mode> {
    let (mean, entries) = (vector(mean)?, vector(covariance)?);
    let dim = mean.len();
    let sound = prior.is_finite() && dim > 0 && entries.len() == dim * dim;
    let covariance = || DMatrix::from_column_slice(dim, dim, entries.as_slice());
    sound.then(|| Mode { prior, mean, covariance: covariance() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::tests::{policy, session};

    #[test]
    fn modes_come_back_and_damaged_ones_are_refused() {
        let directory = tempfile::TempDir::new().unwrap();
        let (_, mut store) = session(&directory);
        assert_eq!(store.modes().unwrap(), []);
        let found = Mode {
            prior: 0.75,
            mean: DVector::from_vec(vec![1.0, -2.0]),
            covariance: DMatrix::from_column_slice(2, 2, &[3.0, 1.0, 1.0, 2.0]),
        };
        let report = ModeReport {
            number: 1,
            mode: found.clone(),
            n_trials: 3,
            best: None,
            tolerance: None,
            forbidden: false,
        };
        store.put_modes(&[(report.clone(), policy(7))]).unwrap();
        assert_eq!(store.modes().unwrap(), [(found.clone(), 7)]);
        assert!(!store.has_current_modes().unwrap(), "a number of other trials");
        let current = mode_policy_id(store.trial_count().unwrap(), 1);
        let numbered = PolicyMsg { policy_id: current, ..policy(7) };
        store.put_modes(&[(report, numbered)]).unwrap();
        assert!(store.has_current_modes().unwrap());
        let damage = "UPDATE modes SET covariance = x'0000000000000000'";
        store.connection.execute_batch(damage).unwrap();
        assert!(store.modes().unwrap_err().to_string().contains("mode 1 is damaged"));
    }
}
