//! Nothing is served that has not passed the dry run (ADR 11): not a proposal that succeeded, not
//! what an earlier run served under other settings.
#![allow(non_snake_case)] // frames: X_WP is the pose of P in W

mod common;

use std::path::PathBuf;
use std::time::Instant;

use common::service::{Operator, SOON, Service};
use common::{message, wam};
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use physics::arm::{ArmModel, JointVector, kinematics};
use physics::ideal::IdealArm;
use physics::pancake::WAM7_START_POSTURE;
use physics::plant::{Measurement, ObjectState, Plant};
use rt_controller::{ControllerConfig, Pace};
use shm_types::command::Status;
use shm_types::episode::{EpisodeHeader, OUTCOME_SUCCESS};
use shm_types::policy::PolicyMsg;
use shm_types::ports::LearnerPorts;

/// Ticks before the toss, and its speed, m/s.
const TOSS_TICK: u64 = 400;
const TOSS_SPEED: f64 = 2.5;
const GRAVITY: f64 = 9.81;

/// An ideal arm whose pancake flips by itself in every rollout, whatever the pan does.
struct Juggler<'a> {
    model: &'a ArmModel,
    arm: IdealArm<'a>,
    ticks: u64,
}

impl<'a> Juggler<'a> {
    fn new(model: &'a ArmModel, config: &ControllerConfig) -> Juggler<'a> {
        let arm = IdealArm::new(model, &WAM7_START_POSTURE, config.period_s(), 0.01);
        Juggler { model, arm, ticks: 0 }
    }
}

impl Plant for Juggler<'_> {
    fn is_simulated(&self) -> bool {
        true
    }

    fn reset(&mut self) {
        self.arm.reset();
        self.ticks = 0;
    }

    fn measure(&self) -> Measurement {
        let measured = self.arm.measure();
        let flight_s = 2.0 * TOSS_SPEED / GRAVITY;
        let t = (self.ticks.saturating_sub(TOSS_TICK) as f64 * 1e-3).min(flight_s);
        let height = TOSS_SPEED * t - GRAVITY / 2.0 * t * t;
        let turn = UnitQuaternion::from_axis_angle(
            &Vector3::y_axis(),
            std::f64::consts::PI * t / flight_s,
        );
        let X_WP = kinematics::tip_pose(self.model, &measured.q);
        let X_WO = X_WP * Translation3::new(0.0, 0.0, 0.005) * turn;
        let p_WO = X_WO.translation.vector + Vector3::z() * height;
        let in_contact = t == 0.0 || t == flight_s;
        Measurement { object: ObjectState { p_WO, R_WO: X_WO.rotation, in_contact }, ..measured }
    }

    fn apply(&mut self, tau: &JointVector) {
        self.arm.apply(tau);
    }

    fn advance(&mut self) {
        self.arm.advance();
        self.ticks += 1;
    }
}

/// The wrist is clipped under it: the dry run refuses it.
fn clipped() -> PolicyMsg {
    message(0.15, 500.0)
}

fn propose(ports: &LearnerPorts, rollout: u64, policy: PolicyMsg) -> EpisodeHeader {
    let named = PolicyMsg { session: 7, rollout, policy_id: rollout, ..policy };
    ports.policies.send_copy(named.sealed()).unwrap();
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
fn a_proposal_that_succeeds_is_good_only_if_it_passes_the_dry_run() {
    let (model, config) = (wam(), ControllerConfig::default());
    let service =
        Service { name: "good", model: &model, config: &config, pace: Pace::Max, state: None };
    service.run(&mut Juggler::new(&model, &config), |operator: &Operator| {
        let ports = LearnerPorts::open(operator.cell, SOON, &|| false).unwrap();
        let is_good = |rollout: u64| move |status: &Status| status.last_good.rollout == rollout;
        for (rollout, policy) in
            [(1, message(0.02, 200.0)), (2, clipped()), (3, message(0.01, 200.0))]
        {
            let header = propose(&ports, rollout, policy);
            assert_eq!(header.fault, 0, "rollout {rollout}");
            assert!(header.outcome.has(OUTCOME_SUCCESS), "rollout {rollout}: {:?}", header.outcome);
            match rollout {
                2 => {
                    // Commands are answered after the dry run; whatever comes of it is there by then.
                    (0..200).for_each(|_| assert_eq!(operator.status().last_good.rollout, 1));
                }
                _ => drop(operator.until("the proof", is_good(rollout))),
            }
        }
    });
}

#[test]
fn what_an_earlier_run_served_is_dry_run_again() {
    let dir: PathBuf = std::env::temp_dir().join(format!("skillet-served-{}", std::process::id()));
    let model = wam();
    for (dry_run_clipped, restored) in [(1.0, 0), (0.0, 0), (1.0, 1)] {
        let config = ControllerConfig { dry_run_clipped, ..Default::default() };
        let service = Service {
            name: "again",
            model: &model,
            config: &config,
            pace: Pace::Max,
            state: Some(&dir),
        };
        service.run(&mut Juggler::new(&model, &config), |operator| {
            let status = operator.status();
            assert_eq!(status.active.policy_id, restored, "clipped: {dry_run_clipped}");
            assert_eq!(status.last_good.policy_id, restored, "clipped: {dry_run_clipped}");
            if dry_run_clipped == 1.0 {
                let id = operator.import(clipped());
                operator.activate(id);
                operator.until("the proof", |status| status.last_good.policy_id == id);
            }
        });
    }
    std::fs::remove_dir_all(&dir).unwrap();
}
