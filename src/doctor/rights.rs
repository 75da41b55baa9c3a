//! What this user may have: priority, locked memory, and whether the loop's own request is granted.

use super::{Finding, Grade, Subject, good, not_good, unknown};
use crate::host::Root;

/// Bits of the effective capabilities.
const CAP_IPC_LOCK: u32 = 14;
const CAP_SYS_NICE: u32 = 23;
/// A controller has 120 MB locked and 190 MB at its peak.
const LOCKED_BYTES: u64 = 256 << 20;

pub fn priority_limit(subject: &Subject) -> Finding {
    if has_capability(subject.root, CAP_SYS_NICE) {
        return good("CAP_SYS_NICE");
    }
    let Some(limit) = soft_limit(subject.root, "Max realtime priority") else {
        return unknown("/proc/self/limits cannot be read");
    };
    let found = format!("limit {limit}, the loop asks for {}", subject.priority);
    if limit >= u64::from(subject.priority) {
        return good(found);
    }
    not_good(Grade::Poor, found, with_limit("rtprio 98"))
}

pub fn memory_lock(subject: &Subject) -> Finding {
    if has_capability(subject.root, CAP_IPC_LOCK) {
        return good("CAP_IPC_LOCK");
    }
    let Some(limit) = soft_limit(subject.root, "Max locked memory") else {
        return unknown("/proc/self/limits cannot be read");
    };
    if limit == u64::MAX {
        return good("unlimited");
    }
    let found = format!("limit {} MiB, the loop needs {} MiB", limit >> 20, LOCKED_BYTES >> 20);
    if limit >= LOCKED_BYTES {
        return good(found);
    }
    not_good(Grade::Poor, found, with_limit("memlock unlimited"))
}

pub fn granted(subject: &Subject) -> Finding {
    let attempt = match &subject.attempt {
        Ok(attempt) => attempt,
        Err(why) => return unknown(why),
    };
    let fifo = format!("SCHED_FIFO priority {}", subject.priority);
    if attempt.missing.is_empty() {
        return good(format!("{fifo}, memory locked, core {}, awake", subject.core));
    }
    let grade = if attempt.fifo { Grade::Fair } else { Grade::Poor };
    let found = attempt.missing.join("; ");
    not_good(
        grade,
        found,
        "fix the limits above; in a container also use `--cap-add SYS_NICE --cap-add IPC_LOCK`",
    )
}

fn with_limit(limit: &str) -> String {
    format!(
        "`echo \"$USER - {limit}\" | sudo tee -a /etc/security/limits.d/skillet.conf` and log in \
         again, or `sudo setcap cap_sys_nice,cap_ipc_lock+ep \"$(command -v skillet)\"`"
    )
}

fn has_capability(root: Root, bit: u32) -> bool {
    let mask = root.value("proc/self/status", "CapEff");
    mask.and_then(|mask| u64::from_str_radix(&mask, 16).ok())
        .is_some_and(|mask| mask >> bit & 1 == 1)
}

fn soft_limit(root: Root, name: &str) -> Option<u64> {
    let line = root.value("proc/self/limits", name)?;
    match line.split_whitespace().next()? {
        "unlimited" => Some(u64::MAX),
        number => number.parse().ok(),
    }
}
