//! The second copy of a session: a disk's damage to one file is no loss.
//!
//! Everything is written to the session first, then to the copy. A learner that resumes a session takes
//! the sound one of the two, or, of two sound ones, the one that knows more, and makes the other anew.
//!
//! Only the session waits for the disk. The copy survives whatever a process dies of; after a power cut
//! it is whole and may be behind.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::Duration;

use rusqlite::backup::Backup;
use rusqlite::{Connection, OpenFlags, Transaction};

use super::seal;
use super::{Store, StoreError, connect};

/// Pages a step; all of them in one go.
const ALL_PAGES: i32 = i32::MAX;

pub(super) fn copy_path(session: &Path) -> PathBuf {
    session.with_extension("copy.db")
}

/// The copy of an open session.
pub(super) struct SecondCopy {
    path: PathBuf,
    /// Absent while it lags behind.
    connection: Option<Connection>,
}

impl SecondCopy {
    /// The copy of `store`, made anew when it is missing, damaged or different.
    pub fn of(store: &Store) -> SecondCopy {
        let path = copy_path(&store.path);
        let mut copy = SecondCopy { path, connection: None };
        let sound = Store::open(&copy.path).ok().map(|there| there.connection);
        let same = |there: &Connection| {
            seal::contents(there).ok() == seal::contents(&store.connection).ok()
        };
        copy.connection = sound.filter(same).filter(|there| without_waiting(there).is_ok());
        copy.catch_up(&store.connection);
        copy
    }

    /// Repeats what was committed to the session. Its failure is no failure of the session, which
    /// holds it; the copy is made anew with the next write.
    pub fn repeat(
        &mut self,
        session: &Connection,
        write: &dyn Fn(&Transaction<'_>) -> rusqlite::Result<()>,
    ) {
        match &mut self.connection {
            Some(connection) => {
                if let Err(error) = commit(connection, write) {
                    self.lag(&error);
                }
            }
            None => self.catch_up(session),
        }
    }

    fn catch_up(&mut self, session: &Connection) {
        if self.connection.is_none() {
            match replace(session, &self.path).and_then(|()| open(&self.path)) {
                Ok(connection) => self.connection = Some(connection),
                Err(error) => self.lag(&error),
            }
        }
    }

    fn lag(&mut self, error: &rusqlite::Error) {
        self.connection = None;
        let path = self.path.display();
        tracing::warn!(
            "{path}: the session's second copy is behind ({error}): free space or fix permissions"
        );
    }
}

/// Writes and commits.
pub(super) fn commit(
    connection: &mut Connection,
    write: &dyn Fn(&Transaction<'_>) -> rusqlite::Result<()>,
) -> rusqlite::Result<()> {
    let transaction = connection.transaction()?;
    write(&transaction)?;
    transaction.commit()
}

/// The session at `path` to go on with, from the better of its two files.
pub(super) fn open_better(path: &Path) -> Result<Store, StoreError> {
    let copy_path = copy_path(path);
    let (session, copy) = (Store::open(path), Store::open(&copy_path));
    match (session, copy) {
        (Ok(session), Ok(copy)) if progress(&copy)? <= progress(&session)? => Ok(session),
        (Ok(session), Err(_)) => Ok(session),
        (Err(error), Ok(_)) if !may_be_damage(&error) => Err(error),
        (Err(error), Err(_)) => Err(error),
        (session, Ok(copy)) => {
            let reason = match session {
                Ok(_) => "it is older than its copy".to_string(),
                Err(error) => error.to_string(),
            };
            restore(path, copy)?;
            let mut store = Store::open(path)?;
            let text = format!("from the second copy, because {reason}");
            tracing::warn!("{}: restored {text}", path.display());
            store.record_event("restored", &text)?;
            Ok(store)
        }
    }
}

/// Trials, then what people said, which takes a proposal back, then proposals.
fn progress(store: &Store) -> Result<(u64, i64, i64), StoreError> {
    let count = |query| store.sql(store.connection.query_row(query, [], |row| row.get(0)));
    let said = "SELECT (SELECT count(*) FROM ratings) + (SELECT count(*) FROM demonstrations)";
    Ok((store.trial_count()?, count(said)?, count("SELECT count(*) FROM proposals")?))
}

/// Anything but what a person has to put right first.
fn may_be_damage(error: &StoreError) -> bool {
    !matches!(
        error,
        StoreError::ReadOnly { .. }
            | StoreError::DiskFull { .. }
            | StoreError::Busy { .. }
            | StoreError::CannotOpen { .. }
    )
}

/// Puts the contents of `copy` in the place of the session, whose files are kept beside it.
fn restore(path: &Path, copy: Store) -> Result<(), StoreError> {
    let aside = (1..).map(|n| path.with_extension(format!("damaged-{n}.db"))).find(|p| !p.exists());
    let aside = aside.unwrap_or_else(|| path.with_extension("damaged.db"));
    for suffix in ["", "-wal", "-shm"] {
        let with = |path: &Path| PathBuf::from(format!("{}{suffix}", path.display()));
        // A file that is not there need not be kept; the log of changes belongs to the damaged one.
        let _ = fs::rename(with(path), with(&aside));
    }
    replace(&copy.connection, path).map_err(|error| StoreError::from_sql(path, error))
}

/// Writes what `from` holds to the file `to`: whole or not at all.
pub(super) fn replace(from: &Connection, to: &Path) -> rusqlite::Result<()> {
    let draft = to.with_extension("new");
    for suffix in ["", "-wal", "-shm"] {
        // Of an earlier attempt, or of the file that is replaced.
        let _ = fs::remove_file(format!("{}{suffix}", draft.display()));
    }
    let mut target = connect(&draft, writable() | OpenFlags::SQLITE_OPEN_CREATE)?;
    Backup::new(from, &mut target)?.run_to_completion(ALL_PAGES, Duration::ZERO, None)?;
    target.close().map_err(|(_, error)| error)?;
    for suffix in ["-wal", "-shm"] {
        let _ = fs::remove_file(format!("{}{suffix}", to.display()));
    }
    let dir = to.parent().unwrap_or(Path::new("."));
    fs::rename(&draft, to)
        .and_then(|()| File::open(dir)?.sync_all())
        .map_err(|_| rusqlite::Error::InvalidPath(to.to_path_buf()))
}

fn open(path: &Path) -> rusqlite::Result<Connection> {
    let connection = connect(path, writable())?;
    seal::seal_inserts(&connection)?;
    without_waiting(&connection)?;
    Ok(connection)
}

/// Commits stay in their order; they are on disk when the kernel has put them there.
fn without_waiting(connection: &Connection) -> rusqlite::Result<()> {
    connection.pragma_update(None, "synchronous", "NORMAL")
}

fn writable() -> OpenFlags {
    OpenFlags::SQLITE_OPEN_READ_WRITE
}

#[cfg(test)]
mod tests;
