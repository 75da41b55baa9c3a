//! Commands and live telemetry through a bridge: real sockets, real shared memory.
//!
//! A command is carried out once or not at all, and what nobody can know is said to be unknown. What is seen of a loop
//! is marked as through a bridge.

mod ends;

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use bridge::command::Accepts;
use bridge::event::Event;
use bridge::join::JoinConfig;
use bridge::net::{Keys, host_name};
use ends::{Executed, Machines, Running, TICK, controller, has, learner};
use shm_types::cell::Cell;
use shm_types::command::{
    ACCEPTED, COMMAND_ACTIVATE, COMMAND_HOLD, COMMAND_PIN, COMMAND_REARM, Command, REFUSED, Reply,
    UNKNOWN,
};
use shm_types::ports::{ObserverPorts, ToolPorts};
use shm_types::telemetry::Telemetry;

const AT_ONCE: Duration = Duration::ZERO;
/// Longest wait for an answer.
const SOON: Duration = Duration::from_secs(30);
const EVERYTHING: Accepts = Accepts { commands: true, rearm: true };

fn ask(cell: &Cell, kind: u64, id: u64) -> Reply {
    let tool = ToolPorts::open(cell, SOON).unwrap();
    tool.request(&Command::new(kind, id), SOON).expect("a reply")
}

/// A cell that has joined, and is known to its hub.
fn joined(machines: &Machines, config: JoinConfig) -> Running<Vec<Event>> {
    let bridge = machines.join_as(config);
    expect_connected(machines);
    bridge
}

fn expect_connected(machines: &Machines) {
    let tool = ToolPorts::open(&machines.cell("hub", "kitchen"), SOON).unwrap();
    let start = Instant::now();
    while tool.ask(SOON).is_err() {
        assert!(start.elapsed() < SOON, "the cell does not join");
    }
}

fn accepting(machines: &Machines, accepts: Accepts) -> JoinConfig {
    JoinConfig { accepts, ..machines.joins(2, machines.cell("cell", "kitchen"), None) }
}

#[test]
fn a_swap_through_the_bridge_has_its_tick_and_says_which_way_it_came() {
    let machines = Machines::new();
    let executed = controller(machines.cell("cell", "kitchen"), 11, None);
    let hub = machines.hub(1, &["kitchen"], None);
    let bridge = joined(&machines, accepting(&machines, EVERYTHING));
    let reply = ask(&machines.cell("hub", "kitchen"), COMMAND_ACTIVATE, 5);
    assert_eq!((reply.accepted, reply.applied_tick), (ACCEPTED, TICK));
    assert_eq!(reply.via(), Some(host_name()));
    assert_eq!(executed.look(|executed| executed.commands.clone()), [COMMAND_ACTIVATE]);
    for side in [&hub, &bridge] {
        side.until("both sides say so", |events| {
            has(events, "`policy activate` through the bridge: done")
        });
    }
}

#[test]
fn the_arm_accepts_a_hold_and_nothing_else_unless_its_owner_says_so() {
    let machines = Machines::new();
    let executed = controller(machines.cell("cell", "kitchen"), 11, None);
    let _hub = machines.hub(1, &["kitchen"], None);
    let bridge = joined(&machines, accepting(&machines, Accepts::default()));
    let there = machines.cell("hub", "kitchen");
    for (kind, flag) in [(COMMAND_ACTIVATE, "--accept-commands"), (COMMAND_REARM, "--accept-rearm")]
    {
        let reply = ask(&there, kind, kind);
        assert_eq!((reply.accepted, reply.via()), (REFUSED, Some(host_name())));
        assert!(reply.reason_text().contains(flag), "{}", reply.reason_text());
    }
    assert_eq!(ask(&there, COMMAND_HOLD, 7).accepted, ACCEPTED);
    assert_eq!(executed.look(|executed| executed.commands.clone()), [COMMAND_HOLD]);
    assert!(bridge.look(|events| has(events, "`policy activate` through the bridge: refused")));
}

#[test]
fn a_command_without_a_bridge_is_refused_and_not_done_later() {
    let machines = Machines::new();
    let executed = controller(machines.cell("cell", "kitchen"), 11, None);
    let hub = machines.hub(1, &["kitchen"], None);
    let bridge = joined(&machines, accepting(&machines, EVERYTHING));
    drop(bridge);
    hub.until("it is gone", |events| has(events, "its bridge on"));
    let there = machines.cell("hub", "kitchen");
    let reply = ask(&there, COMMAND_PIN, 5);
    assert_eq!(reply.accepted, REFUSED);
    assert!(reply.reason_text().contains("nothing was done"), "{}", reply.reason_text());
    let _bridge = joined(&machines, accepting(&machines, EVERYTHING));
    assert_eq!(ask(&there, COMMAND_HOLD, 6).accepted, ACCEPTED);
    assert_eq!(executed.look(|executed| executed.commands.clone()), [COMMAND_HOLD]);
}

/// A tool that asks `kind` of the controller meanwhile.
fn asking(cell: &Cell, kind: u64, id: u64) -> JoinHandle<Reply> {
    let cell = cell.clone();
    std::thread::spawn(move || ask(&cell, kind, id))
}

fn has_command(executed: &Running<Executed>) {
    executed.until("the command has come", |executed| !executed.commands.is_empty());
}

#[test]
fn a_cut_during_a_command_leaves_it_unknown_and_it_is_not_repeated() {
    let machines = Machines::new();
    let link = Link::to(&machines.address);
    let executed = controller(machines.cell("cell", "kitchen"), 11, None);
    executed.state.lock().unwrap().is_mute = true;
    let _hub = machines.hub(1, &["kitchen"], None);
    let connect = link.address.clone();
    let bridge = joined(&machines, JoinConfig { connect, ..accepting(&machines, EVERYTHING) });
    let there = machines.cell("hub", "kitchen");
    let asked = asking(&there, COMMAND_ACTIVATE, 5);
    has_command(&executed);
    link.is_cut.store(true, Ordering::Relaxed);
    executed.state.lock().unwrap().is_mute = false;
    let reply = asked.join().unwrap();
    assert_eq!((reply.accepted, reply.via()), (UNKNOWN, Some(host_name())));
    let reason = reply.reason_text();
    assert!(reason.contains("unknown whether `policy activate` was carried out"), "{reason}");
    bridge.until("it was", |events| has(events, "`policy activate` through the bridge: done"));
    link.is_cut.store(false, Ordering::Relaxed);
    assert_eq!(ask(&there, COMMAND_ACTIVATE, 5).accepted, UNKNOWN, "the same is known");
    expect_connected(&machines);
    assert_eq!(ask(&there, COMMAND_HOLD, 6).accepted, ACCEPTED, "the next one");
    let commands = executed.look(|executed| executed.commands.clone());
    assert_eq!(commands, [COMMAND_ACTIVATE, COMMAND_HOLD]);
}

#[test]
fn a_controller_that_follows_one_that_died_does_not_get_its_command() {
    let machines = Machines::new();
    let first = controller(machines.cell("cell", "kitchen"), 11, None);
    first.state.lock().unwrap().is_mute = true;
    let _hub = machines.hub(1, &["kitchen"], None);
    let _bridge = joined(&machines, accepting(&machines, EVERYTHING));
    let asked = asking(&machines.cell("hub", "kitchen"), COMMAND_PIN, 5);
    has_command(&first);
    drop(first);
    let second = controller(machines.cell("cell", "kitchen"), 12, None);
    let reply = asked.join().unwrap();
    assert_eq!(reply.accepted, UNKNOWN, "{}", reply.reason_text());
    assert!(second.look(|second| second.commands.is_empty()));
}

/// With keys, whose rules must let it through.
#[test]
fn ticks_are_seen_through_the_bridge_while_somebody_looks_and_are_marked() {
    let machines = Machines::new();
    let keys = machines.keys("keys", &["kitchen"]);
    let executed = controller(machines.cell("cell", "kitchen"), 11, None);
    executed.state.lock().unwrap().shows_ticks = true;
    let _hub = machines.hub(1, &["kitchen"], Some(Keys::at(&keys.join("learner"))));
    let cell_keys = Some(Keys::at(&keys.join("cells/kitchen")));
    let there = machines.cell("hub", "kitchen");
    let learnt = learner(there.clone(), 2, AT_ONCE);
    let bridge = joined(&machines, machines.joins(2, machines.cell("cell", "kitchen"), cell_keys));
    assert!(bridge.look(|events| !has(events, "is watched")), "nobody looks");
    let ports = ObserverPorts::open(&there, SOON).unwrap();
    let samples = look_for(&ports, 50);
    for sample in &samples {
        assert_eq!((sample.via(), sample.via_hz, sample.ticks().len()), (Some(host_name()), 50, 1));
    }
    let ticks: Vec<u64> = samples.iter().map(|sample| sample.ticks[0].record.tick).collect();
    assert!(ticks.windows(2).all(|pair| pair[0] < pair[1]), "{ticks:?}");
    assert!(ticks[49] - ticks[0] > 49 * 10, "one in 20, not every one: {ticks:?}");
    learnt.until("all rollouts are learnt", |learnt| learnt.episodes.len() == 2);
    assert!(ports.in_loop.receive().unwrap().is_some(), "the policy in the loop");
    let mut outcomes = 0;
    while let Some(header) = ports.outcomes.receive().unwrap() {
        outcomes += 1;
        assert!((1..=2).contains(&header.rollout));
    }
    assert!(outcomes <= 2, "each once: {outcomes}");
    drop(ports);
    bridge.until("and nothing is sent any more", |events| has(events, "no observer is left"));
}

fn look_for(ports: &ObserverPorts, n: usize) -> Vec<Telemetry> {
    let (start, mut samples) = (Instant::now(), Vec::new());
    while samples.len() < n {
        assert!(start.elapsed() < SOON, "{} samples", samples.len());
        match ports.telemetry.receive().unwrap() {
            Some(sample) => samples.push(*sample),
            None => std::thread::sleep(Duration::from_millis(2)),
        }
    }
    samples
}

#[test]
fn an_arm_that_shows_nothing_is_not_seen() {
    let machines = Machines::new();
    let executed = controller(machines.cell("cell", "kitchen"), 11, None);
    executed.state.lock().unwrap().shows_ticks = true;
    let _hub = machines.hub(1, &["kitchen"], None);
    let cell = machines.cell("cell", "kitchen");
    let _bridge =
        joined(&machines, JoinConfig { telemetry_hz: 0, ..machines.joins(2, cell, None) });
    let there = machines.cell("hub", "kitchen");
    let ports = ObserverPorts::open(&there, SOON).unwrap();
    let learnt = learner(there, 3, Duration::from_millis(500));
    learnt.until("all rollouts are learnt", |learnt| learnt.episodes.len() == 3);
    assert!(ports.telemetry.receive().unwrap().is_none());
}

/// It never reads, and its buffer is full all the time.
#[test]
fn an_observer_that_stands_still_keeps_no_episode_back() {
    const N: u64 = 60;
    let machines = Machines::new();
    let executed = controller(machines.cell("cell", "kitchen"), 11, None);
    executed.state.lock().unwrap().shows_ticks = true;
    let there = machines.cell("hub", "kitchen");
    let _hub = machines.hub(1, &["kitchen"], None);
    let bridge = joined(&machines, machines.joins(2, machines.cell("cell", "kitchen"), None));
    let stalled = ObserverPorts::open(&there, SOON).unwrap();
    bridge.until("it is watched", |events| has(events, "is watched"));
    let learnt = learner(there, N, Duration::from_millis(40));
    learnt.until("all rollouts are learnt", |learnt| learnt.episodes.len() == N as usize);
    let rollouts = executed.look(|executed| executed.rollouts.clone());
    assert_eq!(rollouts, (1..=N).map(|rollout| (rollout, 1)).collect());
    let newest = look_for(&stalled, 64).pop().unwrap().ticks[0].record.tick;
    assert!(newest > 64 * 20, "the oldest were dropped, the newest is tick {newest}");
}

/// A cable between hub and cell.
struct Link {
    address: String,
    is_cut: Arc<AtomicBool>,
    stop: Arc<AtomicBool>,
}

impl Link {
    fn to(hub: &str) -> Link {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let [is_cut, stop] = [(); 2].map(|()| Arc::new(AtomicBool::new(false)));
        let (hub, cut, stopped) = (hub.to_string(), is_cut.clone(), stop.clone());
        listener.set_nonblocking(true).unwrap();
        std::thread::spawn(move || {
            while !stopped.load(Ordering::Relaxed) {
                let is_cut = cut.load(Ordering::Relaxed);
                match listener.accept() {
                    Ok((near, _)) if !is_cut => {
                        near.set_nonblocking(false).unwrap();
                        let Ok(far) = TcpStream::connect(&hub) else { continue };
                        carry(near.try_clone().unwrap(), far.try_clone().unwrap(), &cut);
                        carry(far, near, &cut);
                    }
                    _ => std::thread::sleep(Duration::from_millis(5)),
                }
            }
        });
        Link { address, is_cut, stop }
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// Carries bytes one way, until either end closes. What comes while the link is cut is lost.
fn carry(mut from: TcpStream, mut to: TcpStream, is_cut: &Arc<AtomicBool>) {
    let is_cut = is_cut.clone();
    std::thread::spawn(move || {
        let mut bytes = [0; 65_536];
        while let Ok(n @ 1..) = from.read(&mut bytes) {
            if is_cut.load(Ordering::Relaxed) || to.write_all(&bytes[..n]).is_err() {
                break;
            }
        }
        // The other end does not hear of it while the link is cut.
        while is_cut.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_millis(5));
        }
        let _ = to.shutdown(std::net::Shutdown::Both);
        let _ = from.shutdown(std::net::Shutdown::Both);
    });
}
