//! The process that holds a role of a cell, and its end.
//!
//! The kernel keeps the list of locks, so no file with a process number can be stale. The process is held by a
//! descriptor, which never refers to a later process with the same number.

use std::fs;
use std::os::fd::OwnedFd;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io;
use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};

use super::{Cell, Role};

/// A living process that holds a role.
#[derive(Debug)]
pub struct Holder {
    pid: u32,
    process: OwnedFd,
}

impl Cell {
    /// The process that holds `role`; `None` if there is none, or if it is out of sight, as in another container.
    pub fn holder(&self, role: Role) -> Option<Holder> {
        if !self.has(role) {
            return None;
        }
        let lock = fs::canonicalize(self.lock_path(role)).ok()?;
        let pid = locker(&lock)?;
        let process = pidfd_open(Pid::from_raw(pid as i32)?, PidfdFlags::empty()).ok()?;
        // The number may have passed to another process before the descriptor was opened.
        (locker(&lock) == Some(pid)).then_some(Holder { pid, process })
    }
}

impl Holder {
    pub fn pid(&self) -> u32 {
        self.pid
    }

    /// Asks the process to end, and wakes it up if it is stopped. One that has ended is no error.
    pub fn terminate(&self) -> io::Result<()> {
        for signal in [Signal::TERM, Signal::CONT] {
            match pidfd_send_signal(&self.process, signal) {
                Ok(()) | Err(io::Errno::SRCH) => {}
                error => return error,
            }
        }
        Ok(())
    }

    /// Whether the process ends within `patience`.
    pub fn ends_within(&self, patience: Duration) -> bool {
        let timeout =
            Timespec { tv_sec: patience.as_secs() as i64, tv_nsec: patience.subsec_nanos() as i64 };
        let mut ended = [PollFd::new(&self.process, PollFlags::IN)];
        poll(&mut ended, Some(&timeout)).is_ok_and(|n| n > 0)
    }
}

/// The process with the exclusive lock on the file `lock`. The kernel hands out the list of all locks in parts, and
/// skips an entry where another lock is released between two of them; what is not in it is looked for in the
/// descriptors of every process.
fn locker(lock: &Path) -> Option<u32> {
    listed(lock).or_else(|| {
        let processes = fs::read_dir("/proc").ok()?.flatten();
        let mut pids = processes.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
        pids.find(|pid| holds(*pid, lock))
    })
}

fn listed(lock: &Path) -> Option<u32> {
    let inode = fs::metadata(lock).ok()?.ino();
    let locks = fs::read_to_string("/proc/locks").ok()?;
    // `1: FLOCK  ADVISORY  WRITE 1234 fe:00:5357775 0 EOF`: device and inode are those of any file system.
    let mut holders = locks.lines().filter_map(|line| {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [_, "FLOCK", _, "WRITE", pid, file, ..] = words[..] else { return None };
        (file.rsplit(':').next()?.parse() == Ok(inode)).then(|| pid.parse::<u32>().ok())?
    });
    holders.find(|pid| holds(*pid, lock))
}

/// One of the descriptors of the process has the file open and locked, by a lock that the process itself took.
fn holds(pid: u32, file: &Path) -> bool {
    let Ok(open) = fs::read_dir(format!("/proc/{pid}/fd")) else { return false };
    let mut of_file =
        open.flatten().filter(|fd| fs::read_link(fd.path()).is_ok_and(|target| target == file));
    of_file.any(|fd| {
        let info = format!("/proc/{pid}/fdinfo/{}", fd.file_name().to_string_lossy());
        let info = fs::read_to_string(info).unwrap_or_default();
        // `lock:  1: FLOCK  ADVISORY  WRITE 1234 fe:00:5357775 0 EOF`
        info.lines().any(|line| {
            let words: Vec<&str> = line.split_whitespace().collect();
            matches!(words[..], ["lock:", _, "FLOCK", _, "WRITE", taker, ..] if taker == pid.to_string())
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::File;
    use std::process::Command;
    use std::sync::atomic::{AtomicBool, Ordering};

    #[test]
    fn the_holder_is_the_process_with_the_lock_and_nobody_else() {
        let cell = Cell::new(&format!("held-{}", std::process::id())).unwrap();
        assert!(cell.holder(Role::Controller).is_none());
        let lock = cell.lock(Role::Controller).unwrap();
        assert_eq!(cell.holder(Role::Controller).unwrap().pid(), std::process::id());
        assert!(cell.holder(Role::Learner).is_none());
        // One that only looks at the file holds nothing.
        let path = cell.lock_path(Role::Learner);
        let _looks = fs::File::create(path).unwrap();
        assert!(cell.holder(Role::Learner).is_none());
        drop(lock);
        assert!(cell.holder(Role::Controller).is_none());
    }

    /// More locks than one part of the list holds come and go before the one that is looked for.
    #[test]
    fn a_holder_is_seen_while_other_locks_come_and_go() {
        let cell = Cell::new(&format!("busy-{}", std::process::id())).unwrap();
        let _lock = cell.lock(Role::Controller).unwrap();
        let done = AtomicBool::new(false);
        std::thread::scope(|scope| {
            // The kernel keeps a list for each core.
            for _ in 0..2 {
                scope.spawn(|| {
                    let others: Vec<File> =
                        (0..200).map(|_| tempfile::tempfile().unwrap()).collect();
                    while !done.load(Ordering::Relaxed) {
                        others.iter().for_each(|file| file.lock().unwrap());
                        others.iter().for_each(|file| file.unlock().unwrap());
                    }
                });
            }
            let seen = (0..500).filter(|_| cell.holder(Role::Controller).is_some()).count();
            done.store(true, Ordering::Relaxed);
            assert_eq!(seen, 500);
        });
    }

    #[test]
    fn a_process_that_has_ended_is_known_and_its_number_is_not_signalled() {
        let mut child = Command::new("sleep").arg("600").spawn().unwrap();
        let pid = Pid::from_raw(child.id() as i32).unwrap();
        let process = pidfd_open(pid, PidfdFlags::empty()).unwrap();
        let holder = Holder { pid: child.id(), process };
        assert!(!holder.ends_within(Duration::from_millis(1)));
        holder.terminate().unwrap();
        assert!(holder.ends_within(Duration::from_secs(60)));
        child.wait().unwrap();
        holder.terminate().unwrap();
    }
}
