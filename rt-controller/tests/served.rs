//! Nothing is served that has not passed the dry run (ADR 11): not a proposal that succeeded, not
//! what an earlier run served under other settings.

mod common;

use std::path::PathBuf;
use std::time::Instant;

use common::service::{Operator, SOON, Service};
use common::{message, wam};
use physics::arm::ArmModel;
use physics::ideal::IdealArm;
use physics::pancake::WAM7_START_POSTURE;
use rt_controller::{ControllerConfig, Pace};
use shm_types::SCHEMA;
use shm_types::command::Status;
use shm_types::episode::{Ack, EpisodeHeader};
use shm_types::policy::PolicyMsg;
use shm_types::ports::LearnerPorts;

fn arm<'a>(model: &'a ArmModel, config: &ControllerConfig) -> IdealArm<'a> {
    IdealArm::new(model, &WAM7_START_POSTURE, config.period_s(), 0.01)
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
    service.run(&mut arm(&model, &config), |operator: &Operator| {
        let ports = LearnerPorts::open(operator.cell, SOON, &|| false).unwrap();
        let is_good = |rollout: u64| move |status: &Status| status.last_good.rollout == rollout;
        let proposals = [
            (1, message(0.02, 200.0), 1, 1),
            (2, clipped(), 1, 1),
            // What the learner calls no success, and what it says of another rollout.
            (3, message(0.01, 200.0), 0, 1),
            (4, message(0.03, 200.0), 1, 4),
        ];
        for (rollout, policy, success, good) in proposals {
            let header = propose(&ports, rollout, policy);
            assert_eq!(header.fault, 0, "rollout {rollout}");
            let other = rollout - 1;
            let ack = Ack {
                schema: SCHEMA,
                session: 7,
                durable_rollout: other,
                rollout: other,
                success: 1,
            };
            ports.acks.send_copy(ack).unwrap();
            ports.acks.send_copy(Ack { rollout, success, ..ack }).unwrap();
            if good == rollout {
                operator.until("the proof", is_good(rollout));
            } else {
                // Commands are answered after the dry run; whatever comes of it is there by then.
                (0..200).for_each(|_| assert_eq!(operator.status().last_good.rollout, good));
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
        service.run(&mut arm(&model, &config), |operator| {
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
