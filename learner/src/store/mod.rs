//! A session on disk: one SQLite file that always holds a complete, resumable state.
//!
//! Write-ahead log with full synchronisation: what a call has returned from survives a power cut.

mod cells;
mod convert;
mod copy;
mod error;
mod glance;
mod meta;
mod modes;
mod people;
mod read;
mod rows;
mod seal;
mod wishes;

use std::path::{Path, PathBuf};
use std::time::Duration;

use rusqlite::{Connection, OpenFlags, Transaction};
use shm_types::policy::PolicyMsg;

use cells::insert_cell;
pub use cells::{CellRecord, equipment_of};
use copy::{SecondCopy, copy_path};
pub use error::StoreError;
pub use glance::Glance;
pub use meta::SessionMeta;
pub use people::Added;
pub use rows::{Asked, Event, PolicyKind, Step, TrialRecord};
use rows::{insert_event, insert_policy, insert_proposal, insert_search, insert_trial};

use shm_types::policy_json;

/// Format of the session file; raised whenever an older program could not read it.
pub const FORMAT_VERSION: i64 = 8;
/// "SKLT" in the file's header: how `file` and [`Store::open`] recognise a session.
const APPLICATION_ID: i64 = 0x534b_4c54;
/// Pages of changes after which they are moved into the file. That waits for the disk thrice, so it is to be
/// rare: about once in two hundred rollouts of the pancake. The log takes 16 MB of the disk, and a
/// process that is killed leaves it to be read by the next.
const CHECKPOINT_PAGES: i64 = 4000;
/// How long to wait for another program's short transaction.
const BUSY_TIMEOUT: Duration = Duration::from_secs(5);

/// An open session file.
pub struct Store {
    connection: Connection,
    path: PathBuf,
    meta: SessionMeta,
    /// The second copy, if the session is open for writing.
    copy: Option<SecondCopy>,
}

impl Store {
    /// Creates the file with its identity and the initial policy; never overwrites one. The file
    /// appears under its name only when it is complete: a crash leaves no half session behind.
    pub fn create(path: &Path, meta: SessionMeta, initial: &PolicyMsg) -> Result<Self, StoreError> {
        if path.exists() {
            return Err(StoreError::Exists { path: path.into() });
        }
        let draft = path.with_extension("db.new");
        for leftover in [&draft, &path.with_extension("db.new-wal")] {
            // Absent, as a rule; what cannot be removed is reported when it is opened.
            let _ = std::fs::remove_file(leftover);
        }
        if copy_path(path).exists() {
            return Err(StoreError::Exists { path: copy_path(path) });
        }
        drop(Store::create_draft(&draft, meta, initial)?);
        std::fs::rename(&draft, path).map_err(|_| StoreError::CannotOpen { path: path.into() })?;
        Store::resume(path)
    }

    fn create_draft(
        path: &Path,
        meta: SessionMeta,
        initial: &PolicyMsg,
    ) -> Result<Self, StoreError> {
        let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_CREATE;
        let sql = |error| StoreError::from_sql(path, error);
        let connection = connect(path, flags).map_err(sql)?;
        connection.pragma_update(None, "journal_mode", "WAL").map_err(sql)?;
        let mut store = Store::of(connection, path, meta.clone());
        let text = store.policy_text(initial)?;
        store.transaction(|transaction| {
            transaction.execute_batch(include_str!("schema.sql"))?;
            seal::seal_inserts(transaction)?;
            meta::write(transaction, &meta)?;
            insert_policy(transaction, PolicyKind::Initial, initial, &text)?;
            transaction.pragma_update(None, "user_version", FORMAT_VERSION)?;
            transaction.pragma_update(None, "application_id", APPLICATION_ID)
        })?;
        Ok(store)
    }

    /// There is a session, whole or damaged.
    pub fn exists(path: &Path) -> bool {
        path.exists() || copy_path(path).exists()
    }

    /// Opens a session to go on with it. One that is damaged, or has lost what it knew, is restored
    /// from its second copy.
    pub fn resume(path: &Path) -> Result<Self, StoreError> {
        let mut store = copy::open_better(path)?;
        store.copy = Some(SecondCopy::of(&store));
        Ok(store)
    }

    /// Opens a session to look at it, and checks its identity, format and integrity. One of the
    /// format before is converted, and kept as it was beside it.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        if !path.exists() {
            return Err(StoreError::Missing { path: path.into() });
        }
        let sql = |error| StoreError::from_sql(path, error);
        let mut connection = connect(path, OpenFlags::SQLITE_OPEN_READ_WRITE).map_err(sql)?;
        convert::to_this_format(&mut connection, path)?;
        check_format(&connection, path)?;
        // The first finding is enough.
        let check = connection.query_row("PRAGMA quick_check(1)", [], |row| row.get(0));
        let check: String = check.map_err(sql)?;
        if check != "ok" {
            return Err(StoreError::Corrupt {
                path: path.into(),
                detail: check.replace('\n', " "),
            });
        }
        if let Some(detail) = seal::find_damage(&connection).map_err(sql)? {
            return Err(StoreError::Corrupt { path: path.into(), detail });
        }
        seal::seal_inserts(&connection).map_err(sql)?;
        let meta = meta::read(&connection, path)?;
        Ok(Store::of(connection, path, meta))
    }

    fn of(connection: Connection, path: &Path, meta: SessionMeta) -> Self {
        Store { connection, path: path.into(), meta, copy: None }
    }

    /// That this is a session of `task`.
    pub fn expect_task(&self, task: &str) -> Result<(), StoreError> {
        if self.meta.task == task {
            return Ok(());
        }
        let (found, expected) = (self.meta.task.clone(), task.into());
        Err(StoreError::OtherTask { path: self.path.clone(), found, expected })
    }

    pub fn meta(&self) -> &SessionMeta {
        &self.meta
    }

    /// Stores a policy under its `policy_id`, which must be new.
    pub fn put_policy(&mut self, kind: PolicyKind, policy: &PolicyMsg) -> Result<(), StoreError> {
        let text = self.policy_text(policy)?;
        self.transaction(|transaction| insert_policy(transaction, kind, policy, &text))
    }

    /// Makes a proposal and its policy durable, before the policy is published.
    pub fn put_proposal(&mut self, asked: &Asked, policy: &PolicyMsg) -> Result<(), StoreError> {
        let text = self.policy_text(policy)?;
        self.transaction(|transaction| insert_proposal(transaction, asked, policy, &text))
    }

    /// Writes what a rollout adds in one transaction, with the acknowledgement that it allows.
    pub fn record_step(&mut self, step: &Step<'_>) -> Result<(), StoreError> {
        let Step { trial, cell, path, search, durable_rollout, next, note } = step;
        let next_text = next.map(|(_, policy)| self.policy_text(policy)).transpose()?;
        self.transaction(|transaction| {
            if let Some(note) = note {
                insert_event(transaction, note)?;
            }
            insert_trial(transaction, trial, path)?;
            cell.map_or(Ok(()), |cell| insert_cell(transaction, cell))?;
            insert_search(transaction, trial.rollout, search)?;
            let query = "INSERT OR REPLACE INTO meta (key, value) VALUES ('durable_rollout', ?1)";
            transaction.prepare_cached(query)?.execute([durable_rollout.to_string()])?;
            if let (Some((asked, policy)), Some(text)) = (next, &next_text) {
                insert_proposal(transaction, asked, policy, text)?;
            }
            Ok(())
        })
    }

    /// Appends to the session's diary.
    pub fn record_event(&mut self, kind: &str, text: &str) -> Result<(), StoreError> {
        let event = Event { kind: kind.into(), text: text.into() };
        self.transaction(|transaction| insert_event(transaction, &event))
    }

    /// That the file holds something no program of this format wrote.
    pub(crate) fn corrupt(&self, detail: String) -> StoreError {
        StoreError::Corrupt { path: self.path.clone(), detail }
    }

    fn policy_text(&self, policy: &PolicyMsg) -> Result<String, StoreError> {
        policy_json::to_json(policy)
            .map_err(|error| self.corrupt(format!("policy {}: {error}", policy.policy_id)))
    }

    fn sql<T>(&self, result: rusqlite::Result<T>) -> Result<T, StoreError> {
        result.map_err(|error| StoreError::from_sql(&self.path, error))
    }

    /// Commits to the session, which decides, then to its second copy.
    fn transaction(
        &mut self,
        write: impl Fn(&Transaction<'_>) -> rusqlite::Result<()>,
    ) -> Result<(), StoreError> {
        let committed = copy::commit(&mut self.connection, &write);
        committed.map_err(|error| StoreError::from_sql(&self.path, error))?;
        if let Some(copy) = &mut self.copy {
            copy.repeat(&self.connection, &write);
        }
        Ok(())
    }
}

/// That a file is a session of this format.
fn check_format(connection: &Connection, path: &Path) -> Result<(), StoreError> {
    let sql = |error| StoreError::from_sql(path, error);
    let pragma = |name| connection.pragma_query_value(None, name, |row| row.get::<_, i64>(0));
    if pragma("application_id").map_err(sql)? != APPLICATION_ID {
        return Err(StoreError::NotSkillet { path: path.into() });
    }
    let found = pragma("user_version").map_err(sql)?;
    if found != FORMAT_VERSION {
        return Err(StoreError::Format { path: path.into(), found, expected: FORMAT_VERSION });
    }
    Ok(())
}

/// A connection on which commits are durable and references checked.
fn connect(path: &Path, flags: OpenFlags) -> rusqlite::Result<Connection> {
    let connection = Connection::open_with_flags(path, flags)?;
    connection.busy_timeout(BUSY_TIMEOUT)?;
    connection.pragma_update(None, "synchronous", "FULL")?;
    connection.pragma_update(None, "wal_autocheckpoint", CHECKPOINT_PAGES)?;
    connection.pragma_update(None, "foreign_keys", "ON")?;
    seal::teach(&connection)?;
    Ok(connection)
}

#[cfg(test)]
mod tests;
