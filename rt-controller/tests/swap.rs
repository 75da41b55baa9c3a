//! A policy exchanged within a rollout: at the same phase, blended, never faster than the torque
//! rate allows.

mod common;

use common::{controller, field, message, wam};
use physics::arm::{ArmModel, JointVector};
use physics::ideal::IdealArm;
use physics::pancake::WAM7_START_POSTURE;
use physics::plant::Plant;
use rt_controller::ControllerConfig;
use rt_controller::admit::admission::admit;
use rt_controller::hot::policy::Policy;
use rt_controller::hot::rollout::Phase;
use rt_controller::hot::tick::Fault;
use shm_types::episode::TickRecord;
use shm_types::policy::PolicyMsg;

/// One tick as it was recorded, and its torque.
type Tick = (TickRecord, JointVector);

/// A rollout of `from`, with each of `to` swapped in before its tick of Execute.
fn swapped(
    model: &ArmModel,
    config: &ControllerConfig,
    from: &PolicyMsg,
    to: &[(&PolicyMsg, usize)],
) -> Vec<Tick> {
    let policy = |message: &PolicyMsg| -> Policy { admit(message, model, config).unwrap() };
    let mut arm = IdealArm::new(model, &WAM7_START_POSTURE, config.period_s(), 0.01);
    let mut controller = controller(model, config);
    controller.start(&policy(from));
    let (mut ticks, mut executed) = (Vec::new(), 0);
    while controller.phase() != Phase::Idle {
        if matches!(controller.phase(), Phase::Execute | Phase::Settle) {
            for (to, _) in to.iter().filter(|(_, at)| *at == executed) {
                controller.swap(&policy(to));
            }
            executed += 1;
        }
        let mut record = TickRecord::ZERO;
        let tau = controller.tick(&arm.measure(), &mut record);
        arm.apply(&tau);
        arm.advance();
        ticks.push((record, tau));
    }
    ticks
}

fn executed(ticks: &[Tick]) -> Vec<&Tick> {
    ticks.iter().filter(|(record, _)| record.phase >= Phase::Execute as u32).collect()
}

#[test]
fn torque_steps_stay_within_the_rate_limit_wherever_a_very_different_policy_enters() {
    let model = wam();
    let limits = *model.limits();
    let (soft, violent) = (message(0.02, 100.0), message(-0.5, 3e4));
    let mut fastest: f64 = 0.0;
    for blend_s in [0.0, 0.005, 0.1] {
        for torque_rate in [20.0, 200.0] {
            let config = ControllerConfig { blend_s, torque_rate, ..Default::default() };
            let step = limits.tau_max * torque_rate * config.period_s() * (1.0 + 1e-12);
            for at in (0..1500).step_by(50) {
                let ticks = swapped(&model, &config, &soft, &[(&violent, at)]);
                for pair in ticks.windows(2) {
                    for i in 0..7 {
                        let change = (pair[1].1[i] - pair[0].1[i]).abs();
                        assert!(change <= step[i], "joint {i} jumps at swap {at}, {blend_s} s");
                        fastest = fastest.max(change / step[i]);
                    }
                }
            }
        }
    }
    assert!(fastest > 0.99, "the swaps were meant to reach the limit: {fastest}");
}

#[test]
fn a_blend_leads_from_the_old_policy_to_the_new_without_a_step() {
    let model = wam();
    let config = ControllerConfig { blend_s: 0.1, ..Default::default() };
    let (from, to) = (message(0.02, 200.0), message(-0.06, 300.0));
    let at = 700;
    let undisturbed = swapped(&model, &config, &from, &[]);
    let ticks = swapped(&model, &config, &from, &[(&to, at)]);
    let (undisturbed, ticks) = (executed(&undisturbed), executed(&ticks));
    assert_eq!(undisturbed[..at], ticks[..at], "nothing happens before the swap");

    let height = |tick: &Tick| tick.0.attractor[2];
    let step = |k: usize| (height(ticks[k]) - height(ticks[k - 1])).abs();
    let gap = (height(ticks[at + 100]) - height(undisturbed[at + 100])).abs();
    assert!(gap > 0.04, "the policies differ: {gap}");
    let largest = (at..at + 110).map(step).fold(0.0, f64::max);
    // A smooth step over n ticks is at most 1.5/n of its height steep.
    assert!(largest < 1.7 * gap / 100.0 + 2e-3, "{largest} of {gap}");
    // From the end of the window on the new policy acts alone: what it asks for depends on the time
    // only.
    let alone = swapped(&model, &config, &to, &[]);
    let alone = executed(&alone);
    let mixed = |k: usize| ticks[k].0.attractor != alone[k].0.attractor;
    assert!((at..at + 100).all(mixed), "the window is 100 ticks long");
    assert!(!(at + 100..at + 300).any(mixed));
}

#[test]
fn springs_give_way_to_a_field_and_come_back_without_a_step() {
    let model = wam();
    let limits = *model.limits();
    let (springs, field) = (message(0.02, 200.0), field());
    for blend_s in [0.0, 0.1] {
        let config = ControllerConfig { blend_s, ..Default::default() };
        let step = limits.tau_max * config.torque_rate * config.period_s() * (1.0 + 1e-12);
        let ticks = swapped(&model, &config, &springs, &[(&field, 400), (&springs, 900)]);
        for pair in ticks.windows(2) {
            for i in 0..7 {
                assert!((pair[1].1[i] - pair[0].1[i]).abs() <= step[i], "joint {i}, {blend_s} s");
            }
        }
        let ticks = executed(&ticks);
        assert!(ticks.iter().all(|(record, _)| record.fault == 0));
        // The field alone goes to its target; springs alone hold what they pull to.
        let away = |k: usize, to: &[f64]| -> f64 {
            (0..3).map(|i| (ticks[k].0.x[i] - to[i]).abs()).fold(0.0, f64::max)
        };
        assert!(away(890, &field.target) < 0.5 * away(400, &field.target), "it went there");
        let springs_alone = swapped(&model, &config, &springs, &[]);
        let end = executed(&springs_alone).last().unwrap().0.x;
        assert!(away(ticks.len() - 1, &end) < 5e-3, "and came back");
        if blend_s > 0.0 {
            let largest = |range: std::ops::Range<usize>| -> f64 {
                let step = |k: usize| (ticks[k].1 - ticks[k - 1].1).abs().max();
                range.map(step).fold(0.0, f64::max)
            };
            // What a blend asks for changes as smoothly as what either policy does.
            assert!(largest(400..500) < 2.0 && largest(900..1000) < 2.0, "{}", largest(400..500));
        }
    }
}

#[test]
fn a_policy_swapped_for_itself_changes_nothing() {
    let model = wam();
    let config = ControllerConfig { blend_s: 0.0, ..Default::default() };
    let policy = message(0.05, 200.0);
    let undisturbed = swapped(&model, &config, &policy, &[]);
    assert_eq!(swapped(&model, &config, &policy, &[(&policy, 333)]), undisturbed);

    let config = ControllerConfig { blend_s: 0.1, ..Default::default() };
    let blended = swapped(&model, &config, &policy, &[(&policy, 333)]);
    for ((_, a), (_, b)) in blended.iter().zip(&undisturbed) {
        assert!((a - b).abs().max() < 1e-9);
    }
}

#[test]
fn the_phase_goes_on_where_the_durations_differ() {
    let model = wam();
    let config = ControllerConfig::default();
    let (long, mut short) = (message(0.02, 200.0), message(0.02, 200.0));
    short.duration_s = 0.7;
    let short = short.sealed();
    let ticks = swapped(&model, &config, &long, &[(&short, 700)]);
    let ticks = executed(&ticks);
    assert!((ticks[699].0.t_s - 0.699).abs() < 1e-9);
    assert!((ticks[700].0.t_s - 0.35).abs() < 1e-9, "half of it is half of it");
    let settle = ticks.iter().position(|(record, _)| record.phase == Phase::Settle as u32);
    assert_eq!(settle, Some(1050), "the second half takes 0.35 s");
    let back = swapped(&model, &config, &short, &[(&long, 750)]);
    let back = executed(&back);
    assert!((back[750].0.t_s - 1.45).abs() < 1e-9, "50 ms after the end is 50 ms after the end");
}

#[test]
fn a_tripped_loop_holds_until_the_next_rollout() {
    let model = wam();
    let config = ControllerConfig::default();
    let policy = admit(&message(0.05, 200.0), &model, &config).unwrap();
    let mut arm = IdealArm::new(&model, &WAM7_START_POSTURE, config.period_s(), 0.01);
    let mut controller = controller(&model, &config);
    let mut record = TickRecord::ZERO;
    controller.start(&policy);
    for _ in 0..100 {
        arm.apply(&controller.tick(&arm.measure(), &mut record));
        arm.advance();
    }
    controller.trip(Fault::Overrun);
    controller.tick(&arm.measure(), &mut record);
    assert_eq!((record.fault, controller.phase()), (Fault::Overrun as u32, Phase::Idle));
    controller.trip(Fault::Singular);
    assert_eq!(controller.fault(), Fault::Overrun, "the first fault is the one that is told");
    controller.start(&policy);
    assert_eq!(controller.fault(), Fault::None);
}
