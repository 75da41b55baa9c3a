//! Both ends of every channel, over real shared memory.

use std::time::{Duration, Instant};

use shm_types::SCHEMA;
use shm_types::cell::{Cell, Role};
use shm_types::channel::ChannelError;
use shm_types::command::{COMMAND_STATUS, Command, Reply, Status};
use shm_types::episode::{Ack, EpisodeHeader};
use shm_types::policy::PolicyMsg;
use shm_types::ports::{ControllerPorts, LearnerPorts, ToolPorts};

const SOON: Duration = Duration::from_secs(5);

fn cell(name: &str) -> Cell {
    Cell::new(&format!("{name}-{}", std::process::id())).unwrap()
}

/// Waits with a watchdog; channels are asynchronous.
fn eventually<T>(what: &str, mut f: impl FnMut() -> Option<T>) -> T {
    let deadline = Instant::now() + SOON;
    while Instant::now() < deadline {
        if let Some(value) = f() {
            return value;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("{what} did not arrive");
}

#[test]
fn policy_goes_out_and_its_episode_comes_back_in_place() {
    let cell = cell("ring");
    let lock = cell.lock(Role::Controller).unwrap();
    let controller = ControllerPorts::create(&cell).unwrap();
    let learner = LearnerPorts::open(&cell, SOON, &|| false).unwrap();

    let mut policy = PolicyMsg { rollout: 7, n_components: 1, ..PolicyMsg::EMPTY };
    policy.components[0].attractor[2] = 0.72;
    learner.policies.send_copy(policy.sealed()).unwrap();
    let received = eventually("policy", || controller.policies.receive().unwrap());
    assert_eq!(*received, policy.sealed());
    received.validate().unwrap();

    let mut loan = controller.loan_episode(50).unwrap();
    // As in the controller: another thread fills the loan.
    let filled = std::thread::spawn(move || {
        for (i, record) in loan.payload_mut().iter_mut().take(30).enumerate() {
            record.t_s = i as f64;
        }
        loan
    });
    let mut loan = filled.join().unwrap();
    *loan.user_header_mut() = EpisodeHeader { rollout: 7, n_records: 30, ..Default::default() };
    assert_eq!(loan.send().unwrap(), 1);
    controller.episode_sent.notify().unwrap();
    let mut woken = false;
    learner.episode_sent.timed_wait(|_| woken = true, SOON).unwrap();
    assert!(woken);
    let episode = eventually("episode", || learner.episodes.receive().unwrap());
    let records = episode.user_header().validate(episode.payload()).unwrap();
    assert_eq!((records.len(), records[29].t_s), (30, 29.0));

    learner
        .acks
        .send_copy(Ack { schema: SCHEMA, session: 1, durable_rollout: 7, rollout: 9, success: 1 })
        .unwrap();
    let ack = eventually("ack", || controller.acks.receive().unwrap());
    let covered: Vec<u64> = (5..11).filter(|rollout| ack.covers(1, *rollout)).collect();
    assert_eq!(covered, [5, 6, 7, 9]);
    assert!(!ack.covers(2, 7));

    drop((controller, learner, received, episode, ack, lock));
    cell.remove_if_idle();
}

/// The old controller's services may be of any state: the learner moves over to the new one's.
#[test]
fn a_learner_follows_to_the_services_of_a_new_controller() {
    let cell = cell("late");
    let lock = cell.lock(Role::Controller).unwrap();
    let first = ControllerPorts::create(&cell).unwrap();
    let mut learner = LearnerPorts::open(&cell, SOON, &|| false).unwrap();
    assert!(!learner.follow().unwrap(), "nobody has come");
    drop(first);
    assert!(!learner.follow().unwrap(), "it has gone, and nobody has come");
    let second = ControllerPorts::create(&cell).unwrap();
    assert!(learner.follow().unwrap());
    learner.policies.send_copy(PolicyMsg { rollout: 2, ..PolicyMsg::EMPTY }).unwrap();
    let policy = eventually("policy", || second.policies.receive().unwrap());
    assert_eq!(policy.rollout, 2);
    drop((policy, second, learner, lock));
    cell.remove_if_idle();
}

#[test]
fn command_is_answered_and_silence_is_noticed() {
    let cell = cell("ask");
    let lock = cell.lock(Role::Controller).unwrap();
    let controller = ControllerPorts::create(&cell).unwrap();
    let tool = ToolPorts::open(&cell, SOON).unwrap();
    let ask = |id| Command::new(COMMAND_STATUS, id);
    assert!(tool.request(&ask(1), Duration::from_millis(20)).is_none());

    let asked = std::thread::scope(|scope| {
        let client = scope.spawn(|| tool.request(&ask(2), SOON));
        let deadline = Instant::now() + SOON;
        while !client.is_finished() && Instant::now() < deadline {
            while let Some(request) = controller.commands.receive().unwrap() {
                let reply = Reply::accepted(request.id, Status { tick: 42, ..Status::ZERO });
                // The first, abandoned request has nobody left to answer to.
                let _ = request.send_copy(reply);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        client.join().unwrap()
    });
    assert_eq!(asked.map(|reply| (reply.id, reply.status.tick)), Some((2, 42)));
    drop((tool, controller, lock));
    cell.remove_if_idle();
}

#[test]
fn absent_controller_is_named() {
    let cell = cell("none");
    let error = LearnerPorts::open(&cell, Duration::from_millis(20), &|| false).err().unwrap();
    assert!(matches!(error, ChannelError::NoController { .. }), "{error}");
    cell.remove_if_idle();
}
