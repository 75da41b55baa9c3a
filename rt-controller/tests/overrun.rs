//! A loop that is late too often holds the arm and says so; one that cannot keep up is not started.

mod common;

use std::sync::atomic::AtomicBool;
use std::time::Duration;

use common::faulty::{Faulty, Switch, Wrong};
use common::service::Service;
use common::{message, referee, wam};
use physics::pancake::WAM7_START_POSTURE;
use rt_controller::fault::Fault;
use rt_controller::run::Controlled;
use rt_controller::{ControllerConfig, Pace, RunError, Station};
use shm_types::cell::Cell;
use shm_types::command::{COMMAND_PIN, Command, Status};
use shm_types::equipment::Equipment;

fn config() -> ControllerConfig {
    ControllerConfig { period_us: 2000, overruns_max: 5, ..Default::default() }
}

#[test]
fn late_ticks_in_a_row_hold_the_arm_and_a_rollout_in_time_runs_again() {
    let (model, config, switch) = (wam(), config(), Switch::new());
    let pace = Pace::Realtime;
    let service = Service { name: "late", model: &model, config: &config, pace, state: None };
    service.run(&mut Faulty::new(&model, &config, &switch), |operator| {
        let id = operator.import(message(0.005, 200.0));
        operator.activate(id);
        switch.set(Wrong::Late);
        let is = |fault: Fault| move |status: &Status| status.fault == fault as u64;
        let late = operator.until("the hold", is(Fault::Overrun));
        assert!(late.deadline_misses >= 5, "{} misses", late.deadline_misses);
        assert_eq!(late.rollbacks, 0, "the policy is not to blame");
        assert_eq!(late.latched_fault, 0, "nor is the machine: the host is");
        switch.set(Wrong::Nothing);
        std::thread::sleep(Duration::from_millis(50));
        operator.activate(id);
        operator.until("a rollout without fault", is(Fault::None));
    });
    switch.expect_torques_in_bounds();
}

#[test]
fn no_rollout_begins_while_the_loop_keeps_overrunning() {
    let (model, config, switch) = (wam(), config(), Switch::new());
    let pace = Pace::Realtime;
    let service = Service { name: "over", model: &model, config: &config, pace, state: None };
    service.run(&mut Faulty::new(&model, &config, &switch), |operator| {
        let id = operator.import(message(0.005, 200.0));
        operator.activate(id);
        operator.ok(Command::new(COMMAND_PIN, 0));
        operator.until("service", |status| status.rollouts_served > 0);
        switch.set(Wrong::Late);
        operator.until("the hold", |status| status.fault == Fault::Overrun as u64);
        // The rollout that was cut short is counted by now, or in a moment.
        std::thread::sleep(Duration::from_millis(100));
        let (served, tick) = (operator.status().rollouts_served, operator.status().tick);
        operator.until("100 late ticks", |status| status.tick > tick + 100);
        let status = operator.status();
        assert_eq!(status.rollouts_served, served, "a rollout began on a host that is late");
        assert_eq!(status.fault, Fault::Overrun as u64, "said as long as it lasts");
        switch.set(Wrong::Nothing);
        operator.until("service again", |status| {
            status.fault == Fault::None as u64 && status.rollouts_served > served
        });
    });
    switch.expect_torques_in_bounds();
}

#[test]
fn a_period_that_cannot_be_held_is_refused_with_one_that_can() {
    let cell = Cell::new(&format!("slow-{}", std::process::id())).unwrap();
    let (model, config, switch) = (wam(), config(), Switch::new());
    switch.set(Wrong::Late);
    let plant = &mut Faulty::new(&model, &config, &switch);
    let (q0, referee) = (WAM7_START_POSTURE, referee());
    let controlled = Controlled { model: &model, plant, q0, referee };
    let stop = AtomicBool::new(false);
    let station = Station { cell: &cell, state: None, equipment: Equipment::UNKNOWN };
    let refused = rt_controller::run(station, &config, Pace::Realtime, controlled, &stop);
    let refused = refused.unwrap_err();
    let RunError::Period { period_us, needed_us, enough_us } = refused else { panic!("{refused}") };
    assert_eq!(period_us, 2000);
    assert!(needed_us >= 4500.0 && enough_us > needed_us, "{needed_us} µs, {enough_us} µs");
}
