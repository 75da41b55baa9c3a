//! `skillet doctor`: whether this host keeps a hard real-time loop on time, one check a function.
//!
//! Everything is read below a root, so that tests can show each check a good host and a bad one.

pub mod attempt;
mod cores;
mod kernel;
mod memory;
mod neighbours;
mod rights;
#[cfg(test)]
mod tests;

use serde::Serialize;

use crate::host::Root;
use attempt::Attempt;
use memory::Space;

/// How well something serves a hard real-time loop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Grade {
    Good,
    /// Works, with late ticks now and then.
    Fair,
    /// Ticks will be late, or nothing starts.
    Poor,
    /// The host does not say.
    Unknown,
}

impl Grade {
    pub fn name(self) -> &'static str {
        match self {
            Grade::Good => "good",
            Grade::Fair => "fair",
            Grade::Poor => "poor",
            Grade::Unknown => "unknown",
        }
    }
}

/// One property of the host.
#[derive(Clone, Debug, Serialize)]
pub struct Check {
    pub name: &'static str,
    pub verdict: Grade,
    pub found: String,
    pub why: &'static str,
    /// The fix; absent if the check is good or nothing can be done.
    pub fix: Option<String>,
}

/// The result of a check: grade, description, fix.
type Finding = (Grade, String, Option<String>);

fn good(found: impl Into<String>) -> Finding {
    (Grade::Good, found.into(), None)
}

fn not_good(grade: Grade, found: impl Into<String>, fix: impl Into<String>) -> Finding {
    (grade, found.into(), Some(fix.into()))
}

fn unknown(found: impl Into<String>) -> Finding {
    (Grade::Unknown, found.into(), None)
}

/// The host and the loop that is to run on it.
pub struct Subject<'a> {
    pub root: Root<'a>,
    /// SCHED_FIFO priority and core of the loop.
    pub priority: u8,
    pub core: usize,
    /// The result of requesting real time, or why the request failed.
    pub attempt: Result<Attempt, String>,
    pub space: Option<Space>,
}

/// Name, reason and function of a check.
type Entry = (&'static str, &'static str, fn(&Subject) -> Finding);

/// Every check, in the order of the report.
const CHECKS: [Entry; 18] = [
    ("kernel preemption", "a kernel that cannot be interrupted delays ticks", kernel::preemption),
    (
        "real-time throttling",
        "tasks that exhaust the real-time budget are stopped",
        kernel::throttling,
    ),
    ("clock source", "every tick reads the clock several times", kernel::clock_source),
    ("priority limit", "without SCHED_FIFO any process delays ticks", rights::priority_limit),
    ("memory lock limit", "a page fault in a tick waits for the kernel", rights::memory_lock),
    ("real time granted", "limits are promises; this is an actual request", rights::granted),
    ("cores", "the loop needs a core besides the learner's", cores::count),
    ("frequency governor", "a core that speeds up slowly delays ticks", cores::governor),
    ("idle states", "waking from a deep state costs more than a tick", cores::idle_states),
    ("isolated core", "other tasks on the loop's core delay it", cores::isolated),
    ("interrupts", "interrupts on the loop's core delay it", cores::interrupts),
    ("SMT", "the other thread of the core slows ticks down", cores::smt),
    ("shared memory", "controller and learner meet there", memory::shared_memory),
    ("memory and swap", "swapped-out memory is slow to return", memory::swap),
    ("other real-time tasks", "they preempt the loop", neighbours::realtime_tasks),
    ("virtual machine", "the hypervisor may take the core away", neighbours::hypervisor),
    ("CPU quota", "a group that exceeds its quota is stopped", neighbours::quota),
    ("allowed cores", "the loop must be allowed on its core", neighbours::allowed_cores),
];

pub fn examine(subject: &Subject) -> Vec<Check> {
    let check = |&(name, why, check): &Entry| {
        let (verdict, found, fix) = check(subject);
        Check { name, verdict, found, why, fix }
    };
    CHECKS.iter().map(check).collect()
}

/// The worst of the grades; unknown is not good.
pub fn overall(checks: &[Check]) -> Grade {
    let any = |grade| checks.iter().any(|check| check.verdict == grade);
    match (any(Grade::Poor), any(Grade::Fair) || any(Grade::Unknown)) {
        (true, _) => Grade::Poor,
        (false, true) => Grade::Fair,
        (false, false) => Grade::Good,
    }
}

/// The space of the shared memory of this host.
pub fn shared_memory_space(root: Root) -> Option<Space> {
    memory::space(root)
}
