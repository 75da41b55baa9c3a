//! Memory lock, idle states, priority and affinity of the rt thread.

#![allow(unsafe_code)] // sched_setscheduler has no safe wrapper

use std::fs::{File, OpenOptions};
use std::io::Write;

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::thread::{CpuSet, sched_setaffinity};

/// Held open with 0 written to it, it keeps cores out of deep idle states, whose way back costs
/// more than a short tick (wake-up p50 23 µs with it, 50 µs without, on a virtual machine).
const CPU_LATENCY: &str = "/dev/cpu_dma_latency";

/// What the host granted; some of it only as long as this lives.
#[derive(Debug, Default)]
pub struct Privileges {
    /// SCHED_FIFO at the asked priority.
    pub fifo: bool,
    /// What is missing and how to get it, one line each.
    pub missing: Vec<String>,
    _awake: Option<File>,
}

/// Asks for real time on behalf of the calling thread. Nothing here is fatal: without privileges
/// the loop runs with normal priority, and says so once.
pub fn acquire(priority: u8, core: usize) -> Privileges {
    let mut granted = Privileges::default();
    if let Err(error) = mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE) {
        granted.missing.push(format!(
            "memory is not locked ({error}): raise `ulimit -l` or grant CAP_IPC_LOCK"
        ));
    }
    match stay_awake() {
        Ok(file) => granted._awake = Some(file),
        Err(error) => granted.missing.push(format!(
            "deep idle states are not disabled ({CPU_LATENCY}: {error}): make it writable"
        )),
    }

    let mut set = CpuSet::new();
    if core < CpuSet::MAX_CPU {
        set.set(core);
    }
    if let Err(error) = sched_setaffinity(None, &set) {
        granted.missing.push(format!(
            "not pinned to core {core} ({error}): set controller.cpu to one this process may use"
        ));
    }

    let result = set_policy(libc::SCHED_FIFO, priority);
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

/// A raised priority of the calling thread, until dropped.
#[derive(Debug)]
pub struct Raised(());

impl Raised {
    /// SCHED_FIFO, below every loop that matters; `None` without the privilege.
    pub fn to(priority: u8) -> Option<Raised> {
        (set_policy(libc::SCHED_FIFO, priority) == 0).then_some(Raised(()))
    }
}

impl Drop for Raised {
    fn drop(&mut self) {
        set_policy(libc::SCHED_OTHER, 0);
    }
}

/// Sets the scheduling policy of the calling thread; returns 0 on success.
fn set_policy(policy: i32, priority: u8) -> i32 {
    // SAFETY: sched_param is a plain C struct for which all zeros is valid; pid 0 is this thread.
    unsafe {
        let mut parameters: libc::sched_param = std::mem::zeroed();
        parameters.sched_priority = i32::from(priority);
        libc::sched_setscheduler(0, policy, &parameters)
    }
}

fn stay_awake() -> std::io::Result<File> {
    let mut file = OpenOptions::new().write(true).open(CPU_LATENCY)?;
    file.write_all(&0_u32.to_ne_bytes())?;
    Ok(file)
}
