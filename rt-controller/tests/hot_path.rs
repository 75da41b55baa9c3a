//! The rules of the hot path, shown on a simulated WAM: no heap, no panic, torques within limits
//! whatever is measured and whatever policy was admitted.

mod common;

use physics::arm::{ArmModel, JointVector};
use physics::pancake::{PancakeConfig, PancakePlant, WAM7_START_POSTURE};
use physics::plant::{Measurement, Plant};
use rt_controller::ControllerConfig;
use rt_controller::admit::admission::admit;
use rt_controller::hot::policy::Policy;
use rt_controller::hot::rollout::Phase;
use rt_controller::hot::tick::{Controller, Fault};
use shm_types::episode::TickRecord;
use shm_types::policy::{PolicyMsg, packed_index};

use common::heap::{CountingAllocator, operations_of};
use common::{controller, field, message, wam};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

struct Bench {
    model: ArmModel,
    config: ControllerConfig,
    plant: PancakePlant,
}

impl Bench {
    fn new() -> Bench {
        let model = wam();
        let plant = PancakePlant::new(&model, &WAM7_START_POSTURE, &PancakeConfig::default());
        Bench { model, config: ControllerConfig::default(), plant }
    }

    fn admit(&self, message: &PolicyMsg) -> Policy {
        admit(message, &self.model, &self.config).unwrap()
    }
}

/// One rollout; `measure` may tamper with what the controller sees, `check` sees every tick.
fn rollout(
    controller: &mut Controller,
    plant: &mut PancakePlant,
    policy: &Policy,
    mut measure: impl FnMut(u32, Measurement) -> Measurement,
    mut check: impl FnMut(&TickRecord, &JointVector),
) -> u32 {
    plant.begin_reset();
    controller.enter_fresh_world();
    controller.start(policy);
    let mut ticks = 0;
    while controller.phase() != Phase::Idle {
        let measured = measure(ticks, plant.measure());
        let mut record = TickRecord::ZERO;
        let tau = controller.tick(&measured, &mut record);
        check(&record, &tau);
        plant.apply(&tau);
        plant.advance();
        ticks += 1;
    }
    ticks
}

#[test]
fn a_tick_does_not_touch_the_heap_in_100_000_ticks() {
    let mut bench = Bench::new();
    let messages = [message(0.05, 200.0), field(), message(0.2, 800.0)];
    let policies = messages.map(|message| bench.admit(&message));
    let mut controller = controller(&bench.model, &bench.config);
    let (mut ticks, mut operations, mut next) = (0, 0, 0);
    while ticks < 100_000 {
        if controller.phase() == Phase::Idle {
            bench.plant.begin_reset();
            operations += operations_of(|| {
                controller.enter_fresh_world();
                controller.start(&policies[next % 3])
            });
            next += 1;
        } else if ticks % 400 == 399 {
            // From one kind to the other while it acts.
            operations += operations_of(|| controller.swap(&policies[ticks / 400 % 3]));
        }
        let measured = bench.plant.measure();
        let mut record = TickRecord::ZERO;
        operations += operations_of(|| {
            let tau = controller.tick(&measured, &mut record);
            bench.plant.apply(&tau);
        });
        bench.plant.advance();
        ticks += 1;
    }
    assert_eq!(operations, 0, "over {next} rollouts");
    assert!(next > 20, "the policies end as they should: {next} rollouts");
}

#[test]
fn the_guard_sees_a_tick_that_allocates() {
    assert_eq!(operations_of(|| drop(std::hint::black_box(Box::new(1)))), 2);
}

#[test]
fn torques_stay_within_limits_and_rate_under_violent_policies() {
    let mut bench = Bench::new();
    let limits = *bench.model.limits();
    let step = limits.tau_max * bench.config.torque_rate * bench.config.period_s() * (1.0 + 1e-12);
    let mut clipped = 0;
    for (amplitude, stiffness) in [(0.1, 500.0), (0.6, 5000.0), (0.7, 4e4)] {
        let policy = bench.admit(&message(amplitude, stiffness));
        let mut controller = controller(&bench.model, &bench.config);
        let mut last: Option<JointVector> = None;
        rollout(
            &mut controller,
            &mut bench.plant,
            &policy,
            |_, m| m,
            |record, tau| {
                assert!(tau.iter().all(|t| t.is_finite()));
                for i in 0..7 {
                    assert!(tau[i].abs() <= limits.tau_max[i], "joint {i}: {}", tau[i]);
                    if let Some(last) = last {
                        assert!((tau[i] - last[i]).abs() <= step[i], "joint {i} jumps");
                    }
                }
                clipped += record.flags & shm_types::episode::FLAG_TORQUE_CLIPPED;
                last = Some(*tau);
            },
        );
    }
    assert!(clipped > 0, "the policies were meant to reach the limits");
}

#[test]
fn a_measurement_that_is_not_a_number_becomes_a_latched_hold() {
    let mut bench = Bench::new();
    let policy = bench.admit(&message(0.05, 200.0));
    let mut controller = controller(&bench.model, &bench.config);
    let mut faults = Vec::new();
    let ticks = rollout(
        &mut controller,
        &mut bench.plant,
        &policy,
        |tick, mut measured| {
            if tick == 300 {
                measured.qd[3] = f64::NAN;
            }
            measured
        },
        |record, tau| {
            faults.push(record.fault);
            assert!(tau.iter().all(|t| t.is_finite()));
            assert!(record.qd.iter().all(|qd| qd.is_finite()), "records stay valid messages");
        },
    );
    assert_eq!(ticks, 301, "the rollout ends with the fault");
    assert_eq!(faults[299], Fault::None as u32);
    assert_eq!(faults[300], Fault::MeasurementNotFinite as u32);

    // Still latched in Idle, with the measurement back: the arm is held, not driven.
    let mut record = TickRecord::ZERO;
    controller.tick(&bench.plant.measure(), &mut record);
    assert_eq!(record.fault, Fault::MeasurementNotFinite as u32);
}

#[test]
fn a_toss_after_the_end_of_the_policy_is_followed_to_its_end() {
    let mut bench = Bench::new();
    let mut still = message(0.0, 200.0);
    still.duration_s = 0.3;
    let policy = bench.admit(&still.sealed());
    let mut controller = controller(&bench.model, &bench.config);
    let policy_ticks = 300 + 50; // Execute and the Approach before it
    let lies = bench.plant.measure().object;
    // A pancake that leaves 50 ms after the policy's end, at 3 m/s, and falls back.
    let mut last_s = 0.0;
    let flight = |ticks: u32| {
        let t = f64::from(ticks.saturating_sub(policy_ticks + 50)) * 1e-3;
        3.0 * t - 9.81 / 2.0 * t * t
    };
    rollout(
        &mut controller,
        &mut bench.plant,
        &policy,
        |tick, mut measured| {
            measured.object = lies;
            let height = flight(tick).max(0.0);
            measured.object.p_WO.z += height;
            measured.object.in_contact = height == 0.0;
            measured
        },
        |record, _| last_s = record.t_s,
    );
    // It falls back through 0.1 m, and half a second later all is known.
    let falls_s = (3.0 + (9.0_f64 - 2.0 * 9.81 * 0.1).sqrt()) / 9.81;
    let end_s = 0.3 + 0.05 + falls_s + 0.5;
    assert!((last_s - end_s).abs() < 5e-3, "{last_s} s, not {end_s} s");
}

#[test]
fn an_object_that_is_not_a_number_is_a_fault_and_spoils_no_record() {
    let mut bench = Bench::new();
    let policy = bench.admit(&message(0.05, 200.0));
    let mut controller = controller(&bench.model, &bench.config);
    let mut last = TickRecord::ZERO;
    rollout(
        &mut controller,
        &mut bench.plant,
        &policy,
        |tick, mut measured| {
            if tick == 200 {
                measured.object.p_WO.z = f64::NAN;
            }
            measured
        },
        |record, _| last = *record,
    );
    assert_eq!(last.fault, Fault::MeasurementNotFinite as u32);
    assert!(last.object_position.iter().all(|x| x.is_finite()));
}

#[test]
fn joints_out_of_control_are_faults() {
    let bench = Bench::new();
    let limits = bench.model.limits();
    let measured = bench.plant.measure();
    for (fault, tamper) in [
        (Fault::JointOutOfRange, (limits.q_max[1] + 0.3, 0.0)),
        (Fault::Overspeed, (0.0, 3.0 * limits.qd_max[1])),
    ] {
        let mut controller = controller(&bench.model, &bench.config);
        let mut tampered = measured;
        (tampered.q[1], tampered.qd[1]) = tamper;
        controller.tick(&tampered, &mut TickRecord::ZERO.clone());
        assert_eq!(controller.fault(), fault);
    }
}

#[test]
fn admission_names_what_it_refuses() {
    let bench = Bench::new();
    let refuse = |change: &dyn Fn(&mut PolicyMsg)| {
        let mut message = message(0.05, 200.0);
        change(&mut message);
        admit(&message.sealed(), &bench.model, &bench.config).unwrap_err().to_string()
    };
    let negative = refuse(&|m| m.components[2].stiffness[packed_index(1, 1)] = -5.0);
    assert!(negative.contains("component 2") && negative.contains("eigenvalue"), "{negative}");
    let indefinite = refuse(&|m| m.components[0].stiffness[packed_index(1, 0)] = 900.0);
    assert!(indefinite.contains("eigenvalue"), "{indefinite}");
    let stiff = refuse(&|m| m.components[1].stiffness[packed_index(0, 0)] = 9e4);
    assert!(stiff.contains("component 1"), "{stiff}");
    let far = refuse(&|m| m.components[7].attractor[0] = 9.0);
    assert!(far.contains("component 7") && far.contains("attractor"), "{far}");
    let long = refuse(&|m| m.duration_s = 20.0);
    assert!(long.contains("duration_s"), "{long}");
}
