//! The rules of the whole rt thread, shown on a running cell: while policies are swapped into it
//! over the real transport, the thread touches no heap and makes no system call but the sleep.
//!
//! The plant is the spy: it is called on the rt thread, in every tick. The system calls are taken
//! away from the thread by a filter that kills the process; that test runs itself again as a child.

mod common;

use std::os::unix::process::ExitStatusExt;
use std::process::{Command as Process, Output};
use std::sync::atomic::{AtomicU64, Ordering};

use common::heap::{self, CountingAllocator};
use common::service::Service;
use common::{field, message, wam};
use physics::arm::JointVector;
use physics::ideal::IdealArm;
use physics::pancake::WAM7_START_POSTURE;
use physics::plant::{Measurement, Plant};
use rt_controller::{ControllerConfig, Pace, RunSummary};
use seccompiler::{SeccompAction, SeccompFilter, apply_filter};
use shm_types::cell::{Cell, runtime_dir};
use shm_types::command::{AT_NOW, COMMAND_ACTIVATE, COMMAND_PIN, COMMAND_POSTURE, Command};

/// Ticks of the spy.
static TICKS: AtomicU64 = AtomicU64::new(0);

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// What the spy does besides being an arm.
#[derive(Clone, Copy, PartialEq)]
enum Deed {
    /// Watches the heap for so many ticks.
    Watch(u64),
    /// The same, and allocates in one of them.
    WatchAndAllocate(u64),
    /// Gives every system call but the sleep away.
    Confine,
    /// The same, and writes to standard error in one tick.
    ConfineAndLog,
}

struct Spy<'a> {
    arm: IdealArm<'a>,
    deed: Deed,
    ticks: u64,
}

impl Plant for Spy<'_> {
    fn is_simulated(&self) -> bool {
        true
    }

    fn begin_reset(&mut self) {
        self.arm.begin_reset();
    }

    fn is_ready(&self) -> bool {
        true
    }

    fn measure(&self) -> Measurement {
        self.arm.measure()
    }

    fn apply(&mut self, tau: &JointVector) {
        self.arm.apply(tau);
    }

    fn advance(&mut self) {
        self.arm.advance();
        // The trial of the period runs elsewhere.
        if self.ticks == 0 && std::thread::current().name() != Some("skillet-rt") {
            return;
        }
        self.ticks += 1;
        TICKS.store(self.ticks, Ordering::Relaxed);
        match (self.deed, self.ticks) {
            (Deed::Watch(_) | Deed::WatchAndAllocate(_), 1) => heap::watch(heap::this_thread()),
            (Deed::Confine | Deed::ConfineAndLog, 1) => apply_filter(&only_sleep()).unwrap(),
            (Deed::WatchAndAllocate(_), 500) => drop(std::hint::black_box(Box::new(1))),
            (Deed::ConfineAndLog, 500) => eprintln!("a tick that logs"),
            (Deed::Watch(n) | Deed::WatchAndAllocate(n), ticks) if ticks == n => {
                heap::watch_nobody();
            }
            _ => {}
        }
    }
}

/// Kills the process at any other call than those of a sleep. Where the kernel's
/// clock is not mapped into the process, reading it is a call, too.
fn only_sleep() -> seccompiler::BpfProgram {
    let allowed = [libc::SYS_clock_nanosleep, libc::SYS_clock_gettime, libc::SYS_restart_syscall];
    let rules = allowed.into_iter().map(|call| (call, vec![])).collect();
    let (kill, pass) = (SeccompAction::KillProcess, SeccompAction::Allow);
    let arch = std::env::consts::ARCH.try_into().unwrap();
    SeccompFilter::new(rules, kill, pass, arch).unwrap().try_into().unwrap()
}

/// Runs a cell whose plant does `deed`, and swaps springs and a field of the state, and two postures, in turn
/// until `is_over`; returns the controller's summary and the swaps acknowledged.
fn run_cell(name: &str, pace: Pace, deed: Deed, is_over: impl Fn() -> bool) -> (RunSummary, u64) {
    let config = ControllerConfig { blend_s: 0.002, ..Default::default() };
    let model = wam();
    let arm = IdealArm::new(&model, &WAM7_START_POSTURE, config.period_s(), 0.01);
    let service = Service { name, model: &model, config: &config, pace, state: None };
    service.run(&mut Spy { arm, deed, ticks: 0 }, |operator| {
        let policies = [message(0.02, 200.0), field()].map(|p| operator.import(p));
        operator.activate(policies[0]);
        operator.ok(Command::new(COMMAND_PIN, 0));
        let swap =
            |policy_id| Command { policy_id, at: AT_NOW, ..Command::new(COMMAND_ACTIVATE, 0) };
        let mut swaps = 1;
        while !is_over() {
            // Too early is an answer, too: the last one is still fading in.
            swaps += operator.ask(swap(policies[swaps % 2])).accepted as usize;
            let posture = [0.0, 0.0, 0.2 * (swaps % 2) as f64, 0.0, 0.0, 0.0, 0.0];
            operator.ok(Command { posture, ..Command::new(COMMAND_POSTURE, 0) });
        }
        swaps as u64
    })
}

#[test]
fn the_loop_touches_no_heap_in_300_000_ticks_with_swaps() {
    // One after the other: there is one counter.
    let watch = |deed, n| {
        heap::forget_operations();
        TICKS.store(0, Ordering::Relaxed);
        let is_over = || TICKS.load(Ordering::Relaxed) > n;
        let (summary, swaps) = run_cell("heap", Pace::Max, deed, is_over);
        (summary, swaps, heap::operations())
    };
    let (summary, swaps, operations) = watch(Deed::Watch(300_000), 300_000);
    assert!(summary.ticks >= 300_000, "only {} ticks", summary.ticks);
    // Not more in as many ticks: between two of them the exchange thread tries postures on ideal arms.
    assert!(swaps > 20 && summary.swaps == swaps, "{swaps} of {}", summary.swaps);
    assert_eq!(operations, 0, "in {} ticks with {swaps} swaps", summary.ticks);

    let (_, _, operations) = watch(Deed::WatchAndAllocate(1000), 1000);
    assert_eq!(operations, 2, "the guard sees a tick that allocates");
}

/// Runs one test of this file as a process of its own.
fn again(test: &str) -> Output {
    let arguments = ["--exact", test, "--ignored", "--nocapture"];
    Process::new(std::env::current_exe().unwrap()).args(arguments).output().unwrap()
}

#[test]
fn the_loop_makes_no_system_call_but_the_sleep() {
    let good = again("confined");
    let leftovers = || ["calls-", "logs-"].map(|cell| Cell::remove_idle(&runtime_dir(), cell));
    leftovers();
    let said = String::from_utf8_lossy(&good.stderr).into_owned();
    assert_eq!(good.status.code(), Some(0), "{:?}: {said}", good.status);
    let bad = again("confined_and_logging");
    leftovers();
    assert_eq!(bad.status.signal(), Some(libc::SIGSYS), "the filter catches a tick that logs");
}

/// The confined thread cannot even end: the process ends around it.
fn end_after_3000_ticks() -> bool {
    if TICKS.load(Ordering::Relaxed) > 3000 {
        std::process::exit(0);
    }
    false
}

#[test]
#[ignore = "ends its process; run by the test above"]
fn confined() {
    run_cell("calls", Pace::Realtime, Deed::Confine, end_after_3000_ticks);
}

#[test]
#[ignore = "ends its process; run by the test above"]
fn confined_and_logging() {
    run_cell("logs", Pace::Realtime, Deed::ConfineAndLog, end_after_3000_ticks);
}
