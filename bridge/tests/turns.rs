//! Cells learn over a bridge: real sockets, real shared memory, a hub that is a process of its own where it is killed.
//!
//! What is executed is executed once, and what the learner has is what was executed, over every cut.

mod ends;

use std::process::{Child, Command, Stdio};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use bridge::event::Event;
use bridge::hub::{self, HubConfig};
use ends::{
    Executed, Machines, Running, SESSION, TICK, controller, has, header_of, learner, policy,
};
use shm_types::SCHEMA;
use shm_types::cell::{Cell, Role};
use shm_types::channel::ChannelError;
use shm_types::command::{ACCEPTED, COMMAND_HOLD, Command as ToolCommand};
use shm_types::episode::{Ack, EpisodeHeader};
use shm_types::ports::{LearnerPorts, ToolPorts};

const AT_ONCE: Duration = Duration::ZERO;
/// Longest wait for an answer.
const SOON: Duration = Duration::from_secs(30);

fn each_once(executed: &Running<Executed>, n: u64) {
    let rollouts = executed.look(|executed| executed.rollouts.clone());
    assert_eq!(rollouts, (1..=n).map(|rollout| (rollout, 1)).collect());
}

#[test]
fn a_cell_learns_over_a_bridge() {
    let machines = Machines::new();
    let executed = controller(machines.cell("cell", "kitchen"), 11, None);
    let learnt = learner(machines.cell("hub", "kitchen"), 6, AT_ONCE);
    let hub = machines.hub(1, &["kitchen"], None);
    let bridge = machines.join(2, machines.cell("cell", "kitchen"), None);
    learnt.until("all rollouts are learnt", |learnt| learnt.episodes.len() == 6);
    executed.until("all are acknowledged", |executed| executed.spool.is_empty());
    each_once(&executed, 6);
    assert!(hub.look(|events| has(events, "joined from")));
    bridge.until("the last one is durable there", |events| {
        events.contains(&Event::Durable { session: SESSION, rollout: 6 })
    });
    executed.state.lock().unwrap().latched = 14;
    learnt.until("a fault of the arm is known there", |learnt| learnt.latched == 14);
}

#[test]
fn two_cells_learn_side_by_side() {
    let machines = Machines::new();
    let names = ["kitchen", "lab"];
    let controllers = names.map(|name| controller(machines.cell(name, name), 11, None));
    let learners = names.map(|name| learner(machines.cell("hub", name), 3, AT_ONCE));
    let _hub = machines.hub(1, &names, None);
    let _joins = [("kitchen", 2), ("lab", 3)]
        .map(|(name, id)| machines.join(id, machines.cell(name, name), None));
    for (learnt, executed) in learners.iter().zip(&controllers) {
        learnt.until("all rollouts are learnt", |learnt| learnt.episodes.len() == 3);
        each_once(executed, 3);
    }
}

/// While the hub is away its cells hear of no learner, and what they executed waits.
#[test]
fn a_cell_goes_on_alone_through_a_partition_and_catches_up() {
    let machines = Machines::new();
    let executed = controller(machines.cell("cell", "kitchen"), 11, None);
    let learnt = learner(machines.cell("hub", "kitchen"), 4, Duration::from_millis(300));
    let hub = machines.hub(1, &["kitchen"], None);
    let bridge = machines.join(2, machines.cell("cell", "kitchen"), None);
    learnt.until("the first is learnt", |learnt| !learnt.episodes.is_empty());
    drop(hub);
    executed.until("no learner is heard", |executed| {
        executed.learner_heard.is_some_and(|at| at.elapsed() > Duration::from_secs(3))
    });
    assert!(bridge.look(|events| has(events, "no answer")));
    let _hub = machines.hub(3, &["kitchen"], None);
    learnt.until("all rollouts are learnt", |learnt| learnt.episodes.len() == 4);
    executed.until("a learner is heard again", |executed| {
        executed.learner_heard.is_some_and(|at| at.elapsed() < Duration::from_millis(500))
    });
    each_once(&executed, 4);
}

/// A cut cell must be missed by its learner, which asks others then.
#[test]
fn a_learner_hears_nothing_of_a_cell_that_is_gone() {
    let machines = Machines::new();
    let _executed = controller(machines.cell("cell", "kitchen"), 11, None);
    let learnt = learner(machines.cell("hub", "kitchen"), 1, AT_ONCE);
    let hub = machines.hub(1, &["kitchen"], None);
    let bridge = machines.join(2, machines.cell("cell", "kitchen"), None);
    learnt.until("its rollout is learnt", |learnt| !learnt.episodes.is_empty());
    learnt.until("it is heard", |learnt| learnt.controller_heard.is_some());
    drop(bridge);
    hub.until("the hub says so", |events| has(events, "its bridge on"));
    learnt.until("the learner hears nothing", |learnt| {
        learnt.controller_heard.is_some_and(|at| at.elapsed() > Duration::from_secs(1))
    });
    let _bridge = machines.join(3, machines.cell("cell", "kitchen"), None);
    learnt.until("and hears it again", |learnt| {
        learnt.controller_heard.is_some_and(|at| at.elapsed() < Duration::from_millis(300))
    });
}

#[test]
fn a_hub_that_is_killed_again_and_again_loses_nothing() {
    const N: u64 = 24;
    let machines = Machines::new();
    let executed = controller(machines.cell("cell", "kitchen"), 11, None);
    let learnt = learner(machines.cell("hub", "kitchen"), N, Duration::from_millis(40));
    let bridge = machines.join(2, machines.cell("cell", "kitchen"), None);
    for kill in 0..3 {
        let hub = hub_in_a_process(&machines, 20 + kill);
        let goal = (kill as usize + 1) * 6;
        learnt.until("the next six are learnt", |learnt| learnt.episodes.len() >= goal);
        drop(hub);
    }
    let hub = hub_in_a_process(&machines, 99);
    learnt.until("all rollouts are learnt", |learnt| learnt.episodes.len() == N as usize);
    executed.until("all are acknowledged", |executed| executed.spool.is_empty());
    drop(hub);
    each_once(&executed, N);
    assert!(
        bridge.look(|events| events.iter().any(|event| matches!(event, Event::Connected { .. })))
    );
}

/// Its tool asks the next hub the same, and that the cell, which knows it.
#[test]
fn a_command_whose_hub_is_killed_is_carried_out_once() {
    let machines = Machines::new();
    let executed = controller(machines.cell("cell", "kitchen"), 11, None);
    executed.state.lock().unwrap().is_mute = true;
    let config = machines.joins(2, machines.cell("cell", "kitchen"), None);
    let _bridge = machines.join_as(config);
    let hub = hub_in_a_process(&machines, 20);
    let there = machines.cell("hub", "kitchen");
    // The tool has its answer within one round of its own; a learner keeps the cell alive meanwhile.
    let _learnt = learner(there.clone(), 1, AT_ONCE);
    let asked = std::thread::spawn(move || {
        let tool = ToolPorts::open(&there, SOON).unwrap();
        while tool.status(SOON).is_none() {}
        tool.request(&ToolCommand::new(COMMAND_HOLD, 5), SOON)
    });
    executed.until("the command has come", |executed| executed.commands.len() == 1);
    drop(hub);
    let hub = hub_in_a_process(&machines, 21);
    executed.state.lock().unwrap().is_mute = false;
    let reply = asked.join().unwrap().expect("the reply of the one that was carried out");
    assert_eq!((reply.accepted, reply.applied_tick), (ACCEPTED, TICK));
    assert_eq!(executed.look(|executed| executed.commands.clone()), [COMMAND_HOLD]);
    drop(hub);
}

/// A process that is killed when it is dropped, by a test that fails too.
struct Killed(Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// This test's executable once more, as a hub.
fn hub_in_a_process(machines: &Machines, id: u64) -> Killed {
    let hub = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "hub_process", "--ignored", "--nocapture"])
        .env("BRIDGE_TEST_HUB", machines.path().join("hub"))
        .env("BRIDGE_TEST_ADDRESS", &machines.address)
        .env("BRIDGE_TEST_ID", id.to_string())
        .stdout(Stdio::null())
        .spawn();
    Killed(hub.unwrap())
}

#[test]
#[ignore = "the process that another test kills"]
fn hub_process() {
    let Some(dir) = std::env::var_os("BRIDGE_TEST_HUB") else { return };
    let of = |name: &str| std::env::var(name).unwrap();
    let config = HubConfig {
        listen: of("BRIDGE_TEST_ADDRESS"),
        keys: None,
        cells: vec![Cell::in_dir(dir.as_ref(), "kitchen").unwrap()],
        world: String::new(),
        id: of("BRIDGE_TEST_ID").parse().unwrap(),
    };
    hub::run(&config, &AtomicBool::new(false), &|_| {}).unwrap();
}

#[test]
fn tools_on_the_learners_machine_see_how_a_cell_is() {
    let machines = Machines::new();
    let _executed = controller(machines.cell("cell", "kitchen"), 11, None);
    let learnt = learner(machines.cell("hub", "kitchen"), 1, AT_ONCE);
    let _hub = machines.hub(1, &["kitchen"], None);
    let bridge = machines.join(2, machines.cell("cell", "kitchen"), None);
    learnt.until("its rollout is learnt", |learnt| !learnt.episodes.is_empty());
    let tool = ToolPorts::open(&machines.cell("hub", "kitchen"), SOON).unwrap();
    let reply = tool.ask(SOON).expect("the controller's own word");
    assert_eq!((reply.status.boot_id, reply.status.tick), (11, TICK));
    assert_eq!(reply.via(), Some(bridge::net::host_name()));
    drop(bridge);
    learnt.until("and then why there is none", |_| {
        matches!(tool.ask(SOON), Err(ChannelError::NotConnected { .. }))
    });
}

/// Ends with its learner's session, and is not lost with it.
#[test]
fn an_episode_of_another_session_stays_in_the_spool() {
    let machines = Machines::new();
    let old = EpisodeHeader { session: 0x01d, ..header_of(&policy(9), 10) };
    let executed = controller(machines.cell("cell", "kitchen"), 11, Some(old));
    let learnt = learner(machines.cell("hub", "kitchen"), 3, AT_ONCE);
    let _hub = machines.hub(1, &["kitchen"], None);
    let bridge = machines.join(2, machines.cell("cell", "kitchen"), None);
    learnt.until("all rollouts are learnt", |learnt| learnt.episodes.len() == 3);
    bridge.until("it is said", |events| has(events, "belongs to session 000000000000001d"));
    executed.until("and it stays alone", |executed| executed.spool.len() == 1);
    assert_eq!(learnt.look(|learnt| learnt.foreign), 0);
    each_once(&executed, 3);
}

/// While a cell is cut off its learner may go through sessions. What they acknowledge comes to it all the same.
#[test]
fn what_earlier_sessions_acknowledge_meanwhile_leaves_the_spool() {
    let machines = Machines::new();
    let of = |session| EpisodeHeader { session, ..header_of(&policy(9), 11) };
    let executed = controller(machines.cell("cell", "kitchen"), 11, Some(of(0x01d)));
    for session in [0x02d, 0x03d] {
        executed.state.lock().unwrap().spool.insert((session, 9), of(session));
    }
    let _hub = machines.hub(1, &["kitchen"], None);
    let bridge = machines.join(2, machines.cell("cell", "kitchen"), None);
    let learnt = learner(machines.cell("hub", "kitchen"), 1, AT_ONCE);
    learnt.until("its rollout is learnt", |learnt| learnt.episodes.len() == 1);
    executed.until("it is acknowledged", |executed| executed.spool.len() == 3);
    drop((learnt, bridge));
    acknowledge(&machines.cell("hub", "kitchen"), &[0x01d, 0x02d, SESSION]);
    let learnt = learner(machines.cell("hub", "kitchen"), 2, AT_ONCE);
    let _bridge = machines.join(3, machines.cell("cell", "kitchen"), None);
    learnt.until("the next session goes on", |learnt| learnt.episodes.contains_key(&2));
    executed.until("only what nobody has learnt is left", |executed| {
        executed.spool.keys().eq([&(0x03d, 9)])
    });
}

/// Learners of these sessions come one after the other, say what is durable, and go.
fn acknowledge(cell: &Cell, sessions: &[u64]) {
    let _lock = cell.lock(Role::Learner).unwrap();
    let ports = LearnerPorts::open(cell, SOON, &|| false).unwrap();
    for session in sessions {
        let durable_rollout = if *session == SESSION { 1 } else { 9 };
        let rollout = durable_rollout;
        let ack = Ack { schema: SCHEMA, session: *session, durable_rollout, rollout, success: 0 };
        ports.acks.send_copy(ack).unwrap();
        std::thread::sleep(Duration::from_millis(100));
    }
}

#[test]
fn a_second_bridge_of_one_name_is_refused_until_the_first_is_gone() {
    let machines = Machines::new();
    let first = controller(machines.cell("cell", "kitchen"), 11, None);
    let second = controller(machines.cell("other", "kitchen"), 12, None);
    let learnt = learner(machines.cell("hub", "kitchen"), 3, AT_ONCE);
    let hub = machines.hub(1, &["kitchen"], None);
    let bridge = machines.join(2, machines.cell("cell", "kitchen"), None);
    learnt.until("all rollouts are learnt", |learnt| learnt.episodes.len() == 3);
    let twin = machines.join(3, machines.cell("other", "kitchen"), None);
    twin.until("it is refused", |events| has(events, "is joined from"));
    assert!(hub.look(|events| has(events, "refused: cell 'kitchen' is joined from")));
    assert!(second.look(|second| second.rollouts.is_empty()));
    drop(bridge);
    twin.until("it takes the place", |events| {
        events.iter().any(|event| matches!(event, Event::Connected { .. }))
    });
    each_once(&first, 3);
}

#[test]
fn another_world_is_refused() {
    let machines = Machines::new();
    let executed = controller(machines.cell("cell", "kitchen"), 11, None);
    let _learnt = learner(machines.cell("hub", "kitchen"), 3, AT_ONCE);
    let hub = machines.hub(1, &["kitchen"], None);
    let cell = machines.cell("cell", "kitchen");
    let bridge = machines.join_with(2, cell, None, "skittles on nothing");
    bridge.until("it is refused", |events| has(events, "but the learner has pancake on wam"));
    assert!(hub.look(|events| has(events, "has skittles on nothing")));
    assert!(executed.look(|executed| executed.rollouts.is_empty()));
}
