//! Memory: room for what a cell shares, and nothing swapped.

use super::{Finding, Grade, Subject, good, not_good, unknown};
use crate::host::Root;

/// What one cell keeps in /dev/shm: 36 MB, of which 22 MB are the segment of episodes (room for 14
/// of 4000 records). `tests/doctor.rs` compares it with a running cell.
pub const CELL_BYTES: u64 = 40 << 20;
/// With less, the kernel reclaims pages from other processes.
const AVAILABLE_BYTES: u64 = 256 << 20;
const SWAPPINESS: i64 = 10;

/// A file system, bytes.
#[derive(Clone, Copy, Debug)]
pub struct Space {
    pub size: u64,
    pub free: u64,
}

pub fn space(root: Root) -> Option<Space> {
    let found = rustix::fs::statvfs(root.path("dev/shm")).ok()?;
    Some(Space { size: found.f_blocks * found.f_frsize, free: found.f_bavail * found.f_frsize })
}

pub fn shared_memory(subject: &Subject) -> Finding {
    let fix = "sudo mount -o remount,size=256M /dev/shm, or `--shm-size 256m` of the container";
    let Some(Space { size, free }) = subject.space else {
        return not_good(
            Grade::Poor,
            "/dev/shm is absent",
            "sudo mount -t tmpfs -o size=256M tmpfs /dev/shm",
        );
    };
    let found = format!(
        "{} of {} MiB free in /dev/shm, a cell needs {} MiB",
        free >> 20,
        size >> 20,
        CELL_BYTES >> 20
    );
    match free {
        free if free < CELL_BYTES => not_good(Grade::Poor, found, fix),
        // Two cells at once: a session learns while another one is looked at.
        free if free < 2 * CELL_BYTES => not_good(Grade::Fair, found, fix),
        _ => good(found),
    }
}

pub fn swap(subject: &Subject) -> Finding {
    let bytes = |key: &str| -> Option<u64> {
        let value = subject.root.value("proc/meminfo", key)?;
        Some(value.split(' ').next()?.parse::<u64>().ok()? << 10)
    };
    let (Some(available), Some(total), Some(free)) =
        (bytes("MemAvailable"), bytes("SwapTotal"), bytes("SwapFree"))
    else {
        return unknown("/proc/meminfo cannot be read");
    };
    let swappiness = subject.root.number("proc/sys/vm/swappiness").unwrap_or(60);
    let used = total.saturating_sub(free);
    let found = format!(
        "{} MiB available, {} of {} MiB swap in use, swappiness {swappiness}",
        available >> 20,
        used >> 20,
        total >> 20
    );
    if available < AVAILABLE_BYTES {
        return not_good(Grade::Poor, found, "end what uses the memory, see `ps aux --sort -rss`");
    }
    match (total, used) {
        (0, _) => good(found),
        (_, 0) if swappiness <= SWAPPINESS => good(found),
        (_, 0) => not_good(Grade::Fair, found, "sudo sysctl vm.swappiness=1"),
        _ => not_good(Grade::Fair, found, "sudo swapoff -a"),
    }
}
