//! Generations of a cell: every controller recreates its services, and incomplete ones are never joined.
//!
//! A process killed while it creates an iceoryx2 service leaves that service unusable for good. So a
//! controller never meets what an earlier one left: it creates everything in a folder of its own, and
//! only then names it as the current one. Every user of a generation holds a shared lock on its folder,
//! which the kernel frees when the process ends, however it ends; unused generations are deleted.
//!
//! ```text
//! <cell>/current                     number of the newest complete generation
//! <cell>/g<n>                        root of its iceoryx2 services, locked by all who use them
//! /dev/shm/sk<place>g<n>_*           its shared memory
//! ```

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use iceoryx2::prelude::{Config, FileName, Path as IpcPath, SemanticString};
use rustix::fs::{FlockOperation, flock};

use crate::cell::{Cell, CellError, create_own_dir};

/// Where iceoryx2 keeps shared-memory files on Linux.
const SHM_DIR: &str = "/dev/shm";
const OPEN_SEGMENT: &str = ".global_mgmt";
const CURRENT: &str = "current";
/// Numbers start again after this one: they are part of socket paths, which must stay short.
const LAST: u16 = 9999;

/// A generation in use by this process.
#[derive(Debug)]
pub(crate) struct Generation {
    number: u16,
    root: PathBuf,
    shm_prefix: String,
    current: PathBuf,
    _in_use: File,
}

impl Generation {
    /// A new one, known to nobody yet. Call with the cell's controller lock held.
    pub fn create(cell: &Cell) -> Result<Generation, CellError> {
        create_own_dir(cell.dir())?;
        sweep(cell);
        let taken = numbers(cell.dir());
        let last = read_current(cell.dir()).ok().flatten().unwrap_or(0);
        let next = (last..LAST).chain(0..last).map(|n| n + 1).find(|n| !taken.contains(n));
        let number = next.unwrap_or(LAST);
        create_own_dir(&root(cell.dir(), number))?;
        let generation = Generation::enter(cell, number);
        generation.map_err(|cause| CellError::Io { path: root(cell.dir(), number), cause })
    }

    /// Names it as the current one: from now on others join it.
    pub fn publish(&self) -> Result<(), CellError> {
        let draft = self.current.with_extension("new");
        fs::write(&draft, self.number.to_string())
            .and_then(|()| fs::rename(&draft, &self.current))
            .map_err(|cause| CellError::Io { path: self.current.clone(), cause })
    }

    /// The newest complete one, if there is any.
    pub fn current(cell: &Cell) -> Result<Option<Generation>, CellError> {
        let entered = read_current(cell.dir())
            .and_then(|number| number.map(|number| Generation::enter(cell, number)).transpose());
        match entered {
            // It may have been swept, or followed by another, before its lock was held.
            Ok(found) => Ok(found.filter(|found| found.root.is_dir() && found.is_current())),
            Err(error) if is_going(&error) => Ok(None),
            Err(cause) => Err(CellError::Io { path: cell.dir().to_path_buf(), cause }),
        }
    }

    /// How the names of its shared memory begin.
    pub fn shm_prefix(&self) -> &str {
        &self.shm_prefix
    }

    /// No newer one has been published, as far as can be read.
    pub fn is_current(&self) -> bool {
        match self.current.parent().map(read_current) {
            Some(Ok(number)) => number == Some(self.number),
            _ => true,
        }
    }

    /// iceoryx2 configuration under which only this user, this cell and this generation meet.
    pub fn ipc_config(&self) -> Config {
        let mut config = Config::default();
        let prefix = FileName::new(self.shm_prefix.as_bytes());
        let root = IpcPath::new(self.root.as_os_str().as_encoded_bytes());
        // Both are valid: the cell checked the characters of its name and the length of its path.
        if let (Ok(prefix), Ok(root)) = (prefix, root) {
            config.global.prefix = prefix;
            config.global.set_root_path(&root);
        }
        config
    }

    /// Nodes of dead processes that are still there: what a process holds that is killed while it joins
    /// is not always freed, and the places in a service are few.
    pub fn leaked(&self) -> usize {
        let Ok(entries) = fs::read_dir(self.root.join("nodes")) else { return 0 };
        let names = entries.flatten().map(|entry| entry.file_name());
        let pids = names.filter_map(|name| process_of(name.to_str()?));
        pids.filter(|pid| !Path::new(&format!("/proc/{pid}")).exists()).count()
    }

    /// iceoryx2 opens one segment of every generation, a counter, to all users; none of them needs it.
    pub fn close_to_others(&self) {
        let open = shared_memory(&self.shm_prefix).into_iter();
        for path in open.filter(|path| path.to_string_lossy().ends_with(OPEN_SEGMENT)) {
            let _ = fs::set_permissions(path, fs::Permissions::from_mode(0o600));
        }
    }

    fn enter(cell: &Cell, number: u16) -> io::Result<Generation> {
        let root = root(cell.dir(), number);
        let in_use = File::open(&root)?;
        flock(&in_use, FlockOperation::NonBlockingLockShared)?;
        let (shm_prefix, current) = (shm_prefix(cell, number), cell.dir().join(CURRENT));
        Ok(Generation { number, root, shm_prefix, current, _in_use: in_use })
    }
}

/// Deletes the shared memory and service files of all unused generations. Returns how many are still in
/// use. What cannot be deleted now is harmless and is tried again.
pub(crate) fn sweep(cell: &Cell) -> usize {
    let in_use = |number: &u16| {
        let Ok(dir) = File::open(root(cell.dir(), *number)) else { return false };
        if flock(&dir, FlockOperation::NonBlockingLockExclusive).is_err() {
            return true;
        }
        remove_shared_memory(&shm_prefix(cell, *number));
        let _ = fs::remove_dir_all(root(cell.dir(), *number));
        false
    };
    numbers(cell.dir()).iter().filter(|number| in_use(number)).count()
}

pub(crate) fn remove_shared_memory(prefix: &str) {
    for path in shared_memory(prefix) {
        let _ = fs::remove_file(path);
    }
}

/// Files of shared memory whose name begins with `prefix`.
pub(crate) fn shared_memory(prefix: &str) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(SHM_DIR) else { return Vec::new() };
    let ours = |path: &PathBuf| {
        path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(prefix))
    };
    entries.flatten().map(|entry| entry.path()).filter(ours).collect()
}

fn shm_prefix(cell: &Cell, number: u16) -> String {
    format!("{}{number}_", cell.shm_prefix())
}

/// The process of a node, by the name of its folder: the third word of its number.
fn process_of(node: &str) -> Option<u32> {
    Some((node.parse::<u128>().ok()? >> 64) as u32)
}

fn root(cell_dir: &Path, number: u16) -> PathBuf {
    cell_dir.join(format!("g{number}"))
}

fn read_current(cell_dir: &Path) -> io::Result<Option<u16>> {
    match fs::read_to_string(cell_dir.join(CURRENT)) {
        Ok(text) => Ok(text.parse().ok()),
        Err(error) if is_going(&error) => Ok(None),
        Err(error) => Err(error),
    }
}

/// It is not there, or about to be swept, as opposed to out of reach.
fn is_going(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::NotFound | ErrorKind::WouldBlock)
}

/// Generations that have a folder.
fn numbers(cell_dir: &Path) -> Vec<u16> {
    let Ok(entries) = fs::read_dir(cell_dir) else { return Vec::new() };
    let names = entries.flatten().map(|entry| entry.file_name());
    names.filter_map(|name| name.to_str()?.strip_prefix('g')?.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A node of a process number that the kernel never gives.
    const NOBODY: u128 = 0x7fff_ffff << 64;

    fn cell(name: &str) -> Cell {
        Cell::new(&format!("{name}-{}", std::process::id())).unwrap()
    }

    #[test]
    fn only_a_published_generation_is_joined_and_only_an_unused_one_is_swept() {
        let cell = cell("gen");
        let first = Generation::create(&cell).unwrap();
        assert!(Generation::current(&cell).unwrap().is_none(), "not published yet");
        first.publish().unwrap();
        let joined = Generation::current(&cell).unwrap().unwrap();
        assert_eq!(joined.number, first.number);
        drop(first);
        let second = Generation::create(&cell).unwrap();
        assert!(joined.is_current() && joined.root.is_dir(), "the second one is not ready");
        second.publish().unwrap();
        assert!(!joined.is_current());
        assert_eq!(sweep(&cell), 2, "both are in use");
        let old_root = joined.root.clone();
        drop(joined);
        assert_eq!(sweep(&cell), 1);
        assert!(!old_root.exists());
        drop(second);
        assert_eq!(sweep(&cell), 0);
        assert!(Generation::current(&cell).unwrap().is_none(), "named, but swept");
        cell.remove_if_idle();
        assert!(!cell.dir().exists());
    }

    /// As after a kill between the creation of the folder and its publication.
    #[test]
    fn what_was_never_published_goes_with_the_next_start() {
        let cell = cell("half");
        let half = Generation::create(&cell).unwrap();
        let (root, shm) = (half.root.clone(), format!("{SHM_DIR}/{}x.data", half.shm_prefix));
        fs::write(root.join("half.service"), "").unwrap();
        fs::write(&shm, "").unwrap();
        drop(half);
        let next = Generation::create(&cell).unwrap();
        assert!(!root.exists() || next.root == root);
        assert!(!Path::new(&shm).exists() && !next.root.join("half.service").exists());
        drop(next);
        cell.remove_if_idle();
    }

    #[test]
    fn a_node_names_its_process_and_one_of_no_process_is_leaked() {
        let cell = cell("leak");
        let member = crate::channel::Member::first(&cell).unwrap();
        let nodes = member.generation.root.join("nodes");
        let names = fs::read_dir(&nodes).unwrap().flatten().map(|entry| entry.file_name());
        let pids: Vec<u32> = names.filter_map(|name| process_of(name.to_str()?)).collect();
        assert_eq!(pids, [std::process::id()]);
        assert_eq!(member.generation.leaked(), 0);
        fs::create_dir(nodes.join(NOBODY.to_string())).unwrap();
        assert_eq!(member.generation.leaked(), 1);
        drop(member);
        cell.remove_if_idle();
    }

    #[test]
    fn numbers_begin_again() {
        let cell = cell("wrap");
        create_own_dir(cell.dir()).unwrap();
        fs::write(cell.dir().join(CURRENT), LAST.to_string()).unwrap();
        let next = Generation::create(&cell).unwrap();
        assert_eq!(next.number, 1);
        drop(next);
        cell.remove_if_idle();
    }
}
