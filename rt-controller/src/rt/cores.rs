//! The loop's core, and the threads kept off it.

use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

/// The core of the rt thread: the configured one, else the last this process may use.
pub fn loop_core(configured: Option<usize>) -> usize {
    let last = || (0..CpuSet::MAX_CPU).rev().find(|core| allowed().is_set(*core));
    configured.or_else(last).unwrap_or(0)
}

/// Keeps the calling thread, and whatever it starts from now on, off the loop's core. Priorities
/// alone do not suffice: while a process starts or dies, the kernel occupies the core.
/// `false` when there is no other core to go to.
pub fn leave_core(core: usize) -> bool {
    let mut others = allowed();
    if core < CpuSet::MAX_CPU {
        others.unset(core);
    }
    others.count() > 0 && sched_setaffinity(None, &others).is_ok()
}

/// Cores the calling thread may use; none when nobody can tell.
fn allowed() -> CpuSet {
    sched_getaffinity(None).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loops_core_is_left_unless_it_is_the_only_one() {
        let before = allowed();
        let core = loop_core(None);
        assert!(before.is_set(core));
        assert_eq!(loop_core(Some(7)), 7);

        assert_eq!(leave_core(core), before.count() > 1);
        let mut expected = before;
        if before.count() > 1 {
            expected.unset(core);
        }
        assert_eq!(allowed(), expected);
        assert!(std::thread::spawn(move || allowed() == expected).join().unwrap());

        while leave_core(loop_core(None)) {}
        assert_eq!(allowed().count(), 1, "a thread keeps a core to run on");
    }
}
