//! After a fault under a new policy the last good one is served again, and after one of its own the
//! arm is held.

mod common;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use common::{Stopping, message, wam};
use physics::arm::JointVector;
use physics::ideal::IdealArm;
use physics::outcome::OutcomeConfig;
use physics::pancake::WAM7_START_POSTURE;
use physics::plant::{Measurement, Plant};
use rt_controller::run::Controlled;
use rt_controller::{ControllerConfig, Pace};
use shm_types::cell::Cell;
use shm_types::command::{
    AT_NOW, COMMAND_ACTIVATE, COMMAND_IMPORT, COMMAND_PIN, COMMAND_STOP, Command, Status,
};
use shm_types::ports::ToolPorts;

const SOON: Duration = Duration::from_secs(30);

/// An arm whose encoders fail above a height that the gentle policy never reaches, or everywhere.
struct Failing<'a> {
    arm: IdealArm<'a>,
    everywhere: &'a AtomicBool,
}

impl Plant for Failing<'_> {
    fn reset(&mut self) {
        self.arm.reset();
    }

    fn measure(&self) -> Measurement {
        let mut measured = self.arm.measure();
        // The object lies 5 mm above the pan.
        let is_high = measured.object.p_WO.z > 0.725 + 0.012;
        let moves = measured.qd.abs().max() > 1e-3;
        if is_high || (self.everywhere.load(Ordering::Relaxed) && moves) {
            measured.qd[2] = f64::NAN;
        }
        measured
    }

    fn apply(&mut self, tau: &JointVector) {
        self.arm.apply(tau);
    }

    fn advance(&mut self) {
        self.arm.advance();
    }
}

fn eventually(what: &str, tool: &ToolPorts, is_so: impl Fn(&Status) -> bool) -> Status {
    let start = Instant::now();
    while start.elapsed() < SOON {
        let status = tool.status(SOON).expect("an answer");
        if is_so(&status) {
            return status;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    panic!("{what}: not within {SOON:?}");
}

#[test]
fn a_fault_leads_back_by_itself() {
    let cell = Cell::new(&format!("back-{}", std::process::id())).unwrap();
    let config = ControllerConfig::default();
    let (stop, everywhere) = (AtomicBool::new(false), AtomicBool::new(false));
    std::thread::scope(|scope| {
        let controller = scope.spawn(|| {
            let model = wam();
            let arm = IdealArm::new(&model, &WAM7_START_POSTURE, config.period_s(), 0.01);
            let mut plant = Failing { arm, everywhere: &everywhere };
            let outcome = OutcomeConfig::default();
            let (plant, q0) = (&mut plant, WAM7_START_POSTURE);
            let controlled = Controlled { model: &model, plant, q0, outcome };
            rt_controller::run(&cell, &config, Pace::Max, controlled, None, &stop).unwrap();
        });
        let _stopping = Stopping(&stop);
        let tool = ToolPorts::open(&cell, SOON).unwrap();
        let mut id = 0;
        let mut ask = |command: Command| {
            id += 1;
            let reply = tool.request(&Command { id, ..command }, SOON).expect("an answer");
            assert_eq!(reply.accepted, 1, "{}", reply.reason_text());
            reply.policy.policy_id
        };
        let import = |policy| Command { policy, ..Command::new(COMMAND_IMPORT, 0) };
        let gentle = ask(import(message(0.005, 200.0)));
        let high = ask(import(message(0.08, 200.0)));
        let activate =
            |policy_id| Command { policy_id, at: AT_NOW, ..Command::new(COMMAND_ACTIVATE, 0) };
        ask(activate(gentle));
        ask(Command::new(COMMAND_PIN, 0));
        eventually("proof", &tool, |status| status.last_good.policy_id == gentle);
        ask(activate(high));
        let back = eventually("the way back", &tool, |status| status.rollbacks == 1);
        assert_eq!((back.active.policy_id, back.pinned), (gentle, 1));
        let served = back.rollouts_served;
        eventually("service", &tool, |status| status.rollouts_served > served + 2);

        everywhere.store(true, Ordering::Relaxed);
        let held = eventually("the hold", &tool, |status| status.active.is_none());
        assert_eq!((held.rollbacks, held.pinned), (1, 0), "there is nothing left to go back to");
        assert!(held.last_good.is_none());
        let served = held.rollouts_served;
        std::thread::sleep(Duration::from_millis(50));
        assert_eq!(tool.status(SOON).unwrap().rollouts_served, served, "the arm is held");
        ask(Command::new(COMMAND_STOP, 0));
        controller.join().unwrap();
    });
    cell.remove_if_idle();
}
