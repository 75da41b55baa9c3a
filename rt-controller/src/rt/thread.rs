//! Memory lock, priority and affinity of the rt thread.

#![allow(unsafe_code)] // sched_setscheduler has no safe wrapper

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::thread::{CpuSet, sched_setaffinity};

/// What the host granted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Privileges {
    /// SCHED_FIFO at the asked priority.
    pub fifo: bool,
    /// All pages stay in memory.
    pub locked: bool,
    /// The core the thread is pinned to.
    pub cpu: Option<usize>,
    /// What is missing and how to get it, one line each.
    pub missing: Vec<String>,
}

/// Asks for real time on behalf of the calling thread. Nothing here is fatal: without privileges
/// the loop runs with normal priority, and says so once.
pub fn acquire(priority: u8, cpu: Option<usize>) -> Privileges {
    let mut granted = Privileges::default();
    match mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE) {
        Ok(()) => granted.locked = true,
        Err(error) => granted.missing.push(format!(
            "memory is not locked ({error}): raise `ulimit -l` or grant CAP_IPC_LOCK"
        )),
    }

    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    let core = cpu.unwrap_or(cores - 1);
    let mut set = CpuSet::new();
    if core < CpuSet::MAX_CPU {
        set.set(core);
    }
    match sched_setaffinity(None, &set) {
        Ok(()) => granted.cpu = Some(core),
        Err(error) => granted
            .missing
            .push(format!("not pinned to core {core} ({error}): set controller.cpu below {cores}")),
    }

    // SAFETY: sched_param is a plain C struct for which all zeros is valid; pid 0 is this thread.
    let result = unsafe {
        let mut parameters: libc::sched_param = std::mem::zeroed();
        parameters.sched_priority = i32::from(priority);
        libc::sched_setscheduler(0, libc::SCHED_FIFO, &parameters)
    };
    if result == 0 {
        granted.fifo = true;
    } else {
        let error = std::io::Error::last_os_error();
        granted.missing.push(format!(
            "no SCHED_FIFO priority {priority} ({error}): raise `ulimit -r` or grant CAP_SYS_NICE"
        ));
    }
    granted
}
