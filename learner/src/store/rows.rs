//! The rows of the session file as Rust values, and their encoding.

use nalgebra::DVector;
use rusqlite::{Row, Transaction, named_params, params};
use shm_types::episode::FAULT_POLICY_REFUSED;
use shm_types::measures::Measures;
use shm_types::policy::PolicyMsg;

use super::cells::{CellRecord, insert_given};
use crate::modes::mode_policy_id;
use crate::path::{self, PathRow};
use crate::targets::measured;
use search::SearchSnapshot;
use search::aim::Target;
use search::trial::{Proposal, Trial};

/// Where a policy comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PolicyKind {
    /// Fitted to the demonstration.
    Initial,
    /// Executed as a rollout.
    Trial,
    /// What a mode of the search stands for.
    Mode,
}

impl PolicyKind {
    pub(super) fn name(self) -> &'static str {
        match self {
            PolicyKind::Initial => "initial",
            PolicyKind::Trial => "trial",
            PolicyKind::Mode => "mode",
        }
    }
}

/// A proposal, and how many trials the search knew when it made it.
#[derive(Clone, Debug, PartialEq)]
pub struct Asked {
    pub proposal: Proposal,
    pub after: u64,
    /// It is the mean of the search then, not a draw around it; follows from what is stored.
    pub is_mean: bool,
    /// The cell it was given to last; empty where there is but one.
    pub cell: String,
}

/// A row of `trials`, without its path.
#[derive(Clone, Debug, PartialEq)]
pub struct TrialRecord {
    pub rollout: u64,
    /// How many trials the search knew when it proposed this one.
    pub asked_after: u64,
    /// Its place, from 1, in the order in which trials were told.
    pub told: u64,
    /// The cell that executed it; empty where only one ever did.
    pub cell: String,
    pub theta: DVector<f64>,
    /// What it counts for, by the robot's judge and by people.
    pub reward: f64,
    /// By both, and as it was wished then.
    pub success: bool,
    /// By both, whatever was wished.
    pub judged_success: bool,
    /// What the robot's own judge said.
    pub own_reward: f64,
    pub own_success: bool,
    /// What people say of it, 0 to 10.
    pub rating: Option<f64>,
    /// Ratings alone count, and it has none: the search was not told.
    pub unrated: bool,
    pub policy_id: u64,
    pub policy_digest: u64,
    /// Start of the controller that ran it; `applied_tick` counts from there.
    pub boot_id: u64,
    pub applied_tick: u64,
    pub fault: u64,
    pub n_records: u64,
    /// It gave no usable episode, or no verdict; the search was not told.
    pub set_aside: bool,
    /// What was executed is the mean of the search, not a draw around it.
    pub is_mean: bool,
    /// Those of the session, or none where nothing was executed.
    pub measures: Measures,
}

impl TrialRecord {
    /// One that no controller executed: of a study, or a test.
    pub fn of(trial: Trial, measures: Measures) -> TrialRecord {
        let Trial { rollout, theta, reward, success, .. } = trial;
        TrialRecord {
            rollout,
            asked_after: rollout.saturating_sub(1),
            told: rollout,
            cell: String::new(),
            theta,
            reward,
            success,
            judged_success: success,
            own_reward: reward,
            own_success: success,
            rating: None,
            unrated: false,
            policy_id: rollout,
            policy_digest: 0,
            boot_id: 0,
            applied_tick: 0,
            fault: 0,
            n_records: 0,
            set_aside: false,
            is_mean: false,
            measures,
        }
    }

    /// There was a rollout, whatever came of it.
    pub fn was_executed(&self) -> bool {
        !self.set_aside && self.fault != FAULT_POLICY_REFUSED
    }

    /// Everything that must not depend on pace, interruption or time of day, as bits: rollout, success,
    /// records, reward, measures, θ.
    pub fn bits(&self) -> Vec<u64> {
        let measures = self.measures.iter().map(|measure| measure.value);
        let numbers = [self.reward].into_iter().chain(measures).chain(self.theta.iter().copied());
        let counts = [self.rollout, self.success.into(), self.n_records];
        counts.into_iter().chain(numbers.map(f64::to_bits)).collect()
    }

    /// What it counts for where nothing is wished, with what was measured of the search's `targets`.
    pub fn trial(&self, targets: &[Target]) -> Trial {
        let (rollout, theta, reward) = (self.rollout, self.theta.clone(), self.reward);
        let measured = measured(targets, &self.measures);
        Trial { rollout, theta, reward, success: self.judged_success, measured }
    }
}

/// A row of `events`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    pub kind: String,
    pub text: String,
}

/// What a rollout adds to a session.
#[derive(Clone, Copy)]
pub struct Step<'a> {
    pub trial: &'a TrialRecord,
    /// What its cell drives from this trial on, where that is news.
    pub cell: Option<&'a CellRecord>,
    pub path: &'a [PathRow],
    /// State of the search after it.
    pub search: &'a SearchSnapshot,
    /// Every rollout up to this one is durable with it.
    pub durable_rollout: u64,
    /// The next proposal with its policy, unless there is none to be made now.
    pub next: Option<(&'a Asked, &'a PolicyMsg)>,
    /// What the diary says of it.
    pub note: Option<&'a Event>,
}

/// Columns of `trials` in the order [`trial_from_row`] reads them.
pub(super) const TRIAL_COLUMNS: &str = "rollout, theta, reward, policy_id, policy_digest, boot_id, \
     applied_tick, fault, n_records, set_aside, success";

/// How many trials were known when a proposal was made, and whether it is the mean that the search had then (before
/// the first trial there is none). Of rows with `asked` beside them.
pub(super) const ASKED_COLUMNS: &str = "COALESCE(asked.after, rollout - 1), EXISTS (SELECT 1 FROM searches WHERE searches.mean = theta AND \
     searches.rollout = COALESCE((SELECT earlier.rollout FROM told AS earlier \
     WHERE earlier.place = asked.after), asked.after, rollout - 1))";
/// When a trial was told, and which cell executed it.
pub(super) const TOLD_COLUMNS: &str = "COALESCE(told.place, rollout), COALESCE(told.cell, '')";

/// A trial without its measures; the error says which value is damaged.
pub(super) fn trial_from_row(row: &Row<'_>) -> rusqlite::Result<Result<TrialRecord, String>> {
    let rollout = integer(row.get(0)?);
    let theta = vector(&row.get::<_, Vec<u8>>(1)?);
    let (digest, boot_id) =
        (from_hex(&row.get::<_, String>(4)?), from_hex(&row.get::<_, String>(5)?));
    let reward: f64 = row.get(2)?;
    let (Some(theta), Some(policy_digest), Some(boot_id)) = (theta, digest, boot_id) else {
        return Ok(Err(format!("trial {rollout}: theta, policy_digest or boot_id is damaged")));
    };
    if !reward.is_finite() {
        return Ok(Err(format!("trial {rollout}: reward is {reward}")));
    }
    Ok(Ok(TrialRecord {
        rollout,
        asked_after: integer(row.get(11)?),
        told: integer(row.get(13)?),
        cell: row.get(14)?,
        theta,
        reward,
        success: row.get(10)?,
        judged_success: row.get(10)?,
        own_reward: reward,
        own_success: row.get(10)?,
        rating: None,
        unrated: false,
        policy_id: integer(row.get(3)?),
        policy_digest,
        boot_id,
        applied_tick: integer(row.get(6)?),
        fault: integer(row.get(7)?),
        n_records: integer(row.get(8)?),
        set_aside: row.get(9)?,
        is_mean: row.get(12)?,
        measures: Measures::NONE,
    }))
}

pub(super) fn insert_policy(
    transaction: &Transaction<'_>,
    kind: PolicyKind,
    policy: &PolicyMsg,
    text: &str,
) -> rusqlite::Result<()> {
    let query = "INSERT INTO policies (policy_id, kind, rollout, digest, message) \
                 VALUES (?1, ?2, ?3, ?4, ?5)";
    let PolicyMsg { policy_id, rollout, digest, .. } = *policy;
    let row = params![signed(policy_id), kind.name(), signed(rollout), hex(digest), text];
    transaction.prepare_cached(query)?.execute(row)?;
    Ok(())
}

pub(super) fn insert_proposal(
    transaction: &Transaction<'_>,
    Asked { proposal, after, cell, .. }: &Asked,
    policy: &PolicyMsg,
    text: &str,
) -> rusqlite::Result<()> {
    insert_policy(transaction, PolicyKind::Trial, policy, text)?;
    let query = "INSERT INTO proposals (rollout, theta) VALUES (?1, ?2)";
    let row = params![signed(proposal.rollout), blob(&proposal.theta)];
    transaction.prepare_cached(query)?.execute(row)?;
    let query = "INSERT INTO asked (rollout, after) VALUES (?1, ?2)";
    let row = [signed(proposal.rollout), signed(*after)];
    transaction.prepare_cached(query)?.execute(row)?;
    if cell.is_empty() { Ok(()) } else { insert_given(transaction, proposal.rollout, cell) }
}

pub(super) fn insert_search(
    transaction: &Transaction<'_>,
    rollout: u64,
    search: &SearchSnapshot,
) -> rusqlite::Result<()> {
    let query = "INSERT INTO searches (rollout, mean, std, floor) VALUES (?1, ?2, ?3, ?4)";
    let row = params![signed(rollout), blob(&search.mean), blob(&search.std), search.floor];
    transaction.prepare_cached(query)?.execute(row)?;
    Ok(())
}

/// Forgets what was proposed and found after trial `after`: it was made with another view of the trials.
/// `search` is what they say now.
pub(super) fn see_anew(
    transaction: &Transaction<'_>,
    after: u64,
    search: &SearchSnapshot,
) -> rusqlite::Result<()> {
    let beyond = [signed(after)];
    transaction.execute("DELETE FROM given WHERE rollout > ?1", beyond)?;
    transaction.execute("DELETE FROM asked WHERE rollout > ?1", beyond)?;
    transaction.execute("DELETE FROM proposals WHERE rollout > ?1", beyond)?;
    let query = "DELETE FROM policies WHERE rollout > ?1 AND kind = 'trial'";
    transaction.execute(query, beyond)?;
    // So were the modes, whose policies are numbered by trials.
    transaction.execute("DELETE FROM modes", [])?;
    let query = "DELETE FROM policies WHERE policy_id BETWEEN ?1 AND ?2 AND kind = 'mode'";
    let ids = [0, 99].map(|number| signed(mode_policy_id(after, number)));
    transaction.execute(query, ids)?;
    if after > 0 {
        let query = "SELECT COALESCE((SELECT rollout FROM told WHERE place = ?1), ?1)";
        let newest = integer(transaction.query_row(query, beyond, |row| row.get(0))?);
        transaction.execute("DELETE FROM searches WHERE rollout = ?1", [signed(newest)])?;
        insert_search(transaction, newest, search)?;
    }
    Ok(())
}

pub(super) fn insert_event(transaction: &Transaction<'_>, event: &Event) -> rusqlite::Result<()> {
    let query = "INSERT INTO events (kind, text) VALUES (?1, ?2)";
    transaction.execute(query, [&event.kind, &event.text])?;
    Ok(())
}

pub(super) fn insert_trial(
    transaction: &Transaction<'_>,
    trial: &TrialRecord,
    path: &[PathRow],
) -> rusqlite::Result<()> {
    let query = format!(
        "INSERT INTO trials ({TRIAL_COLUMNS}, path) VALUES (:rollout, :theta, :reward, :policy_id, \
         :policy_digest, :boot_id, :applied_tick, :fault, :n_records, :set_aside, :success, :path)"
    );
    transaction.prepare_cached(&query)?.execute(named_params! {
        ":rollout": signed(trial.rollout),
        ":theta": blob(&trial.theta),
        ":reward": trial.own_reward,
        ":policy_id": signed(trial.policy_id),
        ":policy_digest": hex(trial.policy_digest),
        ":boot_id": hex(trial.boot_id),
        ":applied_tick": signed(trial.applied_tick),
        ":fault": signed(trial.fault),
        ":n_records": signed(trial.n_records),
        ":set_aside": trial.set_aside,
        ":success": trial.own_success,
        ":path": path::encode(path),
    })?;
    let query = "INSERT INTO told (place, rollout, cell) VALUES (?1, ?2, ?3)";
    let row = params![signed(trial.told), signed(trial.rollout), trial.cell];
    transaction.prepare_cached(query)?.execute(row)?;
    let query = "INSERT INTO measures (rollout, name, value) VALUES (?1, ?2, ?3)";
    let mut statement = transaction.prepare_cached(query)?;
    for measure in trial.measures.iter() {
        statement.execute(params![signed(trial.rollout), measure.name, measure.value])?;
    }
    Ok(())
}

/// A counter as SQLite's signed integer, bit for bit.
pub(super) fn signed(value: u64) -> i64 {
    value.cast_signed()
}

pub(super) fn integer(value: i64) -> u64 {
    value.cast_unsigned()
}

pub(super) fn hex(value: u64) -> String {
    format!("{value:016x}")
}

pub(super) fn from_hex(text: &str) -> Option<u64> {
    u64::from_str_radix(text, 16).ok()
}

/// Little-endian f64.
pub(super) fn blob(vector: &DVector<f64>) -> Vec<u8> {
    vector.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Inverse of [`blob`]; `None` if the bytes are no finite vector.
pub(super) fn vector(bytes: &[u8]) -> Option<DVector<f64>> {
    let (numbers, rest) = bytes.as_chunks::<8>();
    let values: Vec<f64> = numbers.iter().map(|number| f64::from_le_bytes(*number)).collect();
    let sound = rest.is_empty() && values.iter().all(|value| value.is_finite());
    sound.then(|| DVector::from_vec(values))
}
