//! The loop as a real arm meets it: nothing rests on a fresh world, on a posture that is assumed, or
//! on a period that is assumed.

mod common;

use common::faulty::{Faulty, Switch};
use common::{controller, message, referee, wam};
use physics::arm::{ArmModel, JointVector, dynamics, kinematics};
use physics::ideal::IdealArm;
use physics::pancake::WAM7_START_POSTURE;
use physics::plant::{Measurement, Plant};
use rt_controller::ControllerConfig;
use rt_controller::admit::admission::admit;
use rt_controller::fault::Fault;
use rt_controller::hot::rollout::Phase;
use rt_controller::hot::tick::Controller;
use shm_types::episode::TickRecord;

/// One period: the torque that was commanded.
fn cycle<P: Plant>(controller: &mut Controller, arm: &mut P) -> JointVector {
    let tau = controller.tick(&arm.measure(), &mut { TickRecord::ZERO });
    arm.apply(&tau);
    arm.advance();
    tau
}

/// What is spoiled in a sample, and how.
type Spoil = fn(&mut Measurement, f64);
const FIELDS: [(&str, Spoil); 7] = [
    ("q[0]", |m, x| m.q[0] = x),
    ("q[6]", |m, x| m.q[6] = x),
    ("qd[1]", |m, x| m.qd[1] = x),
    ("every q and qd", |m, x| (m.q, m.qd) = (JointVector::repeat(x), JointVector::repeat(x))),
    ("object position", |m, x| m.object.p_WO.y = x),
    ("object rotation", |m, x| m.object.R_WO.as_mut_unchecked().coords[3] = x),
    ("sample and stamp", |m, x| (m.sample, m.t_ns) = (x as u64, x as u64)),
];
const VALUES: [f64; 5] = [f64::NAN, f64::NEG_INFINITY, f64::MAX, -1e300, f64::MIN_POSITIVE];
/// Ticks of a brisk rollout: the first of all, Idle, Approach, Execute, Settle.
const MOMENTS: [usize; 6] = [0, 1, 100, 130, 160, 1600];

/// 100 ticks of Idle, a rollout, then Idle again; `n` samples from `at` on are spoiled.
fn spoil(model: &ArmModel, config: &ControllerConfig, at: usize, n: usize, f: Spoil, x: f64) {
    let policy = admit(&message(0.05, 200.0), model, config).unwrap();
    let (mut arm, mut controller) = (
        IdealArm::new(model, &WAM7_START_POSTURE, config.period_s(), 0.01),
        controller(model, config),
    );
    let step = model.limits().tau_max * (config.torque_rate * config.period_s() * (1.0 + 1e-12));
    let mut last: Option<JointVector> = None;
    let mut tick = |controller: &mut Controller, measured: &Measurement| {
        let tau = controller.tick(measured, &mut { TickRecord::ZERO });
        for i in 0..7 {
            assert!(tau[i].is_finite() && tau[i].abs() <= model.limits().tau_max[i], "{tau}");
            let by = last.map_or(0.0, |last| (tau[i] - last[i]).abs());
            assert!(by <= step[i], "joint {i} steps by {by} N·m");
        }
        last = Some(tau);
        tau
    };
    for i in 0..2600 {
        if i == 100 {
            controller.start(&policy);
        }
        let mut measured = arm.measure();
        if (at..at + n).contains(&i) {
            f(&mut measured, x);
        }
        let tau = tick(&mut controller, &measured);
        arm.apply(&tau);
        arm.advance();
    }
    // Good samples again, the arm may be re-armed, and works.
    controller.rearm();
    assert_eq!(controller.latched(), None);
    let there = arm.measure();
    assert!(there.qd.abs().max() < 0.1, "held: {}", there.qd.transpose());
    controller.start(&policy);
    let mut executed = false;
    while controller.phase() != Phase::Idle {
        let tau = tick(&mut controller, &arm.measure());
        arm.apply(&tau);
        arm.advance();
        executed |= controller.phase() == Phase::Settle;
    }
    assert_eq!((controller.fault(), executed), (Fault::None, true), "the rollout afterwards");
}

#[test]
fn no_spoiled_sample_at_any_moment_spoils_a_torque_or_what_comes_after() {
    let (model, config) = (wam(), ControllerConfig::default());
    for (name, field) in FIELDS {
        for value in VALUES {
            if name == "every q and qd" && value == f64::MIN_POSITIVE {
                continue; // an arm that shows nothing but zeros may well be there
            }
            for (at, n) in MOMENTS.iter().flat_map(|at| [(*at, 1), (*at, 20)]) {
                println!("{name} = {value:e}, {n} samples from {at} on");
                spoil(&model, &config, at, n, field, value);
            }
        }
    }
}

#[test]
fn idle_holds_the_arm_where_it_is_from_the_first_tick_on() {
    let (model, config) = (wam(), ControllerConfig::default());
    let elsewhere = WAM7_START_POSTURE.map(|q| q + 0.3);
    let mut arm = IdealArm::new(&model, &elsewhere, config.period_s(), 0.01);
    let mut controller = controller(&model, &config);
    let hold = dynamics::gravity_torque(&model, &elsewhere);
    for _ in 0..1000 {
        let tau = cycle(&mut controller, &mut arm);
        assert!((tau - hold).abs().max() < 1e-6, "{tau}");
    }
    assert!((arm.measure().q - elsewhere).abs().max() < 1e-6);
}

/// Rollouts without a reset between them, each cut short where its torques are far from a hold.
#[test]
fn torques_keep_their_rate_from_one_rollout_to_the_next() {
    let (model, config) = (wam(), ControllerConfig { dry_run_clipped: 1.0, ..Default::default() });
    let policy = admit(&message(0.15, 500.0), &model, &config).unwrap();
    let switch = Switch::new();
    let (mut arm, mut controller) =
        (Faulty::new(&model, &config, &switch), controller(&model, &config));
    for cut in (160..400).step_by(7) {
        controller.start(&policy);
        for _ in 0..cut {
            cycle(&mut controller, &mut arm);
        }
        controller.trip(Fault::OutOfWorkspace);
        cycle(&mut controller, &mut arm);
        assert_eq!(controller.phase(), Phase::Idle);
    }
    switch.expect_torques_in_bounds();
}

/// Started anew while the arm is still swinging through the start posture.
#[test]
fn an_approach_ends_when_the_arm_rests_not_when_it_passes_by() {
    let (model, config) = (wam(), ControllerConfig::default());
    let policy = admit(&message(0.05, 200.0), &model, &config).unwrap();
    let mut controller = controller(&model, &config);
    controller.start(&policy);
    let mut arm = IdealArm::new(&model, &WAM7_START_POSTURE, config.period_s(), 0.01);
    // At the posture all the time, and moving.
    let mut moving = 0;
    for i in 0..3000 {
        let mut measured = arm.measure();
        if i < 500 {
            measured =
                Measurement { q: WAM7_START_POSTURE, qd: JointVector::repeat(0.2), ..measured };
        }
        let tau = controller.tick(&measured, &mut { TickRecord::ZERO });
        moving += u32::from(i < 500 && controller.phase() == Phase::Execute);
        arm.apply(&tau);
        arm.advance();
    }
    assert_eq!(moving, 0, "executes while the arm moves");
}

/// A host that stands still for some periods sees a longer step, not a force.
#[test]
fn a_stalled_host_is_no_unexpected_force() {
    let (model, config) = (wam(), ControllerConfig { dry_run_clipped: 1.0, ..Default::default() });
    let policy = admit(&message(0.1, 500.0), &model, &config).unwrap();
    for periods in [1, 3, 6, 9, 15] {
        let switch = Switch::new();
        let (mut arm, mut controller) =
            (Faulty::new(&model, &config, &switch), controller(&model, &config));
        controller.start(&policy);
        let mut stalls = 0;
        while controller.phase() != Phase::Idle {
            cycle(&mut controller, &mut arm);
            // While it is fast: through half a stall the torques are those of another posture.
            if controller.tick_number() % 150 == 0 {
                arm.stall(periods);
                stalls += 1;
            }
        }
        assert_eq!(controller.fault(), Fault::None, "after {stalls} stalls of {periods} periods");
        assert!(stalls > 8);
    }
}

/// A loop that misses samples goes on with the movement where the plant's clock is, not where its own count
/// of ticks would be; a leap of that clock moves it by 10 ms at most.
#[test]
fn the_movement_keeps_the_plants_time() {
    let (model, config) = (wam(), ControllerConfig::default());
    let policy = admit(&message(0.02, 200.0), &model, &config).unwrap();
    let leap_ns = 3_600_000_000_000;
    for (samples, leap_at) in [(1, None), (2, None), (3, None), (1, Some(400))] {
        let mut arm = IdealArm::new(&model, &WAM7_START_POSTURE, config.period_s(), 0.01);
        let mut controller = controller(&model, &config);
        controller.start(&policy);
        let (mut record, mut begun, mut n_executed) = (TickRecord::ZERO, None, 0);
        while controller.phase() != Phase::Idle {
            let mut measured = arm.measure();
            if leap_at.is_some_and(|at| n_executed >= at) {
                measured.t_ns += leap_ns;
            }
            let is_execute = controller.phase() == Phase::Execute;
            let tau = controller.tick(&measured, &mut record);
            if is_execute {
                let passed_ns = measured.t_ns - *begun.get_or_insert(measured.t_ns);
                let leapt_ns = if passed_ns >= leap_ns { leap_ns - 9_000_000 } else { 0 };
                let expected_s = (passed_ns - leapt_ns) as f64 / 1e9;
                assert!((record.t_s - expected_s).abs() < 1e-9, "{} {expected_s}", record.t_s);
                n_executed += 1;
            }
            arm.apply(&tau);
            (0..samples).for_each(|_| arm.advance());
        }
        assert_eq!(controller.fault(), Fault::None);
        let expected = policy.duration_s / config.period_s() / samples as f64;
        let skipped = if leap_at.is_some() { 9.0 } else { 0.0 };
        assert!((f64::from(n_executed) + skipped - expected).abs() < 1.5, "{n_executed}");
    }
}

/// A plant whose stamps leap, or stand still, shows nothing that can be checked: stale.
#[test]
fn stamps_that_say_nothing_are_stale_samples() {
    let (model, config) = (wam(), ControllerConfig::default());
    let stamps: [fn(u64) -> u64; 3] = [|_| 7, |t| 1000 * t, |t| u64::MAX - t];
    for stamp in stamps {
        let mut arm = IdealArm::new(&model, &WAM7_START_POSTURE, config.period_s(), 0.01);
        let mut controller = controller(&model, &config);
        for _ in 0..20 {
            let measured = arm.measure();
            let measured = Measurement { t_ns: stamp(measured.t_ns), ..measured };
            let tau = controller.tick(&measured, &mut { TickRecord::ZERO });
            arm.apply(&tau);
            arm.advance();
        }
        assert_eq!(controller.latched(), Some(Fault::MeasurementStale));
    }
}

/// A policy that pulls a joint beyond its limit leans on the push, however stiff it is.
#[test]
fn the_push_from_a_joint_limit_wins_against_the_stiffest_policy() {
    let (model, config) = (wam(), ControllerConfig { dry_run_clipped: 1.0, ..Default::default() });
    for (joint, outwards) in [(1, 1.0), (3, 1.0), (3, -1.0), (5, 1.0), (5, -1.0)] {
        let (q_min, q_max) = (model.limits().q_min[joint], model.limits().q_max[joint]);
        let limit = if outwards > 0.0 { q_max } else { q_min };
        let mut start = WAM7_START_POSTURE;
        start[joint] = limit - outwards * 0.06;
        let mut beyond = start;
        beyond[joint] = limit + outwards * 0.6;
        let pan = kinematics::tip_pose(&model, &beyond).translation.vector;
        for stiffness in [500.0, 5_000.0, 4.9e4] {
            let mut pull = message(0.0, stiffness);
            for component in pull.components.iter_mut().take(8) {
                component.attractor[..3].copy_from_slice(pan.as_slice());
            }
            let policy = admit(&pull.sealed(), &model, &config).unwrap();
            let mut arm = IdealArm::new(&model, &start, config.period_s(), 0.01);
            let mut controller = Controller::new(&model, &start, &config, &referee());
            controller.start(&policy);
            let mut farthest = f64::NEG_INFINITY;
            while controller.phase() != Phase::Idle {
                cycle(&mut controller, &mut arm);
                farthest = farthest.max(outwards * (arm.measure().q[joint] - limit));
            }
            let fault = controller.fault();
            println!("joint {joint} {outwards:+}, K = {stiffness}: {farthest:+.3} rad, {fault:?}");
            assert!(farthest < 0.05, "joint {joint} is {farthest} rad beyond its limit");
        }
    }
}

/// A driver's arm holds more than its model knows of: 150 g at the pan bend the wrist by twice what counts
/// as arrived.
#[test]
fn a_load_that_the_model_does_not_know_keeps_no_rollout_from_beginning() {
    let (model, config) = (wam(), ControllerConfig::default());
    let urdf = include_str!("../../robots/wam7/wam7_pan.urdf");
    let heavier = urdf.replacen(r#"<mass value="0.5"/>"#, r#"<mass value="0.65"/>"#, 1);
    let loaded = ArmModel::from_urdf(&heavier, "pan").unwrap();
    let mut arm = IdealArm::new(&loaded, &WAM7_START_POSTURE, config.period_s(), 0.01);
    let mut controller = controller(&model, &config);
    let policy = admit(&message(0.02, 200.0), &model, &config).unwrap();
    // It has sunk to where the hold carries the load.
    for _ in 0..3000 {
        cycle(&mut controller, &mut arm);
    }
    assert!((arm.measure().q - WAM7_START_POSTURE).amax() > 0.02, "the load bends nothing");
    controller.start(&policy);
    let ticks = (0..10_000).take_while(|_| {
        cycle(&mut controller, &mut arm);
        controller.phase() != Phase::Execute
    });
    let ticks = ticks.count();
    assert!(ticks < 6000, "no rollout after {ticks} ticks");
    assert!((arm.measure().q - WAM7_START_POSTURE).amax() < 0.03);
    assert_eq!(controller.fault(), Fault::None);
}
