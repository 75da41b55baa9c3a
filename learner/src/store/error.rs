//! Why a session could not be stored or opened, and what to do about it.

use std::path::{Path, PathBuf};

use rusqlite::ErrorCode;
use thiserror::Error;

#[derive(Debug, Error)]
pub enum StoreError {
    #[error("{path} already exists: resume that session, move it away, or give another --out")]
    Exists { path: PathBuf },
    #[error("{path} does not exist: start a session there first, or name an existing one")]
    Missing { path: PathBuf },
    #[error(
        "{path} is not a Skillet session (or its first page is damaged): move it away or give \
         another --out"
    )]
    NotSkillet { path: PathBuf },
    #[error(
        "{path} has session format {found}, this program writes {expected}: use the program that \
         wrote it, or give another --out"
    )]
    Format { path: PathBuf, found: i64, expected: i64 },
    #[error(
        "{path} is a session of the task `{found}`, not `{expected}`: name that task, or give \
         another --out"
    )]
    OtherTask { path: PathBuf, found: String, expected: String },
    #[error(
        "{path} is corrupted ({detail}): resume the session, which restores it from its second copy; \
         if that fails, move both away or give another --out"
    )]
    Corrupt { path: PathBuf, detail: String },
    #[error("{path} is read-only: make the file and its folder writable, or give another --out")]
    ReadOnly { path: PathBuf },
    #[error("no space left for {path}: free some and resume; nothing stored so far is lost")]
    DiskFull { path: PathBuf },
    #[error(
        "{path} could not be read or written ({detail}): check the disk, its free space and \
         `ulimit -f`, then resume; nothing stored so far is lost"
    )]
    Disk { path: PathBuf, detail: String },
    #[error("{path} is in use by another program: stop the other learner or SQLite tool")]
    Busy { path: PathBuf },
    #[error(
        "{path} cannot be opened: check that its folder exists and that you may write there, or \
         give another --out"
    )]
    CannotOpen { path: PathBuf },
    #[error("{path}: {cause}")]
    Sql { path: PathBuf, cause: rusqlite::Error },
}

impl StoreError {
    /// Whether freeing space or fixing permissions helps; a damaged file needs more.
    pub fn may_pass(&self) -> bool {
        matches!(
            self,
            StoreError::DiskFull { .. }
                | StoreError::Disk { .. }
                | StoreError::ReadOnly { .. }
                | StoreError::Busy { .. }
        )
    }

    /// Maps an error of SQLite on the file `path` to what it means for the user.
    pub(super) fn from_sql(path: &Path, source: rusqlite::Error) -> Self {
        let path = path.to_path_buf();
        match source.sqlite_error_code() {
            Some(ErrorCode::NotADatabase) => StoreError::NotSkillet { path },
            Some(ErrorCode::DatabaseCorrupt) => {
                StoreError::Corrupt { path, detail: source.to_string() }
            }
            Some(ErrorCode::ReadOnly | ErrorCode::PermissionDenied) => {
                StoreError::ReadOnly { path }
            }
            Some(ErrorCode::DiskFull) => StoreError::DiskFull { path },
            Some(ErrorCode::SystemIoFailure) => {
                StoreError::Disk { path, detail: source.to_string() }
            }
            Some(ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked) => StoreError::Busy { path },
            Some(ErrorCode::CannotOpen) => StoreError::CannotOpen { path },
            _ => StoreError::Sql { path, cause: source },
        }
    }
}
