//! Reading a session: trials, policies, paths, and the state to resume from.

use std::collections::HashMap;

use rusqlite::OptionalExtension;
use shm_types::measures::{Measure, Measures};
use shm_types::policy::PolicyMsg;

use super::rows::{
    ASKED_COLUMNS, Asked, Event, TOLD_COLUMNS, TRIAL_COLUMNS, TrialRecord, from_hex, integer,
    signed, trial_from_row, vector,
};
use super::{Store, StoreError, meta};
use crate::history::History;
use crate::path::{self, PathRow};
use search::SearchSnapshot;
use search::trial::Proposal;
use shm_types::policy_json;

impl Store {
    /// The proposals without a trial, in the order of their rollouts.
    pub fn in_flight(&self) -> Result<Vec<Asked>, StoreError> {
        let query = format!(
            "SELECT rollout, theta, {ASKED_COLUMNS}, COALESCE(given.cell, '') FROM proposals \
             LEFT JOIN asked USING (rollout) LEFT JOIN given USING (rollout) WHERE rollout NOT IN (SELECT rollout FROM trials) ORDER BY rollout"
        );
        let mut statement = self.sql(self.connection.prepare(&query))?;
        let rows = self.sql(statement.query_map([], |row| {
            let (rollout, after) = (integer(row.get(0)?), integer(row.get(2)?));
            Ok((rollout, row.get::<_, Vec<u8>>(1)?, after, row.get(3)?, row.get(4)?))
        }))?;
        let asked = |row: rusqlite::Result<(u64, Vec<u8>, u64, bool, String)>| {
            let (rollout, bytes, after, is_mean, cell) = self.sql(row)?;
            let theta = vector(&bytes)
                .ok_or_else(|| self.corrupt(format!("proposal {rollout}: theta is damaged")))?;
            Ok(Asked { proposal: Proposal { rollout, theta }, after, is_mean, cell })
        };
        rows.map(asked).collect()
    }

    /// All trials in the order of their rollouts.
    pub fn trials(&self) -> Result<Vec<TrialRecord>, StoreError> {
        let query = format!(
            "SELECT {TRIAL_COLUMNS}, {ASKED_COLUMNS}, {TOLD_COLUMNS} FROM trials \
             LEFT JOIN asked USING (rollout) LEFT JOIN told USING (rollout) ORDER BY rollout"
        );
        let mut statement = self.sql(self.connection.prepare(&query))?;
        let rows = self.sql(statement.query_map([], trial_from_row))?;
        let trials = rows.map(|row| self.sql(row)?.map_err(|detail| self.corrupt(detail)));
        let mut trials = trials.collect::<Result<Vec<TrialRecord>, StoreError>>()?;
        let mut measures = self.measures()?;
        for trial in &mut trials {
            if let Some(values) = measures.remove(&trial.rollout) {
                trial.measures = self.measured(trial.rollout, &values)?;
            }
        }
        self.history()?.show(&mut trials);
        Ok(trials)
    }

    /// As what its trials are seen.
    pub fn history(&self) -> Result<History, StoreError> {
        Ok(History { wishes: self.wishes()?, ratings: self.ratings()? })
    }

    /// What was measured of each trial, by name.
    fn measures(&self) -> Result<HashMap<u64, HashMap<String, f64>>, StoreError> {
        let query = "SELECT rollout, name, value FROM measures";
        let mut statement = self.sql(self.connection.prepare(query))?;
        let rows = self.sql(statement.query_map([], |row| {
            Ok((integer(row.get(0)?), row.get::<_, String>(1)?, row.get::<_, f64>(2)?))
        }))?;
        let mut measures: HashMap<u64, HashMap<String, f64>> = HashMap::new();
        for row in rows {
            let (rollout, name, value) = self.sql(row)?;
            measures.entry(rollout).or_default().insert(name, value);
        }
        Ok(measures)
    }

    /// The measures of a trial as the session declares them: all of them, and no others.
    fn measured(
        &self,
        rollout: u64,
        values: &HashMap<String, f64>,
    ) -> Result<Measures, StoreError> {
        let declared = &self.meta.measures;
        let damaged = |why: String| self.corrupt(format!("measures of trial {rollout}: {why}"));
        let all = declared.iter().map(|(name, unit)| {
            let value = values.get(name).ok_or_else(|| damaged(format!("{name} is missing")))?;
            Ok(Measure { name, unit, value: *value })
        });
        let all = all.collect::<Result<Vec<Measure>, StoreError>>()?;
        if values.len() > all.len() {
            return Err(damaged(format!("{} instead of {}", values.len(), all.len())));
        }
        Measures::of(all).map_err(|error| damaged(error.to_string()))
    }

    pub fn trial_count(&self) -> Result<u64, StoreError> {
        let count = self.connection.query_row("SELECT COUNT(*) FROM trials", [], |row| row.get(0));
        self.sql(count).map(integer)
    }

    /// Every rollout up to this one is durable; 0 before the first. To be acknowledged.
    pub fn durable_rollout(&self) -> Result<u64, StoreError> {
        match self.sql(meta::value(&self.connection, "durable_rollout"))? {
            Some(text) => {
                text.parse().map_err(|_| self.corrupt(format!("durable_rollout is `{text}`")))
            }
            None => Ok(0),
        }
    }

    /// The decimated path of a rollout; `None` if there is no such trial.
    pub fn path(&self, rollout: u64) -> Result<Option<Vec<PathRow>>, StoreError> {
        let query = "SELECT path FROM trials WHERE rollout = ?1";
        let bytes = self
            .connection
            .query_row(query, [signed(rollout)], |row| row.get::<_, Vec<u8>>(0))
            .optional();
        self.sql(bytes)?
            .map(|bytes| path::decode(&bytes))
            .transpose()
            .map_err(|error| self.corrupt(format!("trial {rollout}: {error}")))
    }

    /// A stored policy with the session's identity, sealed; `None` if there is no such policy.
    pub fn policy(&self, policy_id: u64) -> Result<Option<PolicyMsg>, StoreError> {
        let query = "SELECT rollout, digest, message FROM policies WHERE policy_id = ?1";
        let row = self
            .connection
            .query_row(query, [signed(policy_id)], |row| {
                Ok((integer(row.get(0)?), row.get::<_, String>(1)?, row.get::<_, String>(2)?))
            })
            .optional();
        let Some((rollout, digest, message)) = self.sql(row)? else { return Ok(None) };
        let policy = policy_json::from_json(&message)
            .map_err(|error| self.corrupt(format!("policy {policy_id}: {error}")))?;
        if Some(policy.digest) != from_hex(&digest) {
            return Err(self.corrupt(format!("policy {policy_id} does not match its digest")));
        }
        Ok(Some(PolicyMsg { session: self.meta.session_id, rollout, policy_id, ..policy }))
    }

    /// The policy the session started from.
    pub fn initial_policy(&self) -> Result<PolicyMsg, StoreError> {
        let query = "SELECT policy_id FROM policies WHERE kind = 'initial'";
        let id = self.connection.query_row(query, [], |row| row.get(0)).optional();
        let policy = match self.sql(id)? {
            Some(id) => self.policy(integer(id))?,
            None => None,
        };
        policy.ok_or_else(|| self.corrupt("it has no initial policy".into()))
    }

    /// The state of the search after each trial, with the rollout of that trial.
    pub fn searches(&self) -> Result<Vec<(u64, SearchSnapshot)>, StoreError> {
        let query = "SELECT rollout, mean, std, floor FROM searches ORDER BY rollout";
        let mut statement = self.sql(self.connection.prepare(query))?;
        let rows = self.sql(statement.query_map([], |row| {
            Ok((integer(row.get(0)?), row.get(1)?, row.get(2)?, row.get::<_, f64>(3)?))
        }))?;
        rows.map(|row| {
            let (rollout, mean, std, floor): (u64, Vec<u8>, Vec<u8>, f64) = self.sql(row)?;
            match (vector(&mean), vector(&std)) {
                (Some(mean), Some(std)) => Ok((rollout, SearchSnapshot { mean, std, floor })),
                _ => Err(self.corrupt(format!("search after rollout {rollout} is damaged"))),
            }
        })
        .collect()
    }

    /// The diary, oldest first.
    pub fn events(&self) -> Result<Vec<Event>, StoreError> {
        let query = "SELECT kind, text FROM events ORDER BY id";
        let mut statement = self.sql(self.connection.prepare(query))?;
        let rows = self.sql(
            statement.query_map([], |row| Ok(Event { kind: row.get(0)?, text: row.get(1)? })),
        )?;
        rows.map(|row| self.sql(row)).collect()
    }
}
