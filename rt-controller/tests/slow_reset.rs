//! A plant that takes its time to be put back to its start: the arm is held meanwhile, and the rollout
//! waits.

mod common;

use std::time::Instant;

use common::service::{Operator, SOON, Service};
use common::{message, wam};
use physics::arm::JointVector;
use physics::ideal::IdealArm;
use physics::pancake::WAM7_START_POSTURE;
use physics::plant::{Measurement, Plant};
use rt_controller::{ControllerConfig, Pace};
use shm_types::episode::EpisodeHeader;
use shm_types::policy::PolicyMsg;
use shm_types::ports::LearnerPorts;

/// Periods that a reset takes.
const RESET_TICKS: u64 = 300;

struct Slow<'a> {
    arm: IdealArm<'a>,
    /// Until it is ready.
    left: u64,
    /// Farthest that a joint was from the start posture while nothing was ready, rad.
    moved: f64,
}

impl Plant for Slow<'_> {
    fn is_simulated(&self) -> bool {
        true
    }

    fn begin_reset(&mut self) {
        self.arm.begin_reset();
        self.left = RESET_TICKS;
    }

    fn is_ready(&self) -> bool {
        self.left == 0
    }

    fn measure(&self) -> Measurement {
        self.arm.measure()
    }

    fn apply(&mut self, tau: &JointVector) {
        self.arm.apply(tau);
    }

    fn advance(&mut self) {
        self.arm.advance();
        if self.left > 0 {
            self.left -= 1;
            self.moved = self.moved.max((self.arm.measure().q - WAM7_START_POSTURE).abs().max());
        }
    }
}

fn ask(ports: &LearnerPorts, rollout: u64) -> EpisodeHeader {
    let policy =
        PolicyMsg { session: 7, rollout, policy_id: rollout, ..message(0.02, 200.0) }.sealed();
    ports.policies.send_copy(policy).unwrap();
    let start = Instant::now();
    while start.elapsed() < SOON {
        if let Ok(Some(sample)) = ports.episodes.receive() {
            return *sample.user_header();
        }
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    panic!("no episode within {SOON:?}");
}

#[test]
fn a_rollout_begins_when_the_plant_is_ready_and_the_arm_is_held_until_then() {
    let (model, config) = (wam(), ControllerConfig::default());
    let arm = IdealArm::new(&model, &WAM7_START_POSTURE, config.period_s(), 0.01);
    let mut plant = Slow { arm, left: 0, moved: 0.0 };
    let service =
        Service { name: "slow", model: &model, config: &config, pace: Pace::Max, state: None };
    service.run(&mut plant, |operator: &Operator| {
        let ports = LearnerPorts::open(operator.cell, SOON, &|| false).unwrap();
        let mut ended = 0;
        for rollout in 1..=3 {
            let header = ask(&ports, rollout);
            assert_eq!((header.fault, header.rollout), (0, rollout));
            let waited = header.applied_tick - ended;
            assert!(waited >= RESET_TICKS, "rollout {rollout} began after {waited} ticks");
            ended = header.applied_tick + header.n_records;
        }
    });
    assert!(plant.moved < 1e-3, "the arm moved by {} rad while it was to be held", plant.moved);
}
