//! A cell: one controller and its learner, with a name that prefixes everything they share.
//!
//! ```
//! let cell = shm_types::cell::Cell::new("kitchen-1")?;
//! let lock = cell.lock(shm_types::cell::Role::Controller)?; // one controller a cell
//! # drop(lock); cell.remove_if_idle();
//! # Ok::<(), shm_types::cell::CellError>(())
//! ```

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::ErrorKind;
use std::os::unix::ffi::OsStringExt;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::fs::{FlockOperation, flock};
use thiserror::Error;

use crate::Digest;
use crate::advice;
use crate::generation::{remove_shared_memory, shared_memory, sweep};

/// A socket path ends at 107 bytes, and iceoryx2 puts `/g9999/sk01234567g9999_<31 digits>.event` below
/// a cell's directory.
const MAX_DIR_LEN: usize = 47;
const MAX_NAME_LEN: usize = 24;
/// The file that names the folder of the learner's session.
const SESSION: &str = "session";
/// A lock that is held for longer than so many looks is that of another process in this role.
const LOOKS: usize = 20;
const LOOK: Duration = Duration::from_millis(5);

/// Who holds a lock of the cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    Controller,
    Learner,
}

impl Role {
    pub fn name(self) -> &'static str {
        match self {
            Role::Controller => "controller",
            Role::Learner => "learner",
        }
    }
}

/// Why a cell cannot be used.
#[derive(Debug, Error)]
pub enum CellError {
    #[error("cell name '{0}': use 1 to {MAX_NAME_LEN} characters of a-z, 0-9 and '-'")]
    Name(String),
    #[error(
        "cell directory {path} is {len} characters long, at most {MAX_DIR_LEN} work: set SKILLET_RUNTIME_DIR to a shorter path"
    )]
    TooLong { path: PathBuf, len: usize },
    #[error(
        "cell directory {path} belongs to another user (uid {uid}): set SKILLET_RUNTIME_DIR to a directory of your own"
    )]
    Foreign { path: PathBuf, uid: u32 },
    #[error("cell '{cell}' has a {role} already: stop it, or choose another cell with --cell")]
    Busy { cell: String, role: &'static str },
    #[error("{path}: {cause}: {}", advice::on_io(cause))]
    Io { path: PathBuf, cause: std::io::Error },
}

/// How often, and after how long, an end looks whether something was made meanwhile.
const TEAR_DOWN_ROUNDS: u32 = 20;
const TEAR_DOWN_PAUSE: std::time::Duration = std::time::Duration::from_millis(5);

/// The name of a cell and its private runtime directory.
#[derive(Clone, Debug)]
pub struct Cell {
    name: String,
    dir: PathBuf,
}

/// Held while a process plays its role in the cell; the kernel frees it when the process ends. Who
/// gives it back as the last one takes everything away that the cell shared.
#[derive(Debug)]
pub struct CellLock {
    file: Option<File>,
    cell: Cell,
}

impl CellLock {
    pub fn cell(&self) -> &Cell {
        &self.cell
    }
}

impl Drop for CellLock {
    fn drop(&mut self) {
        self.file = None;
        self.cell.remove_if_idle();
    }
}

impl Cell {
    /// Checks the name; touches nothing yet.
    pub fn new(name: &str) -> Result<Cell, CellError> {
        Cell::in_dir(&runtime_dir(), name)
    }

    /// A cell elsewhere than in this process's runtime directory.
    pub fn in_dir(runtime_dir: &Path, name: &str) -> Result<Cell, CellError> {
        let allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        if name.is_empty() || name.len() > MAX_NAME_LEN || !name.chars().all(allowed) {
            return Err(CellError::Name(name.to_string()));
        }
        let dir = runtime_dir.join(name);
        let len = dir.as_os_str().len();
        if len > MAX_DIR_LEN {
            return Err(CellError::TooLong { path: dir, len });
        }
        Ok(Cell { name: name.to_string(), dir })
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// Takes the role, or says who has it.
    pub fn lock(&self, role: Role) -> Result<CellLock, CellError> {
        if let Some(parent) = self.dir.parent() {
            create_own_dir(parent)?;
        }
        // A process that removes an idle cell takes both roles for an instant: one at a time.
        let _starting = self.starting()?;
        create_own_dir(&self.dir)?;
        // Somebody may just look whether there is one, see `has`.
        let mut attempt = self.try_lock(role);
        for _ in 0..LOOKS {
            if !matches!(attempt, Err(CellError::Busy { .. })) {
                break;
            }
            std::thread::sleep(LOOK);
            attempt = self.try_lock(role);
        }
        Ok(CellLock { file: Some(attempt?), cell: self.clone() })
    }

    /// A living process plays `role`, though it may stand still. The kernel frees the lock of one that
    /// ends, however it ends.
    pub fn has(&self, role: Role) -> bool {
        match File::open(self.lock_path(role)) {
            // Shared: those who look do not see each other.
            Ok(file) => flock(&file, FlockOperation::NonBlockingLockShared).is_err(),
            // A process that joins it then is told why it cannot be looked at.
            Err(error) => error.kind() != ErrorKind::NotFound,
        }
    }

    /// The cells with a folder in `runtime_dir`, by name, whether a process uses them or not.
    pub fn all_in(runtime_dir: &Path) -> Vec<Cell> {
        let entries = fs::read_dir(runtime_dir).into_iter().flatten().flatten();
        let folders = entries.filter(|entry| entry.path().is_dir());
        let named =
            folders.filter_map(|entry| Cell::in_dir(runtime_dir, entry.file_name().to_str()?).ok());
        let mut cells: Vec<Cell> = named.collect();
        cells.sort_by(|a, b| a.name.cmp(&b.name));
        cells
    }

    /// Removes what dead processes left of the cells whose name begins with `prefix`.
    pub fn remove_idle(runtime_dir: &Path, prefix: &str) {
        let cells = Cell::all_in(runtime_dir).into_iter();
        cells.filter(|cell| cell.name.starts_with(prefix)).for_each(|cell| cell.remove_if_idle());
    }

    /// Removes everything the cell shares, unless a process uses it.
    pub fn remove_if_idle(&self) {
        if !self.dir.is_dir() {
            return;
        }
        let Ok(_starting) = self.starting() else { return };
        if let (Ok(_controller), Ok(_learner)) =
            (self.try_lock(Role::Controller), self.try_lock(Role::Learner))
        {
            // A tool may still look at it; then the next one to end removes it.
            if sweep(self) == 0 {
                remove_shared_memory(&self.shm_prefix());
                // Nothing depends on success: the next lock() creates what is missing.
                let _ = fs::remove_dir_all(&self.dir);
            }
        }
    }

    /// Removes everything the cell shares, in use or not: for a process that is about to end. What is
    /// being made at this moment, by another thread or process, is removed a moment later.
    pub fn tear_down(&self) {
        for _ in 0..TEAR_DOWN_ROUNDS {
            remove_shared_memory(&self.shm_prefix());
            let _ = fs::remove_dir_all(&self.dir);
            std::thread::sleep(TEAR_DOWN_PAUSE);
            if self.traces().is_empty() {
                return;
            }
        }
    }

    /// That the cell, if it is there, is this user's: the transport would only say that it failed.
    pub(crate) fn expect_own(&self) -> Result<(), CellError> {
        for dir in self.dir.parent().into_iter().chain([self.dir.as_path()]) {
            match fs::metadata(dir) {
                Ok(there) if there.uid() != uid() => {
                    return Err(CellError::Foreign { path: dir.to_path_buf(), uid: there.uid() });
                }
                Err(cause) if cause.kind() == ErrorKind::PermissionDenied => {
                    return Err(CellError::Io { path: dir.to_path_buf(), cause });
                }
                _ => {}
            }
        }
        Ok(())
    }

    pub(crate) fn dir(&self) -> &Path {
        &self.dir
    }

    /// Tells those who look at the cell in which folder its learner keeps its session.
    pub fn tell_session(&self, folder: &Path) -> Result<(), CellError> {
        let (draft, path) = (self.dir.join("session.new"), self.dir.join(SESSION));
        fs::write(&draft, folder.as_os_str().as_encoded_bytes())
            .and_then(|()| fs::rename(&draft, &path))
            .map_err(|cause| CellError::Io { path, cause })
    }

    /// The folder of the session that the cell's learner works on, or worked on last.
    pub fn session(&self) -> Option<PathBuf> {
        let bytes = fs::read(self.dir.join(SESSION)).ok()?;
        Some(PathBuf::from(OsString::from_vec(bytes)))
    }

    /// What there is of the cell on this machine, shared memory included.
    pub fn traces(&self) -> Vec<PathBuf> {
        let dir = self.dir.exists().then(|| self.dir.clone());
        dir.into_iter().chain(shared_memory(&self.shm_prefix())).collect()
    }

    /// /dev/shm is one folder for all: the prefix tells all cells apart, also those of one name in
    /// different runtime directories.
    pub(crate) fn shm_prefix(&self) -> String {
        let place = Digest::new().bytes(self.dir.as_os_str().as_encoded_bytes()).finish() as u32;
        format!("sk{place:08x}g")
    }

    /// Waits for its turn among all processes that start or end in a cell of this user. It is the
    /// runtime directory that is locked: a cell's own directory may be removed by the process that holds it.
    fn starting(&self) -> Result<File, CellError> {
        let path = self.dir.parent().unwrap_or(Path::new("."));
        let dir = File::open(path).and_then(|dir| {
            flock(&dir, FlockOperation::LockExclusive).map(|()| dir).map_err(Into::into)
        });
        dir.map_err(|cause| CellError::Io { path: path.into(), cause })
    }

    fn lock_path(&self, role: Role) -> PathBuf {
        self.dir.join(format!("{}.lock", role.name()))
    }

    fn try_lock(&self, role: Role) -> Result<File, CellError> {
        let file = open_lock(&self.lock_path(role))?;
        flock(&file, FlockOperation::NonBlockingLockExclusive)
            .map_err(|_| CellError::Busy { cell: self.name.clone(), role: role.name() })?;
        Ok(file)
    }
}

/// Creates a directory for this user alone, or makes sure that it is this user's.
pub(crate) fn create_own_dir(dir: &Path) -> Result<(), CellError> {
    let io = |cause| CellError::Io { path: dir.to_path_buf(), cause };
    fs::DirBuilder::new().recursive(true).mode(0o700).create(dir).map_err(io)?;
    let owner = fs::metadata(dir).map_err(io)?.uid();
    if owner != uid() {
        return Err(CellError::Foreign { path: dir.to_path_buf(), uid: owner });
    }
    Ok(())
}

fn open_lock(path: &Path) -> Result<File, CellError> {
    OpenOptions::new()
        .write(true)
        .create(true)
        .truncate(false)
        .mode(0o600)
        .open(path)
        .map_err(|cause| CellError::Io { path: path.to_path_buf(), cause })
}

fn uid() -> u32 {
    rustix::process::getuid().as_raw()
}

/// Where the cells of this process live.
pub fn runtime_dir() -> PathBuf {
    if let Some(dir) = std::env::var_os("SKILLET_RUNTIME_DIR") {
        return PathBuf::from(dir);
    }
    match std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from) {
        Some(dir) if dir.is_dir() => dir.join("skillet"),
        _ => PathBuf::from(format!("/tmp/skillet-{}", uid())),
    }
}

mod holder;

pub use holder::Holder;

#[cfg(test)]
mod tests;
