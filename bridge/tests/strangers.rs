//! Who is let in over mutual TLS, and who is not: told to both sides, with nothing moved.

mod ends;

use std::path::Path;
use std::time::Duration;

use bridge::event::Event;
use bridge::live::Live;
use bridge::net::Keys;
use bridge::turn::{MessageError, NAME_LEN, Seen, Turn, TurnHead, VERSION, WORLD_LEN, refusal};
use ends::{
    Executed, Learnt, Machines, Running, beat, controller, has, header_of, learner, policy,
};
use serde_json::json;
use shm_types::command::Status;
use shm_types::episode::TickRecord;
use shm_types::ports::ObserverPorts;
use shm_types::telemetry::TelemetryTick;
use shm_types::text;
use zenoh::{Session, Wait};

fn keys_of(folder: &Path, cell: &str) -> Option<Keys> {
    Some(Keys::at(&folder.join("cells").join(cell)))
}

fn learner_keys(folder: &Path) -> Option<Keys> {
    Some(Keys::at(&folder.join("learner")))
}

/// A learner with a hub that lets the cell kitchen in, and a controller that would like to learn.
struct Kitchen {
    machines: Machines,
    learnt: Running<Learnt>,
    executed: Running<Executed>,
    hub: Running<Vec<Event>>,
    keys: std::path::PathBuf,
}

impl Kitchen {
    fn new() -> Kitchen {
        let machines = Machines::new();
        let keys = machines.keys("keys", &["kitchen", "lab"]);
        let executed = controller(machines.cell("cell", "kitchen"), 11, None);
        let learnt = learner(machines.cell("hub", "kitchen"), 3, Duration::ZERO);
        let hub = machines.hub(1, &["kitchen"], learner_keys(&keys));
        Kitchen { machines, learnt, executed, hub, keys }
    }

    /// A client with the certificate of `cell`.
    fn session_of(&self, cell: &str) -> Session {
        let file = |name: &str| self.keys.join("cells").join(cell).join(name).display().to_string();
        let tls = [
            ("root_ca_certificate", file("ca.pem")),
            ("connect_certificate", file("cert.pem")),
            ("connect_private_key", file("key.pem")),
            ("enable_mtls", "true".to_string()),
        ];
        stranger(&self.machines.address, &tls).expect("its certificate is good")
    }

    fn nothing_moved(&self) {
        assert!(self.learnt.look(|learnt| learnt.episodes.is_empty()));
        assert!(self.executed.look(|executed| executed.rollouts.is_empty()));
        assert!(!self.hub.look(|events| has(events, "joined from")));
    }
}

/// A client that says what it likes. `None` when it is not let in at all.
fn stranger(address: &str, tls: &[(&str, String)]) -> Option<Session> {
    let mut config = zenoh::Config::default();
    let protocol = if tls.is_empty() { "tcp" } else { "tls" };
    for (setting, value) in [
        ("mode", json!("client")),
        ("scouting/multicast/enabled", json!(false)),
        ("connect/endpoints", json!([format!("{protocol}/{address}")])),
        ("connect/timeout_ms", json!(0)),
        ("connect/exit_on_failure", json!(true)),
    ] {
        config.insert_json5(setting, &value.to_string()).unwrap();
    }
    for (setting, value) in tls {
        let setting = format!("transport/link/tls/{setting}");
        let value = if value == "true" { json!(true) } else { json!(value) };
        config.insert_json5(&setting, &value.to_string()).unwrap();
    }
    zenoh::open(config).wait().ok()
}

fn head(cell: &str) -> TurnHead {
    TurnHead {
        bridge: 99,
        host: text::pack::<NAME_LEN>("nowhere"),
        cell: text::pack::<NAME_LEN>(cell),
        certificate: text::pack::<NAME_LEN>(""),
        world: text::pack::<WORLD_LEN>(""),
        controller: beat(66, 1),
        status: Status::ZERO,
        seen: Seen::default(),
        commands: 0,
        has_episode: 0,
        has_reply: 0,
    }
}

/// Whatever comes back: answers, and refusals as text.
fn ask(session: &Session, key: &str, bytes: Vec<u8>) -> Vec<Result<Vec<u8>, String>> {
    let replies = session.get(key).payload(bytes).timeout(Duration::from_secs(12)).wait().unwrap();
    let read = |reply: zenoh::query::Reply| match reply.into_result() {
        Ok(sample) => Ok(sample.payload().to_bytes().into_owned()),
        Err(error) => Err(String::from_utf8(error.payload().to_bytes().into_owned()).unwrap()),
    };
    replies.into_iter().map(read).collect()
}

#[test]
fn a_cell_with_its_own_keys_learns() {
    let kitchen = Kitchen::new();
    let cell = kitchen.machines.cell("cell", "kitchen");
    let _join = kitchen.machines.join(2, cell, keys_of(&kitchen.keys, "kitchen"));
    kitchen.learnt.until("all rollouts are learnt", |learnt| learnt.episodes.len() == 3);
}

#[test]
fn a_stranger_without_a_certificate_or_with_another_authoritys_moves_nothing() {
    let kitchen = Kitchen::new();
    let address = &kitchen.machines.address;
    let authority = ("root_ca_certificate", kitchen.keys.join("ca.pem").display().to_string());
    for tls in [&[][..], &[authority]] {
        // Its handshake may end before it is refused; then its words reach nobody, not even at the door that is open
        // to every certificate of the authority.
        if let Some(session) = stranger(address, tls) {
            let whole = head("kitchen").encode(None);
            assert_eq!(ask(&session, "skillet/kitchen/turn", whole.clone()), []);
            assert_eq!(ask(&session, "skillet-door", whole), []);
        }
    }
    let others = kitchen.machines.keys("others", &["kitchen"]);
    let cell = kitchen.machines.cell("cell", "kitchen");
    let join = kitchen.machines.join(2, cell, keys_of(&others, "kitchen"));
    join.until("it is said", |events| has(events, "no answer"));
    kitchen.nothing_moved();
}

#[test]
fn a_cell_with_the_keys_of_another_is_refused_and_told() {
    let kitchen = Kitchen::new();
    let cell = kitchen.machines.cell("cell", "kitchen");
    let join = kitchen.machines.join(2, cell, keys_of(&kitchen.keys, "lab"));
    join.until("it is told", |events| has(events, "it uses the keys of cell 'lab'"));
    assert!(kitchen.hub.look(|events| has(events, "it uses the keys of cell 'lab'")));
    kitchen.nothing_moved();
}

#[test]
fn a_certificate_of_another_cell_is_not_heard_under_this_name() {
    let kitchen = Kitchen::new();
    let header = header_of(&policy(1), 66);
    let records = vec![TickRecord::ZERO; header.n_records as usize];
    let bytes = head("kitchen").encode(Some((&header, &records)));
    assert_eq!(ask(&kitchen.session_of("lab"), "skillet/kitchen/turn", bytes), []);
    kitchen.nothing_moved();
    let answers =
        ask(&kitchen.session_of("kitchen"), "skillet/kitchen/turn", head("kitchen").encode(None));
    assert!(matches!(&answers[..], [Ok(_)]), "its own is heard: {answers:?}");
}

/// Neither by the certificate of another cell nor by another bridge than the one that has joined.
#[test]
fn what_somebody_else_shows_of_a_loop_is_not_seen() {
    const BRIDGE: u64 = 2;
    let kitchen = Kitchen::new();
    let cell = kitchen.machines.cell("cell", "kitchen");
    let _join = kitchen.machines.join(BRIDGE, cell, keys_of(&kitchen.keys, "kitchen"));
    kitchen.learnt.until("it learns", |learnt| !learnt.episodes.is_empty());
    let soon = Duration::from_secs(30);
    let there = kitchen.machines.cell("hub", "kitchen");
    let ports = ObserverPorts::open(&there, soon).unwrap();
    let (other, own) = (kitchen.session_of("lab"), kitchen.session_of("kitchen"));
    let show = |session: &Session, bytes: &[u8]| {
        session.put("skillet/kitchen/live", bytes.to_vec()).wait().unwrap();
    };
    let tick = |bridge, number| {
        let record = TickRecord { tick: number, ..TickRecord::ZERO };
        let tick = TelemetryTick { record, ..TelemetryTick::ZERO };
        Live::Tick(Box::new(tick)).encode(bridge, 50)
    };
    kitchen.hub.until("rubbish is refused", |events| {
        show(&other, &tick(BRIDGE, 1));
        show(&own, &tick(99, 2));
        show(&own, b"rubbish");
        has(events, "live telemetry: not a bridge message")
    });
    let start = std::time::Instant::now();
    let seen = loop {
        assert!(start.elapsed() < soon, "its own is not seen");
        show(&own, &tick(BRIDGE, 3));
        match ports.telemetry.receive().unwrap() {
            Some(sample) => break sample.ticks()[0].record.tick,
            None => std::thread::sleep(Duration::from_millis(5)),
        }
    };
    assert_eq!(seen, 3);
}

#[test]
fn a_cell_that_is_not_in_the_list_is_refused_and_told() {
    let kitchen = Kitchen::new();
    let cell = kitchen.machines.cell("cell", "lab");
    let join = kitchen.machines.join(2, cell, keys_of(&kitchen.keys, "lab"));
    join.until("it is told", |events| has(events, "not in the allow-list (kitchen)"));
    assert!(kitchen.hub.look(|events| has(events, "not in the allow-list (kitchen)")));
    kitchen.nothing_moved();
}

#[test]
fn another_version_is_refused_before_anything_is_read() {
    let machines = Machines::new();
    let learnt = learner(machines.cell("hub", "kitchen"), 3, Duration::ZERO);
    let hub = machines.hub(1, &["kitchen"], None);
    let session = stranger(&machines.address, &[]).unwrap();
    let mut bytes = head("kitchen").encode(None);
    bytes[8..16].copy_from_slice(&(VERSION + 1).to_le_bytes());
    bytes.truncate(24);
    let said = MessageError::Version { found: VERSION + 1 }.to_string();
    assert_eq!(ask(&session, "skillet/kitchen/turn", bytes), [Err(refusal(&said))]);
    assert!(hub.look(|events| has(events, &said)));
    assert!(learnt.look(|learnt| learnt.controllers == 0));
}

/// What a hub must survive: bytes of anybody.
#[test]
fn rubbish_is_refused() {
    let machines = Machines::new();
    let _learnt = learner(machines.cell("hub", "kitchen"), 3, Duration::ZERO);
    let _hub = machines.hub(1, &["kitchen"], None);
    let session = stranger(&machines.address, &[]).unwrap();
    let whole = head("kitchen").encode(None);
    assert!(Turn::decode(&whole).is_ok());
    for bytes in [vec![], vec![7; 10_000], whole[..whole.len() - 1].to_vec(), vec![0; 100]] {
        let answers = ask(&session, "skillet/kitchen/turn", bytes);
        assert!(matches!(&answers[..], [Err(_)]), "{answers:?}");
    }
}

/// An answer may be lost: what was handed in stays handed in.
#[test]
fn a_turn_that_comes_again_is_answered_again_and_learnt_once() {
    let machines = Machines::new();
    let learnt = learner(machines.cell("hub", "kitchen"), 1, Duration::from_millis(300));
    let _hub = machines.hub(1, &["kitchen"], None);
    let session = stranger(&machines.address, &[]).unwrap();
    let header = header_of(&policy(1), 66);
    let record = |k: usize| TickRecord { t_s: k as f64 + 1.0, ..TickRecord::ZERO };
    let records: Vec<TickRecord> = (0..header.n_records as usize).map(record).collect();
    let ask_with = |seen| {
        let head = TurnHead { seen, ..head("kitchen") };
        let bytes = head.encode(Some((&header, &records)));
        let answers = ask(&session, "skillet/kitchen/turn", bytes);
        bridge::answer::Answer::decode(answers[0].as_ref().unwrap()).unwrap()
    };
    let mut seen = Seen::default();
    for _ in 0..20 {
        let answer = ask_with(seen);
        seen = answer.head.seen;
        if answer.head.verdict == bridge::answer::VERDICT_DURABLE {
            break;
        }
    }
    for _ in 0..3 {
        assert_eq!(ask_with(seen).head.verdict, bridge::answer::VERDICT_DURABLE);
    }
    learnt.until("it is learnt", |learnt| !learnt.episodes.is_empty());
    assert_eq!(learnt.look(|learnt| learnt.episodes.len()), 1);
}
