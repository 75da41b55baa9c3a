//! A loop that is late too often holds the arm and says so; one that cannot keep up is not started.

mod common;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use common::{Stopping, message, wam};
use physics::arm::JointVector;
use physics::ideal::IdealArm;
use physics::outcome::OutcomeConfig;
use physics::pancake::WAM7_START_POSTURE;
use physics::plant::{Measurement, Plant};
use rt_controller::fault::Fault;
use rt_controller::run::{Controlled, RunError};
use rt_controller::{ControllerConfig, Pace};
use shm_types::cell::Cell;
use shm_types::command::{AT_NOW, COMMAND_ACTIVATE, COMMAND_IMPORT, COMMAND_STOP, Command};
use shm_types::ports::ToolPorts;

const SOON: Duration = Duration::from_secs(30);

/// An arm whose driver takes longer than two periods, always or once it is asked to.
struct Slow<'a> {
    arm: IdealArm<'a>,
    is_slow: &'a AtomicBool,
}

impl Plant for Slow<'_> {
    fn reset(&mut self) {
        self.arm.reset();
    }

    fn measure(&self) -> Measurement {
        self.arm.measure()
    }

    fn apply(&mut self, tau: &JointVector) {
        self.arm.apply(tau);
    }

    fn advance(&mut self) {
        self.arm.advance();
        if self.is_slow.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_micros(4500));
        }
    }
}

fn config() -> ControllerConfig {
    ControllerConfig { period_us: 2000, overruns_max: 5, ..Default::default() }
}

fn run(cell: &Cell, is_slow: &AtomicBool, stop: &AtomicBool) -> Result<(), RunError> {
    let model = wam();
    let config = config();
    let arm = IdealArm::new(&model, &WAM7_START_POSTURE, config.period_s(), 0.01);
    let mut plant = Slow { arm, is_slow };
    let (plant, q0, outcome) = (&mut plant, WAM7_START_POSTURE, OutcomeConfig::default());
    let controlled = Controlled { model: &model, plant, q0, outcome };
    rt_controller::run(cell, &config, Pace::Realtime, controlled, None, stop).map(|_| ())
}

#[test]
fn late_ticks_in_a_row_hold_the_arm_and_a_rollout_in_time_runs_again() {
    let cell = Cell::new(&format!("late-{}", std::process::id())).unwrap();
    let (stop, is_slow) = (AtomicBool::new(false), AtomicBool::new(false));
    std::thread::scope(|scope| {
        let controller = scope.spawn(|| run(&cell, &is_slow, &stop));
        let _stopping = Stopping(&stop);
        let tool = ToolPorts::open(&cell, SOON).unwrap();
        let mut id = 0;
        let mut ask = |command: Command| {
            id += 1;
            let reply = tool.request(&Command { id, ..command }, SOON).expect("an answer");
            assert_eq!(reply.accepted, 1, "{}", reply.reason_text());
        };
        let fault_is = |fault: Fault| {
            let start = Instant::now();
            while tool.status(SOON).unwrap().fault != fault as u64 {
                assert!(start.elapsed() < SOON, "no fault '{fault:?}'");
                std::thread::sleep(Duration::from_millis(5));
            }
        };
        let policy = message(0.005, 200.0);
        ask(Command { policy, ..Command::new(COMMAND_IMPORT, 0) });
        let activate = Command { policy_id: 1, at: AT_NOW, ..Command::new(COMMAND_ACTIVATE, 0) };
        ask(activate);
        is_slow.store(true, Ordering::Relaxed);
        fault_is(Fault::Overrun);
        let status = tool.status(SOON).unwrap();
        assert!(status.deadline_misses >= 5, "{} misses", status.deadline_misses);
        assert_eq!(status.rollbacks, 0, "the policy is not to blame");
        is_slow.store(false, Ordering::Relaxed);
        std::thread::sleep(Duration::from_millis(50));
        ask(activate);
        fault_is(Fault::None);
        ask(Command::new(COMMAND_STOP, 0));
        controller.join().unwrap().unwrap();
    });
    cell.remove_if_idle();
}

#[test]
fn a_period_that_cannot_be_held_is_refused_with_one_that_can() {
    let cell = Cell::new(&format!("slow-{}", std::process::id())).unwrap();
    let (stop, is_slow) = (AtomicBool::new(false), AtomicBool::new(true));
    let refused = run(&cell, &is_slow, &stop).unwrap_err();
    let RunError::Period { period_us, needed_us, enough_us } = refused else { panic!("{refused}") };
    assert_eq!(period_us, 2000);
    assert!(needed_us >= 4500.0 && enough_us > needed_us, "{needed_us} µs, {enough_us} µs");
}
