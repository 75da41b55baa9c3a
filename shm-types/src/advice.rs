//! What to do about an error of the system or the transport: advice that fits its cause.
//!
//! The transport says what failed, but not always why (`InternalFailure`). What it lives on, open files
//! and shared memory, is looked at here when it has failed.

use std::io;

use rustix::io::Errno;
use rustix::process::{Resource, getrlimit};

/// What a process lacks for its next step in joining a cell, if it has less than so many files left.
const FILES: u64 = 16;
/// The shared memory of a controller with a learner and a few tools, in bytes, rounded up.
const SHARED_BYTES: u64 = 64 << 20;
const SHARED_MEMORY: &str = "/dev/shm";

/// About a file or folder of the runtime directory.
pub(crate) fn on_io(error: &io::Error) -> String {
    match error.raw_os_error().map(Errno::from_raw_os_error) {
        Some(Errno::MFILE) => on_open_files(open_files()),
        Some(Errno::NFILE) => {
            "too many files are open on this machine: end some programs, or raise \
                               fs.file-max"
                .into()
        }
        Some(Errno::NOSPC | Errno::DQUOT) => {
            "free some space there, or set SKILLET_RUNTIME_DIR".into()
        }
        Some(Errno::ROFS) => "it is read-only: set SKILLET_RUNTIME_DIR to your own folder".into(),
        Some(Errno::ACCESS | Errno::PERM) => {
            "check its owner and permissions, or set SKILLET_RUNTIME_DIR to your own folder".into()
        }
        _ => "check this path, or set SKILLET_RUNTIME_DIR to another folder".into(),
    }
}

/// About an error of the transport, by the name it gives it, and by what this machine has left.
pub(crate) fn on_transport(reason: &str) -> String {
    by_name(reason)
        .map(str::to_string)
        .or_else(|| by_need(open_files(), shared_memory()))
        .unwrap_or_else(|| {
            "try again; if it persists, restart the controller of the cell, which recreates its \
             shared memory"
                .into()
        })
}

fn by_name(reason: &str) -> Option<&'static str> {
    let says = |words: &[&str]| words.iter().any(|word| reason.contains(word));
    if says(&["ExceedsMax"]) {
        Some(
            "the maximum number of processes is connected: end one, such as a `skillet watch` \
             or `skillet record`, and try again",
        )
    } else if says(&["Incompatible", "VersionMismatch", "DoesNotSupport"]) {
        Some("controller, learner and tool must be the same build: restart those from another one")
    } else if says(&["Permission"]) {
        Some(
            "the cell belongs to another user: run this as that user, or set SKILLET_RUNTIME_DIR to \
             your own folder",
        )
    } else {
        None
    }
}

/// About a controller that is there and cannot be reached, when it is this process that lacks something.
pub(crate) fn on_no_connection() -> Option<String> {
    by_need(open_files(), SharedMemory { free: None })
}

/// Open files of this process and how many it may have.
#[derive(Clone, Copy)]
struct OpenFiles {
    open: u64,
    limit: u64,
}

/// Bytes of shared memory, unknown where it cannot be asked.
#[derive(Clone, Copy)]
struct SharedMemory {
    free: Option<u64>,
}

fn open_files() -> OpenFiles {
    // Without a free one they cannot be counted: then all of them are open.
    let limit = getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX);
    let open = std::fs::read_dir("/proc/self/fd").map_or(limit, |files| files.count() as u64);
    OpenFiles { open, limit }
}

fn shared_memory() -> SharedMemory {
    let free = rustix::fs::statvfs(SHARED_MEMORY).ok().map(|found| found.f_bavail * found.f_frsize);
    SharedMemory { free }
}

fn by_need(files: OpenFiles, memory: SharedMemory) -> Option<String> {
    if files.limit.saturating_sub(files.open) < FILES {
        return Some(on_open_files(files));
    }
    let free = memory.free.filter(|free| *free < SHARED_BYTES)?;
    Some(format!(
        "{SHARED_MEMORY} has {} MB free, and a cell needs up to {}: free some, or enlarge it",
        free >> 20,
        SHARED_BYTES >> 20
    ))
}

fn on_open_files(files: OpenFiles) -> String {
    let OpenFiles { open, limit } = files;
    format!(
        "this process may have {limit} files open and has {open}: raise the limit, as with `ulimit -n \
         1024` or LimitNOFILE= of its service"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const MANY: OpenFiles = OpenFiles { open: 10, limit: 1024 };
    const ROOMY: SharedMemory = SharedMemory { free: Some(1 << 30) };

    #[test]
    fn advice_fits_the_cause() {
        for (reason, words) in [
            ("ExceedsMaxSupportedClients", "end one"),
            ("ExceedsMaxNumberOfNodes", "end one"),
            ("IncompatibleAttributes", "same build"),
            ("DoesNotSupportRequestedAmountOfSubscribers", "same build"),
            ("InsufficientPermissions", "another user"),
        ] {
            let advice = on_transport(reason);
            assert!(advice.contains(words) && !advice.contains("shm"), "{reason}: {advice}");
        }
        assert_eq!(by_name("InternalFailure"), None);
        assert_eq!(by_need(MANY, ROOMY), None, "then it is something else");
        let few = by_need(OpenFiles { open: 12, limit: 20 }, ROOMY).unwrap();
        assert!(few.contains("20 files") && few.contains("ulimit -n"), "{few}");
        let full = by_need(MANY, SharedMemory { free: Some(3 << 20) }).unwrap();
        assert!(full.contains("/dev/shm has 3 MB free"), "{full}");
        assert_eq!(by_need(MANY, SharedMemory { free: None }), None);
    }

    #[test]
    fn a_folder_that_cannot_be_used_is_told_apart() {
        for (errno, words) in [
            (Errno::MFILE, "ulimit -n"),
            (Errno::NFILE, "fs.file-max"),
            (Errno::NOSPC, "space"),
            (Errno::ROFS, "read-only"),
            (Errno::ACCESS, "permissions"),
            (Errno::NOTDIR, "path"),
        ] {
            let advice = on_io(&errno.into());
            assert!(advice.contains(words), "{errno:?}: {advice}");
            assert_eq!(advice.contains("space"), errno == Errno::NOSPC, "{errno:?}: {advice}");
        }
    }
}
