//! A policy message: admission, then some ticks under it from any state.
#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use physics::arm::{ArmModel, JointVector};
use physics::ideal::IdealArm;
use physics::pancake::WAM7_START_POSTURE;
use physics::plant::{Measurement, Plant};
use physics::referee::Referee;
use rt_controller::ControllerConfig;
use rt_controller::admit::admission::{admit, admit_action};
use rt_controller::hot::policy::Policy;
use rt_controller::hot::rollout::Phase;
use rt_controller::hot::tick::Controller;
use shm_types::episode::TickRecord;
use shm_types::policy::PolicyMsg;
use shm_types::policy_json::{from_json, to_json};
use skillet_fuzz::{field, patched, split, springs, wam};

/// Number of the first measurement the fuzzer chooses.
const DRIVEN: u64 = 100_000;

static ARM: LazyLock<ArmModel> = LazyLock::new(wam);
static EXECUTING: LazyLock<Controller<'static>> = LazyLock::new(executing);

fn config() -> ControllerConfig {
    ControllerConfig { blend_s: 0.0, approach_s: 0.01, ..Default::default() }
}

/// The `sample`-th measurement: a number seen before is no new one.
fn measured(q: JointVector, qd: JointVector, sample: u64) -> Measurement {
    let still = IdealArm::new(&ARM, &WAM7_START_POSTURE, 1e-3, 0.01).measure();
    Measurement { q, qd, object: still.object, sample, t_ns: sample * 1_000_000 }
}

/// A controller in the midst of a rollout: a policy swapped in acts at once.
fn executing() -> Controller<'static> {
    let mut controller = Controller::new(&ARM, &WAM7_START_POSTURE, &config(), &Referee::Clock);
    controller.start(&Policy::new(&springs()));
    for sample in 0..DRIVEN {
        if controller.phase() == Phase::Execute {
            break;
        }
        let still = measured(WAM7_START_POSTURE, JointVector::zeros(), sample);
        let mut record = TickRecord::ZERO;
        controller.tick(&still, &mut record);
    }
    assert_eq!(controller.phase(), Phase::Execute);
    controller
}

fn drive(policy: &Policy, states: &[u8]) {
    let (bounds, mut controller) = (ARM.limits(), *EXECUTING);
    let step = config().torque_rate * config().period_s();
    let mut last: Option<JointVector> = None;
    controller.swap(policy);
    for (state, sample) in states.chunks_exact(14).take(16).zip(DRIVEN..) {
        let unit = |byte: u8| f64::from(byte) / 127.5 - 1.0;
        let q = JointVector::from_fn(|i, _| {
            let (min, max) = (bounds.q_min[i], bounds.q_max[i]);
            (min + max) / 2.0 + (max - min) / 2.0 * unit(state[i]) * 1.2
        });
        let qd = JointVector::from_fn(|i, _| bounds.qd_max[i] * unit(state[7 + i]) * 2.2);
        let mut record = TickRecord::ZERO;
        let tau = controller.tick(&measured(q, qd, sample), &mut record);
        for i in 0..7 {
            assert!(tau[i].is_finite() && tau[i].abs() <= bounds.tau_max[i], "{i}: {}", tau[i]);
            let change = last.map_or(0.0, |last| (tau[i] - last[i]).abs());
            assert!(change <= step * bounds.tau_max[i] * (1.0 + 1e-9), "{i}: {change}");
        }
        last = Some(tau);
    }
}

fuzz_target!(|data: &[u8]| {
    let (mode, rest) = split(data);
    let (states, changes) = rest.split_at(rest.len().min(usize::from(mode >> 3) * 14));
    let base = match mode & 5 {
        0 => springs(),
        4 => field(),
        _ => PolicyMsg::of_action(&[1.0, 2.0]).sealed(),
    };
    let mut policy = patched(&base, changes);
    if mode & 2 == 0 {
        policy = policy.sealed();
    }
    let _ = admit_action(&policy, 2);
    if let Ok(admitted) = admit(&policy, &ARM, &config()) {
        let text = to_json(&policy).expect("it is valid");
        let again = from_json(&text).expect("it was written so");
        assert_eq!(admit(&again, &ARM, &config()).as_ref(), Ok(&admitted), "{text}");
        drive(&admitted, states);
    }
});
