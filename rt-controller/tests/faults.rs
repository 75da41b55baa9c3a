//! Faults of the machine: found, held, latched over a restart, re-armed by hand only.

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use common::faulty::{Faulty, Switch, Wrong};
use common::service::{Operator, SOON, Service};
use common::{controller, message, wam};
use physics::arm::ArmModel;
use physics::plant::Plant;
use rt_controller::admit::admission::admit;
use rt_controller::fault::Fault;
use rt_controller::hot::rollout::Phase;
use rt_controller::hot::tick::Controller;
use rt_controller::{ControllerConfig, Pace};
use shm_types::command::{COMMAND_ACTIVATE, COMMAND_PIN, COMMAND_REARM, Command};
use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::policy::PolicyMsg;
use shm_types::ports::LearnerPorts;

/// What goes wrong, what it is called, and within how many ticks of a brisk rollout.
const CASES: [(Wrong, Fault, u32); 6] = [
    (Wrong::NotANumber, Fault::MeasurementNotFinite, 2),
    (Wrong::Stale, Fault::MeasurementStale, 7),
    (Wrong::FrozenSensor, Fault::MeasurementInconsistent, 50),
    (Wrong::FrozenPosition, Fault::MeasurementInconsistent, 50),
    (Wrong::Stuck, Fault::UnexpectedForce, 50),
    (Wrong::Pushed, Fault::UnexpectedForce, 50),
];
/// An arm that is held rests: none of its joints is faster after a second, rad/s.
const REST: f64 = 0.05;

fn brisk() -> PolicyMsg {
    message(0.15, 500.0)
}

/// The wrist may be clipped.
fn brisk_config() -> ControllerConfig {
    ControllerConfig { dry_run_clipped: 1.0, ..Default::default() }
}

#[test]
fn every_fault_is_found_soon_by_its_name_and_the_arm_is_held_within_bounds() {
    let (model, config) = (wam(), brisk_config());
    let policy = admit(&brisk(), &model, &config).unwrap();
    for (wrong, fault, within) in CASES {
        let switch = Switch::new();
        let mut arm = Faulty::new(&model, &config, &switch);
        let mut controller = controller(&model, &config);
        let mut record = TickRecord::ZERO;
        controller.start(&policy);
        let mut cycle = |controller: &mut Controller| {
            let tau = controller.tick(&arm.measure(), &mut record);
            arm.apply(&tau);
            arm.advance();
            arm.truth().qd.abs().max()
        };
        for _ in 0..250 {
            cycle(&mut controller);
        }
        assert_eq!((controller.fault(), controller.phase()), (Fault::None, Phase::Execute));

        switch.set(wrong);
        let ticks = (1..=within).find(|_| {
            cycle(&mut controller);
            controller.fault() != Fault::None
        });
        assert_eq!(controller.latched(), Some(fault), "{wrong:?} after {ticks:?} ticks");
        assert_eq!(controller.phase(), Phase::Idle, "{wrong:?}");
        let speeds: Vec<f64> = (0..1000).map(|_| cycle(&mut controller)).collect();
        let (fastest, last) = (speeds.iter().copied().fold(0.0, f64::max), speeds[999]);
        println!("{wrong:?} after {ticks:?} ticks: up to {fastest:.2}, then {last:.3} rad/s");
        match wrong {
            // Pressed with the whole torque of a joint, the arm yields no faster than it damps.
            Wrong::Pushed => assert!(fastest < 1.0 / config.hold_damping, "{fastest} rad/s"),
            _ => assert!(last < REST, "{wrong:?}: still at {last} rad/s"),
        }
        assert_eq!(controller.latched(), Some(fault), "{wrong:?}");
        controller.start(&policy);
        cycle(&mut controller);
        assert_eq!(controller.phase(), Phase::Idle, "{wrong:?}: no rollout before it is re-armed");

        // Mended, it may be re-armed after a while, not at once; what shows nothing at rest, at once.
        switch.set(Wrong::Nothing);
        if !matches!(wrong, Wrong::Stuck | Wrong::Pushed | Wrong::FrozenPosition) {
            controller.rearm();
            assert_eq!(controller.latched(), Some(fault), "{wrong:?}: too early");
        }
        let speed = (0..1500).map(|_| cycle(&mut controller)).last().unwrap();
        assert!(speed < REST, "{wrong:?}, over: still at {speed} rad/s");
        controller.rearm();
        assert_eq!(controller.latched(), None, "{wrong:?}");
        switch.expect_torques_in_bounds();
    }
}

/// A folder that ends with its test.
struct Dir(PathBuf);

impl Dir {
    fn new(name: &str) -> Dir {
        let name = format!("skillet-{name}-{}", std::process::id());
        Dir(std::env::temp_dir().join(name))
    }

    /// The flight records, once all `n` are there.
    fn records(&self, n: usize) -> Vec<String> {
        let start = Instant::now();
        loop {
            let entries = fs::read_dir(self.0.join("faults")).into_iter().flatten().flatten();
            let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
            paths.retain(|path| path.extension().is_some_and(|e| e == "csv"));
            if paths.len() >= n {
                paths.sort();
                return paths.iter().map(|path| fs::read_to_string(path).unwrap()).collect();
            }
            assert!(start.elapsed() < SOON, "{} flight records of {n}", paths.len());
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Dir {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn service<'a>(
    name: &'a str,
    model: &'a ArmModel,
    config: &'a ControllerConfig,
    pace: Pace,
    state: &'a Path,
) -> Service<'a> {
    Service { name, model, config, pace, state: Some(state) }
}

/// The ticks up to the one with the fault, one a line.
fn check_record(text: &str, fault: Fault) {
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let column = |name: &str| rows[0].iter().position(|column| *column == name).unwrap();
    let (tick, why) = (column("tick"), column("fault"));
    column("q1_rad");
    column("tau7_Nm");
    assert!(rows.len() > 20 && rows.len() <= 1001, "{} lines", rows.len());
    assert!(rows.iter().all(|row| row.len() == rows[0].len()), "a table");
    let number = |row: &Vec<&str>| row[tick].parse::<u64>().unwrap();
    assert!(rows[1..].windows(2).all(|pair| number(&pair[1]) == number(&pair[0]) + 1));
    let last = rows.last().unwrap();
    assert_eq!(last[why], Fault::describe(fault as u32), "the tick of the fault is the last");
    assert_eq!(rows[rows.len() - 2][why], "none");
    assert_eq!(last.contains(&"NaN"), fault == Fault::MeasurementNotFinite, "as it was measured");
}

fn rearm_when_gone(operator: &Operator) {
    operator.until("the cause to be gone", |status| status.latched_present == 0);
    operator.ok(Command::new(COMMAND_REARM, 0));
    assert_eq!(operator.status().latched_fault, 0);
}

#[test]
fn a_machine_fault_holds_the_arm_until_it_is_rearmed_and_blames_no_policy() {
    let (model, config) = (wam(), brisk_config());
    for (wrong, _, _) in CASES {
        let (dir, switch) = (Dir::new(&format!("latch-{wrong:?}")), Switch::new());
        let service = service("latch", &model, &config, Pace::Max, &dir.0);
        service.run(&mut Faulty::new(&model, &config, &switch), |operator| {
            let id = operator.import(brisk());
            operator.activate(id);
            operator.ok(Command::new(COMMAND_PIN, 0));
            operator.until("service", |status| status.rollouts_served > 1);
            let why = operator.refused(COMMAND_REARM);
            assert!(why.contains("no fault is latched"), "{why}");

            switch.set(wrong);
            let held = operator.until("the latch", |status| status.latched_fault != 0);
            let fault = Fault::latching(held.latched_fault as u32).unwrap();
            assert_eq!((held.rollbacks, held.active.policy_id, held.pinned), (0, id, 1));
            check_record(&dir.records(1)[0], fault);
            if [Wrong::NotANumber, Wrong::Stale, Wrong::Pushed].contains(&wrong) {
                // The others show nothing while the arm rests.
                let why = operator.refused(COMMAND_REARM);
                assert!(why.contains(Fault::describe(fault as u32)), "{why}");
            }
            let served = operator.status().rollouts_served;
            std::thread::sleep(Duration::from_millis(50));
            assert_eq!(operator.status().rollouts_served, served, "no rollout is started");
            let why = operator.refused(COMMAND_ACTIVATE);
            assert!(why.contains("skillet rearm"), "{why}");

            switch.set(Wrong::Nothing);
            rearm_when_gone(operator);
            operator.until("service again", |status| status.rollouts_served > served + 1);
        });
        switch.expect_torques_in_bounds();
    }
}

#[test]
fn a_fault_while_idle_latches_and_a_restart_does_not_rearm() {
    let (model, config) = (wam(), brisk_config());
    let (dir, switch) = (Dir::new("restart"), Switch::new());
    let run = |operate: &dyn Fn(&Operator)| {
        let service = service("restart", &model, &config, Pace::Realtime, &dir.0);
        service.run(&mut Faulty::new(&model, &config, &switch), operate);
    };
    run(&|operator| {
        operator.until("ticks", |status| status.tick > 100);
        switch.set(Wrong::NotANumber);
        let held = operator.until("the latch", |status| status.latched_fault != 0);
        assert_eq!(held.latched_fault, Fault::MeasurementNotFinite as u64);
        dir.records(1);
        switch.set(Wrong::Nothing);
    });
    run(&|operator| {
        let held = operator.until("ticks", |status| status.tick > 300);
        assert_eq!(held.latched_fault, Fault::MeasurementNotFinite as u64, "remembered");
        assert_eq!((held.fault, held.fault_records), (held.latched_fault, 1));
        rearm_when_gone(operator);
    });
    run(&|operator| {
        assert_eq!(operator.status().latched_fault, 0, "re-armed is remembered, too");
        assert_eq!(operator.status().fault_records, 1);
    });
}

/// The next episode, its records without the number of the tick.
fn episode(ports: &LearnerPorts) -> (EpisodeHeader, Vec<TickRecord>) {
    let start = Instant::now();
    while start.elapsed() < SOON {
        if let Ok(Some(sample)) = ports.episodes.receive() {
            let header = *sample.user_header();
            let records = header.validate(sample.payload()).unwrap();
            return (header, records.iter().map(|r| TickRecord { tick: 0, ..*r }).collect());
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    panic!("no episode within {SOON:?}");
}

#[test]
fn a_proposal_waits_for_the_rearm_and_comes_out_the_same() {
    let (model, config) = (wam(), brisk_config());
    let proposal =
        |rollout| PolicyMsg { session: 7, rollout, policy_id: rollout, ..brisk() }.sealed();
    for wrong in [Wrong::Stale, Wrong::Pushed, Wrong::NotANumber] {
        let (dir, switch) = (Dir::new(&format!("same-{wrong:?}")), Switch::new());
        let service = service("same", &model, &config, Pace::Max, &dir.0);
        service.run(&mut Faulty::new(&model, &config, &switch), |operator| {
            let ports = LearnerPorts::open(operator.cell, SOON, &|| false).unwrap();
            let ask = |rollout| {
                ports.policies.send_copy(proposal(rollout)).unwrap();
            };
            ask(1);
            let (undisturbed, path) = episode(&ports);
            assert_eq!(undisturbed.fault, 0);
            switch.set(wrong);
            ask(2);
            let (cut_short, _) = episode(&ports);
            assert!(Fault::latching(cut_short.fault as u32).is_some(), "{}", cut_short.fault);
            ask(2);
            operator.until("the latch", |status| status.latched_fault != 0);
            std::thread::sleep(Duration::from_millis(300)); // three heartbeats
            let mut told = 0;
            while let Some(beat) = ports.controller_beat.receive().unwrap() {
                told = beat.latched;
            }
            assert_eq!(told, cut_short.fault, "the learner is told why it waits");
            assert!(ports.episodes.receive().unwrap().is_none(), "the proposal waits");

            switch.set(Wrong::Nothing);
            rearm_when_gone(operator);
            let (again, same) = episode(&ports);
            assert!(again.fault == 0 && same == path, "{wrong:?}: not the same rollout");
        });
        switch.expect_torques_in_bounds();
    }
}
