//! Whatever policy is sent: admission does not panic and lets nothing pass that violates a bound,
//! and no admitted policy makes the tick give a torque beyond the limits.
//!
//! A short run by default; SKILLET_HOSTILE_MESSAGES=10000000 for the long one.
#![allow(non_snake_case)] // matrices

mod common;
mod hostile;

use std::collections::BTreeMap;

use common::wam;
use hostile::bounds::{Arm, violation};
use hostile::policies::hostile_policy;
use physics::arm::{ArmModel, JointVector};
use physics::ideal::IdealArm;
use physics::pancake::WAM7_START_POSTURE;
use physics::plant::{Measurement, Plant};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rt_controller::ControllerConfig;
use rt_controller::admit::admission::{AdmissionError, admit};
use rt_controller::hot::policy::Policy;
use rt_controller::hot::rollout::Phase;
use rt_controller::hot::tick::{Controller, Fault};
use shm_types::episode::TickRecord;
use shm_types::policy::{ACTIVATION_STATE, PolicyMsgError};

/// Rounding: of eigenvalues in s⁻², of everything else as a share.
const SLACK: f64 = 1e-8;
/// Ticks of every admitted policy from states that have nothing to do with each other.
const JUMPS: usize = 4;
/// One in this many admitted policies executes a whole rollout on the ideal arm.
const ROLLOUT: u64 = 2000;

fn reason(error: &AdmissionError) -> &'static str {
    match error {
        AdmissionError::Message(error) => match error {
            PolicyMsgError::Schema { .. } => "schema",
            PolicyMsgError::Digest => "digest",
            PolicyMsgError::TaskDim(_) => "task_dim",
            PolicyMsgError::Components(_) => "n_components",
            PolicyMsgError::Actions { .. } => "n_actions beside components",
            PolicyMsgError::Systems { .. } => "n_systems",
            PolicyMsgError::Activation(_) => "activation",
            PolicyMsgError::Output(_) => "output",
            PolicyMsgError::Orientation(_) => "orientation",
            PolicyMsgError::Range { field, .. } => field,
            PolicyMsgError::ComponentRange { field, .. } => match *field {
                "stiffness" => "stiffness entry",
                "attractor" => "attractor entry",
                other => other,
            },
            PolicyMsgError::SystemRange { field, .. } => match *field {
                "covariance" => "covariance entry",
                other => other,
            },
        },
        AdmissionError::Stiffness { .. } => "stiffness eigenvalue",
        AdmissionError::Damper { .. } => "damper too strong",
        AdmissionError::Attractor { .. } => "attractor too far",
        AdmissionError::Target { .. } => "target too far",
        AdmissionError::Covariance { .. } => "covariance eigenvalue",
        AdmissionError::Gain { .. } => "gain of a system",
        AdmissionError::Unused { field, .. } => field,
        AdmissionError::StateOfAcceleration => "acceleration driven by the state",
        AdmissionError::Certificate { .. } => "certificate eigenvalue",
        AdmissionError::Contraction { .. } => "contraction",
        AdmissionError::Rest { .. } => "rest at the target",
        AdmissionError::Following { .. } => "following too slow",
        AdmissionError::Duration { .. } => "too long for an episode",
        AdmissionError::Actions { .. } => "actions for an arm",
        AdmissionError::DryRunFault { .. } | AdmissionError::DryRunTorque { .. } => "dry run",
    }
}

/// Drives admitted policies and checks every torque.
struct Driver<'a> {
    model: &'a ArmModel,
    step: f64,
    /// In the midst of a rollout, so that a policy swapped in acts at once; with its last torque.
    executing: (Controller<'a>, JointVector),
    ticks: u64,
    held: u64,
}

impl<'a> Driver<'a> {
    fn new(model: &'a ArmModel, config: &ControllerConfig) -> Driver<'a> {
        let mut controller = common::controller(model, config);
        let mut arm = IdealArm::new(model, &WAM7_START_POSTURE, config.period_s(), 0.01);
        let harmless = admit(&common::message(0.0, 200.0), model, config).unwrap();
        controller.start(&harmless);
        let (mut last, mut record) = (JointVector::zeros(), TickRecord::ZERO);
        while controller.phase() != Phase::Execute {
            last = controller.tick(&arm.measure(), &mut record);
            arm.apply(&last);
            arm.advance();
        }
        let step = config.torque_rate * config.period_s();
        Driver { model, step, executing: (controller, last), ticks: 0, held: 0 }
    }

    fn tick(
        &mut self,
        controller: &mut Controller,
        measured: &Measurement,
        last: Option<&JointVector>,
    ) -> JointVector {
        let mut record = TickRecord::ZERO;
        let tau = controller.tick(measured, &mut record);
        let tau_max = &self.model.limits().tau_max;
        for i in 0..self.model.n_joints() {
            assert!(tau[i].is_finite() && tau[i].abs() <= tau_max[i], "joint {i}: {} N·m", tau[i]);
            let change = last.map_or(0.0, |last| (tau[i] - last[i]).abs());
            assert!(change <= (self.step + 1e-12) * tau_max[i], "joint {i}: by {change} N·m");
        }
        assert!(record.attractor.iter().chain(&record.x).all(|x| x.is_finite()));
        self.ticks += 1;
        self.held += u64::from(controller.fault() != Fault::None);
        tau
    }

    /// Some ticks, each in another state: up to and beyond every limit, now and then no number.
    fn jump(&mut self, policy: &Policy, rng: &mut ChaCha8Rng) {
        let (mut controller, mut last) = self.executing;
        controller.swap(policy);
        let bounds = *self.model.limits();
        for _ in 0..JUMPS {
            let q = JointVector::from_fn(|i, _| {
                rng.random_range(bounds.q_min[i] - 0.25..bounds.q_max[i] + 0.25)
            });
            let qd = JointVector::from_fn(|i, _| bounds.qd_max[i] * rng.random_range(-2.05..2.05));
            let mut measured = IdealArm::new(self.model, &q, 1e-3, 0.01).measure();
            measured.qd = qd;
            match rng.random_range(0..50) {
                0 => measured.q[rng.random_range(0..7)] = f64::NAN,
                1 => measured.qd[rng.random_range(0..7)] = f64::INFINITY,
                2 => measured.object.p_WO.x = f64::NAN,
                _ => {}
            }
            last = self.tick(&mut controller, &measured, Some(&last));
        }
    }

    /// A whole rollout on an arm that starts anywhere within its joint limits.
    fn roll_out(&mut self, policy: &Policy, config: &ControllerConfig, rng: &mut ChaCha8Rng) {
        let bounds = self.model.limits();
        let q = JointVector::from_fn(|i, _| rng.random_range(bounds.q_min[i]..bounds.q_max[i]));
        let start = if rng.random_bool(0.7) { WAM7_START_POSTURE } else { q };
        let mut arm = IdealArm::new(self.model, &start, config.period_s(), 0.01);
        let mut controller = common::controller(self.model, config);
        controller.start(policy);
        let mut last = None;
        while controller.phase() != Phase::Idle {
            let tau = self.tick(&mut controller, &arm.measure(), last.as_ref());
            arm.apply(&tau);
            arm.advance();
            last = Some(tau);
        }
    }
}

#[test]
fn no_policy_passes_a_bound_or_makes_a_torque_that_does() {
    let sent = hostile::messages(200_000);
    let model = wam();
    let config = ControllerConfig { blend_s: 0.0, approach_s: 0.01, ..Default::default() };
    let arm = Arm::new(&model, config.settle_s);
    let mut driver = Driver::new(&model, &config);
    let mut rng = ChaCha8Rng::seed_from_u64(0x5eed);
    let mut verdicts: BTreeMap<&str, u64> = BTreeMap::new();
    let (mut accepted, mut rollouts, mut fields) = (0, 0, 0);
    for n in 0..sent {
        let (kind, message) = hostile_policy(&mut rng, &arm);
        let admitted = admit(&message, &model, &config);
        let broken = violation(&message, &arm, if admitted.is_ok() { SLACK } else { -SLACK });
        let verdict = match &admitted {
            Ok(policy) => {
                assert_eq!(broken, None, "message {n} ({kind}) was admitted: {message:?}");
                driver.jump(policy, &mut rng);
                if accepted % ROLLOUT == 0 {
                    driver.roll_out(policy, &config, &mut rng);
                    rollouts += 1;
                }
                accepted += 1;
                fields += u64::from(message.activation == ACTIVATION_STATE);
                "accepted"
            }
            Err(error) => {
                assert!(broken.is_some(), "message {n} ({kind}) was refused: {error}");
                reason(error)
            }
        };
        *verdicts.entry(verdict).or_default() += 1;
    }
    println!(
        "{sent} sent, {rollouts} whole rollouts, {} ticks ({} held)",
        driver.ticks, driver.held
    );
    for (verdict, count) in &verdicts {
        println!("{count:>9} {verdict}");
    }
    // The test is worth something only if every door was tried, and the open one often.
    assert!(accepted * 10 > sent && fields * 100 > sent, "{accepted} accepted, {fields} fields");
    assert!(driver.held * 10 < driver.ticks * 9, "{} of {} held", driver.held, driver.ticks);
    for door in [
        "digest",
        "schema",
        "stiffness eigenvalue",
        "attractor too far",
        "damping",
        "damping_ratio",
        "damper too strong",
        "covariance eigenvalue",
        "gain of a system",
        "certificate eigenvalue",
        "contraction",
        "rest at the target",
        "following too slow",
        "acceleration driven by the state",
    ] {
        assert!(verdicts.contains_key(door), "nothing was refused for its {door}: {verdicts:?}");
    }
}
