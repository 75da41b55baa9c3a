//! After a fault under a new policy the last good one is served again, and after one of its own the
//! arm is held.

mod common;

use std::time::Duration;

use common::faulty::{Faulty, START_HEIGHT_M, Switch, Wrong};
use common::service::Service;
use common::{message, wam};
use rt_controller::{ControllerConfig, Pace};
use shm_types::command::{COMMAND_PIN, Command};

#[test]
fn a_fault_leads_back_by_itself() {
    // An arm that is carried away under a policy, and nothing that would tell the policy from the
    // machine.
    let config = ControllerConfig { disturbance_max: 1000.0, ..Default::default() };
    let (model, switch) = (wam(), Switch::new());
    // Above a height that the gentle policy never reaches.
    switch.only_above(START_HEIGHT_M + 0.012);
    switch.set(Wrong::CarriedAway);
    let pace = Pace::Max;
    let service = Service { name: "back", model: &model, config: &config, pace, state: None };
    service.run(&mut Faulty::new(&model, &config, &switch), |operator| {
        let gentle = operator.import(message(0.005, 200.0));
        let high = operator.import(message(0.08, 200.0));
        operator.activate(gentle);
        operator.ok(Command::new(COMMAND_PIN, 0));
        operator.until("proof", |status| status.last_good.policy_id == gentle);
        operator.activate(high);
        let back = operator.until("the way back", |status| status.rollbacks == 1);
        assert_eq!((back.active.policy_id, back.pinned), (gentle, 1));
        let served = back.rollouts_served;
        operator.until("service", |status| status.rollouts_served > served + 2);

        switch.only_above(f64::NEG_INFINITY);
        let held = operator.until("the hold", |status| status.active.is_none());
        assert_eq!((held.rollbacks, held.pinned), (1, 0), "there is nothing left to go back to");
        assert!(held.last_good.is_none());
        assert_eq!(held.latched_fault, 0, "a policy's fault does not latch");
        let served = held.rollouts_served;
        std::thread::sleep(Duration::from_millis(50));
        assert_eq!(operator.status().rollouts_served, served, "the arm is held");
    });
    switch.expect_torques_in_bounds();
}
