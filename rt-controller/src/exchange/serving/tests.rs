//! The state machine alone: every way a policy becomes active, good, or neither.

use shm_types::command::AT_NEXT_ROLLOUT;
use shm_types::policy::PolicyMsg;

use super::*;

fn policy(id: u64) -> Arc<Served<u64>> {
    let message = PolicyMsg { policy_id: id, damping: id as f64, ..PolicyMsg::EMPTY }.sealed();
    Arc::new(Served { message, policy: id, n_records: 10 })
}

fn applied(seq: u64, policy: u64, in_rollout: bool) -> Applied<u64> {
    Applied { seq, tick: 100, at_ns: 0, in_rollout, policy }
}

fn next_id(serving: &mut Serving<u64>, learner: bool, alone: bool) -> Option<u64> {
    match serving.next(learner, alone) {
        Next::Serve(served, _) => Some(served.policy),
        Next::Learner => Some(0),
        Next::Nothing => None,
    }
}

/// Activates for the next rollout and lets it begin.
fn activate(serving: &mut Serving<u64>, id: u64) {
    let seq = serving.activate(policy(id), AT_NEXT_ROLLOUT).unwrap();
    assert_eq!(next_id(serving, true, false), Some(id), "before the learner");
    assert_eq!(serving.applied(&applied(seq, id, true)).unwrap().policy_id, id);
}

fn ended(serving: &mut Serving<u64>, id: u64, faulted: bool) -> bool {
    serving.served_rollout_ended(&policy(id).name(), faulted)
}

#[test]
fn an_activation_gets_one_rollout_and_the_learner_goes_on() {
    let mut serving = Serving::new(5);
    assert_eq!(next_id(&mut serving, false, true), None, "nothing to serve yet");
    activate(&mut serving, 1);
    assert!(ended(&mut serving, 1, false), "it is good now");
    assert!(!ended(&mut serving, 1, false), "it was already");
    assert_eq!(next_id(&mut serving, true, false), Some(0));
    assert_eq!(next_id(&mut serving, false, false), None);
    assert_eq!(next_id(&mut serving, false, true), Some(1), "served while alone");
}

#[test]
fn a_pinned_policy_is_served_whatever_a_learner_asks() {
    let mut serving = Serving::new(5);
    assert_eq!(serving.pin(true), Err(SwapRefused::NothingToPin));
    activate(&mut serving, 1);
    serving.pin(true).unwrap();
    assert_eq!(next_id(&mut serving, true, false), Some(1));
    serving.pin(false).unwrap();
    assert_eq!(next_id(&mut serving, true, false), Some(0));
}

#[test]
fn a_swap_under_way_keeps_others_out_until_it_has_faded_in() {
    let mut serving = Serving::new(5);
    let seq = serving.activate(policy(1), AT_NOW).unwrap();
    let refused = serving.activate(policy(2), AT_NOW).unwrap_err().to_string();
    assert!(refused.contains("policy 1 is under way"), "{refused}");
    assert_eq!(serving.swap_now().unwrap().0, seq);
    assert!(serving.swap_now().is_none(), "handed over once");
    assert!(serving.applied(&applied(seq + 7, 1, true)).is_none(), "about no swap of ours");
    serving.applied(&applied(seq, 1, true)).unwrap();
    serving.passed(104, true);
    assert!(serving.activate(policy(2), AT_NOW).is_err(), "still fading");
    serving.passed(105, true);
    serving.activate(policy(2), AT_NOW).unwrap();
    assert_eq!((serving.applied, serving.torn), (1, 0));
}

#[test]
fn a_policy_swapped_into_an_idle_loop_gets_its_rollout() {
    let mut serving = Serving::new(5);
    let seq = serving.activate(policy(1), AT_NOW).unwrap();
    serving.swap_now().unwrap();
    serving.applied(&applied(seq, 1, false)).unwrap();
    assert_eq!(next_id(&mut serving, true, false), Some(1));
    assert_eq!(next_id(&mut serving, true, false), Some(0));
}

#[test]
fn what_comes_back_different_is_counted_as_torn() {
    let mut serving = Serving::new(0);
    let seq = serving.activate(policy(1), AT_NOW).unwrap();
    serving.swap_now().unwrap();
    serving.applied(&applied(seq, 99, true)).unwrap();
    assert_eq!(serving.torn, 1);
}

#[test]
fn rollback_walks_the_activations_back_and_ends_at_the_last_good() {
    let mut serving = Serving::new(0);
    assert_eq!(serving.rollback(AT_NOW), Err(SwapRefused::NoWayBack));
    for id in 1..=3 {
        activate(&mut serving, id);
    }
    serving.proved_itself(policy(7));
    for expected in [2, 1, 7] {
        let seq = serving.rollback(AT_NEXT_ROLLOUT).unwrap();
        assert_eq!(next_id(&mut serving, false, false), Some(expected));
        serving.applied(&applied(seq, expected, true)).unwrap();
    }
    assert_eq!(serving.rollback(AT_NOW), Err(SwapRefused::NoWayBack), "the good one is active");
    assert_eq!(serving.rollbacks, 3);
}

#[test]
fn a_fault_leads_back_to_the_last_good_policy_and_its_own_to_none() {
    let mut serving = Serving::new(0);
    activate(&mut serving, 1);
    ended(&mut serving, 1, false);
    activate(&mut serving, 2);
    serving.pin(true).unwrap();
    assert!(ended(&mut serving, 2, true));
    assert_eq!(next_id(&mut serving, true, false), Some(1), "still pinned, to the good one");
    assert_eq!(serving.rollbacks, 1);
    assert_eq!(serving.rollback(AT_NOW), Err(SwapRefused::NoWayBack), "it is there already");
    assert!(ended(&mut serving, 1, true));
    assert_eq!(next_id(&mut serving, false, true), None, "held, nothing is good any more");
    assert!(!serving.is_pinned());
}

#[test]
fn a_rollout_that_never_began_ends_its_swap() {
    let mut serving = Serving::new(0);
    let seq = serving.activate(policy(1), AT_NEXT_ROLLOUT).unwrap();
    next_id(&mut serving, false, false);
    assert_eq!(serving.abandon(), Some(seq));
    activate(&mut serving, 2);
    assert_eq!(serving.abandon(), None);
}

#[test]
fn a_dropped_policy_is_neither_served_nor_a_way_back() {
    let mut serving = Serving::new(0);
    activate(&mut serving, 1);
    ended(&mut serving, 1, false);
    activate(&mut serving, 2);
    activate(&mut serving, 3);
    serving.pin(true).unwrap();
    serving.drop_policy(policy(3).message.digest);
    assert_eq!(serving.active().unwrap().policy, 2);
    serving.drop_policy(policy(1).message.digest);
    assert_eq!(serving.rollback(AT_NOW), Err(SwapRefused::NoWayBack));
    serving.drop_policy(policy(2).message.digest);
    assert!(serving.served().is_none() && !serving.is_pinned());
}
