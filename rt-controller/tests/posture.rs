//! The posture moved by hand: the elbow goes aside, the tip goes on, and nothing else changes.

mod common;

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use common::heap::{CountingAllocator, operations_of};
use common::service::Service;
use common::{controller, message, wam};
use nalgebra::Isometry3;
use physics::arm::{ArmModel, JointVector, kinematics};
use physics::ideal::IdealArm;
use physics::pancake::WAM7_START_POSTURE;
use physics::plant::{Measurement, Plant};
use rt_controller::admit::admission::admit;
use rt_controller::admit::disturbance::{Disturbed, check_under};
use rt_controller::hot::policy::Policy;
use rt_controller::hot::posture::PostureMove;
use rt_controller::hot::rollout::Phase;
use rt_controller::hot::tick::{Controller, Fault};
use rt_controller::{ControllerConfig, Pace};
use shm_types::MAX_JOINTS;
use shm_types::command::{
    AT_NEXT_ROLLOUT, COMMAND_ACTIVATE, COMMAND_PIN, COMMAND_POSTURE, Command,
};
use shm_types::episode::TickRecord;
use shm_types::policy::PolicyMsg;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Within a second, 0.5 rad at the upper arm's joint: the rest of the arm gives way as it must.
fn aside() -> PostureMove {
    let mut offset = JointVector::zeros();
    (offset[0], offset[2]) = (-0.4, 0.5);
    PostureMove { offset, duration_s: 1.0 }
}

struct Bench {
    model: ArmModel,
    config: ControllerConfig,
    policy: Policy,
}

impl Bench {
    fn new() -> Bench {
        let (model, config) = (wam(), ControllerConfig::default());
        let policy = admit(&message(0.02, 200.0), &model, &config).unwrap();
        Bench { model, config, policy }
    }

    fn arm(&self) -> IdealArm<'_> {
        IdealArm::new(&self.model, &WAM7_START_POSTURE, self.config.period_s(), 0.01)
    }

    fn tip(&self, record: &TickRecord) -> Isometry3<f64> {
        kinematics::tip_pose(&self.model, &JointVector::from(record.q))
    }

    /// Runs a rollout; `order` may give orders before each tick of Execute and Settle. Returns these ticks,
    /// and the heap operations of all.
    fn rollout(
        &self,
        controller: &mut Controller,
        arm: &mut IdealArm,
        mut order: impl FnMut(usize, &mut Controller),
    ) -> (Vec<TickRecord>, u64) {
        controller.start(&self.policy);
        let (mut records, mut operations) = (Vec::new(), 0);
        while controller.phase() != Phase::Idle {
            let acts = matches!(controller.phase(), Phase::Execute | Phase::Settle);
            let (measured, mut record) = (arm.measure(), TickRecord::ZERO);
            let n = records.len();
            operations += operations_of(|| {
                if acts {
                    order(n, controller);
                }
                let tau = controller.tick(&measured, &mut record);
                arm.apply(&tau);
            });
            arm.advance();
            if acts {
                records.push(record);
            }
        }
        assert_eq!(controller.fault(), Fault::None);
        (records, operations)
    }

    fn undisturbed(&self) -> Vec<TickRecord> {
        self.rollout(&mut controller(&self.model, &self.config), &mut self.arm(), |_, _| {}).0
    }

    /// The largest distance of the tips, mm, and of the postures, rad.
    fn apart(&self, a: &[TickRecord], b: &[TickRecord]) -> (f64, f64) {
        let mut apart = (0.0_f64, 0.0_f64);
        for (a, b) in a.iter().zip(b) {
            let tip = self.tip(a).translation.vector - self.tip(b).translation.vector;
            apart.0 = apart.0.max(1e3 * tip.norm());
            apart.1 = apart.1.max((JointVector::from(a.q) - JointVector::from(b.q)).norm());
        }
        apart
    }
}

#[test]
fn the_elbow_goes_aside_and_the_tip_goes_on() {
    let bench = Bench::new();
    let undisturbed = bench.undisturbed();
    let mut controller = controller(&bench.model, &bench.config);
    controller.move_posture(&aside());
    let (moved, operations) = bench.rollout(&mut controller, &mut bench.arm(), |_, _| {});
    assert_eq!(operations, 0, "a tick with a moving posture touches the heap");
    assert_eq!(moved[0].tau, undisturbed[0].tau, "it begins without a jump");
    let (tip_mm, posture_rad) = bench.apart(&undisturbed, &moved);
    assert!(posture_rad > 0.4, "{posture_rad} rad");
    assert!(tip_mm < 0.5, "{tip_mm} mm");
}

#[test]
fn orders_on_the_way_leave_torques_within_their_rate_and_lead_back() {
    let bench = Bench::new();
    let undisturbed = bench.undisturbed();
    let mut controller = controller(&bench.model, &bench.config);
    let mut arm = bench.arm();
    let back = PostureMove { duration_s: 0.3, ..PostureMove::NONE };
    let (moved, operations) =
        bench.rollout(&mut controller, &mut arm, |tick, controller| match tick {
            200 => controller.move_posture(&aside()),
            700 => controller.move_posture(&back),
            _ => {}
        });
    assert_eq!(operations, 0);
    assert_eq!(moved[..200], undisturbed[..200], "nothing happens before the order");
    assert_ne!(moved[210], undisturbed[210]);
    let limits = bench.model.limits();
    for pair in moved.windows(2) {
        for i in 0..MAX_JOINTS {
            let step = limits.tau_max[i] * bench.config.torque_rate * bench.config.period_s();
            let change = (pair[1].tau[i] - pair[0].tau[i]).abs();
            // Far below what the limit would allow: smooth by itself.
            assert!(change < 0.2 * step, "joint {i} jumps by {change} N·m");
        }
    }
    let (tip_mm, posture_rad) = bench.apart(&undisturbed, &moved);
    assert!(tip_mm < 0.5 && posture_rad > 0.1, "{tip_mm} mm, {posture_rad} rad");
    let (_, left_rad) = bench.apart(&undisturbed[moved.len() - 1..], &moved[moved.len() - 1..]);
    assert!(left_rad < 0.2 * posture_rad, "{left_rad} of {posture_rad} rad");

    // Nothing of it is left in the next rollout, but for where the arm comes from.
    let (next, _) = bench.rollout(&mut controller, &mut arm, |_, _| {});
    let (_, next_rad) = bench.apart(&undisturbed, &next);
    assert!(next_rad < 0.03, "{next_rad} rad");
}

#[test]
fn every_rollout_begins_at_the_start_posture_and_moves_from_there() {
    let bench = Bench::new();
    let (mut controller, mut arm) = (controller(&bench.model, &bench.config), bench.arm());
    controller.move_posture(&aside());
    let (first, _) = bench.rollout(&mut controller, &mut arm, |_, _| {});
    // Not put back: as a real arm it comes from where it was.
    let (second, _) = bench.rollout(&mut controller, &mut arm, |_, _| {});
    let begins = (JointVector::from(second[0].q) - WAM7_START_POSTURE).amax();
    assert!(begins < 0.021, "{begins} rad from the start posture");
    let (tip_mm, posture_rad) = bench.apart(&first, &second);
    assert!(tip_mm < 20.0 && posture_rad < 0.05, "{tip_mm} mm, {posture_rad} rad");
}

#[test]
fn a_posture_that_nobody_moved_changes_no_bit() {
    let bench = Bench::new();
    let undisturbed = bench.undisturbed();
    let mut controller = controller(&bench.model, &bench.config);
    controller.move_posture(&aside());
    controller.move_posture(&PostureMove::NONE);
    let (same, _) = bench.rollout(&mut controller, &mut bench.arm(), |tick, controller| {
        if tick == 300 {
            controller.move_posture(&PostureMove { duration_s: 0.2, ..PostureMove::NONE });
        }
    });
    assert_eq!(same, undisturbed);
}

/// Tilts the tip by `pitch` rad and back: one way the wrist of the WAM gets close to its singularity.
fn tilting(pitch: f64) -> PolicyMsg {
    let mut policy = message(0.0, 200.0);
    for component in &mut policy.components[2..5] {
        component.attractor[3] = pitch;
    }
    policy.sealed()
}

#[test]
fn a_wrist_that_would_spin_keeps_its_posture() {
    let bench = Bench::new();
    let check = |message: &PolicyMsg, part: f64| -> Result<(), Disturbed> {
        let policy = admit(message, &bench.model, &bench.config).unwrap();
        let to = PostureMove { offset: aside().offset * part, ..aside() };
        check_under(&policy, &to, &bench.model, &WAM7_START_POSTURE, &bench.config)
    };
    assert_eq!(check(&message(0.02, 200.0), 1.0), Ok(()));
    assert_eq!(check(&tilting(-0.4), 1.0), Ok(()));
    let spins = check(&tilting(0.8), 1.0).unwrap_err().to_string();
    assert!(spins.contains("joint 7 (j7_palm_yaw) would turn 6.0 rad/s faster"), "{spins}");
    assert!(spins.contains("no part of this offset fits"), "{spins}");
    // What it says would fit does, and a step more does not.
    let some = check(&tilting(-0.6), 1.0).unwrap_err();
    assert_eq!(some.fits, 0.4);
    assert!(some.to_string().ends_with("0.40 times this offset would fit"), "{some}");
    assert_eq!(check(&tilting(-0.6), 0.4), Ok(()));
    assert!(check(&tilting(-0.6), 0.45).is_err());
}

/// An arm whose resets the test may hold up, and the farthest that its first joint was from its start in each
/// rollout, rad.
struct Attended<'a> {
    arm: IdealArm<'a>,
    may_begin: &'a AtomicBool,
    is_waiting: &'a AtomicBool,
    aside: &'a Mutex<Vec<f64>>,
}

impl Plant for Attended<'_> {
    fn is_simulated(&self) -> bool {
        true
    }

    fn begin_reset(&mut self) {
        self.arm.begin_reset();
        self.aside.lock().unwrap().push(0.0);
    }

    fn is_ready(&self) -> bool {
        let may_begin = self.may_begin.load(Ordering::Relaxed);
        self.is_waiting.store(!may_begin, Ordering::Relaxed);
        may_begin
    }

    fn measure(&self) -> Measurement {
        let measured = self.arm.measure();
        if let Some(aside) = self.aside.lock().unwrap().last_mut() {
            *aside = aside.max((measured.q[0] - WAM7_START_POSTURE[0]).abs());
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

#[test]
fn a_posture_ordered_while_the_plant_is_put_back_is_that_of_the_rollout() {
    let bench = Bench::new();
    let (model, config) = (&bench.model, &bench.config);
    let service = Service { name: "attended", model, config, pace: Pace::Max, state: None };
    let (may_begin, is_waiting) = (AtomicBool::new(true), AtomicBool::new(false));
    let aside = Mutex::new(Vec::new());
    let (may_begin, is_waiting, aside) = (&may_begin, &is_waiting, &aside);
    let mut plant = Attended { arm: bench.arm(), may_begin, is_waiting, aside };
    let (_, n) = service.run(&mut plant, |operator| {
        let policy = operator.import(message(0.02, 200.0));
        operator.activate(policy);
        operator.ok(Command::new(COMMAND_PIN, 0));
        operator.until("service", |status| status.rollouts_served > 0);
        may_begin.store(false, Ordering::Relaxed);
        operator.until("a reset", |_| is_waiting.load(Ordering::Relaxed));
        let (n, served) = (aside.lock().unwrap().len(), operator.status().rollouts_served);
        let mut posture = [0.0; MAX_JOINTS];
        posture[0] = 0.4;
        operator.ok(Command { posture, ..Command::new(COMMAND_POSTURE, 0) });
        may_begin.store(true, Ordering::Relaxed);
        operator.until("the rollout", |status| status.rollouts_served > served);
        n
    });
    let aside = aside.lock().unwrap();
    let (before, first) = (aside[n - 2], aside[n - 1]);
    assert!(before < 0.05 && first > 0.15, "{before} and {first} rad");
}

#[test]
fn a_cell_takes_a_posture_says_so_and_forgets_it_with_its_controller() {
    let bench = Bench::new();
    let folder = tempfile::tempdir().unwrap();
    let (model, config) = (&bench.model, &bench.config);
    let service =
        Service { name: "posture", model, config, pace: Pace::Max, state: Some(folder.path()) };
    let order = |joint: usize, offset: f64, duration_s: f64| {
        let mut posture = [0.0; MAX_JOINTS];
        posture[joint - 1] = offset;
        Command { posture, duration_s, ..Command::new(COMMAND_POSTURE, 0) }
    };
    service.run(&mut bench.arm(), |operator| {
        // While nothing is executed, too.
        let reply = operator.ok(order(3, 0.5, 1.0));
        assert_eq!((reply.status.posture[2], reply.status.posture_s), (0.5, 1.0));
        assert!(reply.applied_ns > 0);
        let policy = operator.import(message(0.02, 200.0));
        operator.activate(policy);
        operator.ok(Command::new(COMMAND_PIN, 0));
        let before = operator.until("service", |status| status.rollouts_served > 2);
        let reply = operator.ok(order(3, -0.4, 0.0));
        assert!(reply.applied_tick >= before.tick);
        assert_eq!((reply.status.posture[2], reply.status.posture_s), (-0.4, 1.6875));
        for (command, word) in [
            (order(3, 0.5, 0.3), "rad/s"),
            (order(4, 3.0, 20.0), "its offset within"),
            (order(1, f64::NAN, 1.0), "not a finite number"),
        ] {
            let reply = operator.ask(command);
            assert!(reply.accepted == 0 && reply.reason_text().contains(word));
            assert_eq!(reply.status.posture[2], -0.4, "what is refused changes nothing");
        }
        assert_eq!(operator.ok(order(3, 0.0, 0.0)).status.posture, [0.0; MAX_JOINTS]);

        // A policy that does not agree with it is served all the same, and the posture yields.
        operator.ok(order(1, -0.4, 0.0));
        let spinning = operator.import(tilting(0.8));
        operator.until("the swap before", |_| {
            let at = AT_NEXT_ROLLOUT;
            let swap = Command { policy_id: spinning, at, ..Command::new(COMMAND_ACTIVATE, 0) };
            operator.ask(swap).accepted == 1
        });
        operator.until("a posture that yields", |status| status.posture == [0.0; MAX_JOINTS]);
        let reply = operator.ask(order(1, -0.4, 0.0));
        let why = reply.reason_text();
        assert!(reply.accepted == 0 && why.contains("rad/s faster"), "{why}");
        operator.activate(policy);
        operator.ok(order(3, 0.5, 1.0));
    });
    service.run(&mut bench.arm(), |operator| {
        let status = operator.until("service", |status| status.rollouts_served > 0);
        assert_eq!((status.posture, status.pinned), ([0.0; MAX_JOINTS], 1));
    });
}
