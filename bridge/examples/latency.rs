//! How long a turn with an episode of 240 kB takes on loopback, beside a bare Zenoh query with as many bytes in the same
//! run: `cargo run -p bridge --features network --example latency`.
//!
//! The turn is from query to answer, with the hub's checks, the copy into shared memory, a learner that acknowledges
//! at once, and the way back. The commit of a real learner comes on top of it.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use bridge::answer::{Answer, VERDICT_DURABLE};
use bridge::hub::{self, HubConfig};
use bridge::keys::{KeysConfig, make};
use bridge::net::Keys;
use bridge::turn::{NAME_LEN, Seen, TurnHead, WORLD_LEN};
use serde_json::json;
use shm_types::SCHEMA;
use shm_types::cell::{Cell, Role};
use shm_types::command::Status;
use shm_types::episode::{Ack, EpisodeHeader, TickRecord};
use shm_types::policy::PolicyMsg;
use shm_types::ports::{LearnerPorts, wait_for_episode};
use shm_types::telemetry::Heartbeat;
use shm_types::text;
use zenoh::{Session, Wait};

type Failure = Box<dyn std::error::Error + Send + Sync>;

const TURNS: u64 = 500;
/// 240 kB of records.
const N_RECORDS: usize = 600;
const SESSION: u64 = 7;

fn main() -> Result<(), Failure> {
    let dir = std::env::temp_dir().join(format!("skb-{}", std::process::id()));
    make(&KeysConfig {
        out: &dir.join("keys"),
        learner: &["127.0.0.1".to_string()],
        cells: &["kitchen".to_string()],
        days: 1,
    })?;
    for (name, port, keys) in
        [("TCP", 17_551, None), ("mutual TLS", 17_561, Some(dir.join("keys")))]
    {
        let bare = bare(port, keys.as_deref())?;
        let turn = turns(&dir.join("r"), port + 1, keys.as_deref())?;
        println!("{name}: bare query {}", percentiles(bare));
        println!("{name}: turn       {}", percentiles(turn));
    }
    std::fs::remove_dir_all(dir)?;
    Ok(())
}

fn percentiles(mut times: Vec<Duration>) -> String {
    times.sort();
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize].as_secs_f64() * 1e3;
    format!("p50 {:.2} ms, p90 {:.2} ms, p99 {:.2} ms", at(0.5), at(0.9), at(0.99))
}

fn session(mode: &str, port: u16, keys: Option<&Path>) -> Result<Session, Failure> {
    let endpoint =
        json!([format!("{}/127.0.0.1:{port}", if keys.is_some() { "tls" } else { "tcp" })]);
    let (role, folder) = match mode {
        "client" => ("connect", "cells/kitchen"),
        _ => ("listen", "learner"),
    };
    let mut config = zenoh::Config::default();
    config.insert_json5("mode", &json!(mode).to_string())?;
    config.insert_json5("scouting/multicast/enabled", "false")?;
    config.insert_json5(&format!("{role}/endpoints"), &endpoint.to_string())?;
    if let Some(keys) = keys {
        let file = |name: &str| json!(keys.join(folder).join(name).to_string_lossy()).to_string();
        config.insert_json5("transport/link/tls/root_ca_certificate", &file("ca.pem"))?;
        config.insert_json5("transport/link/tls/enable_mtls", "true")?;
        config
            .insert_json5(&format!("transport/link/tls/{role}_certificate"), &file("cert.pem"))?;
        config.insert_json5(&format!("transport/link/tls/{role}_private_key"), &file("key.pem"))?;
    }
    zenoh::open(config).wait()
}

/// A queryable that answers at once.
fn bare(port: u16, keys: Option<&Path>) -> Result<Vec<Duration>, Failure> {
    let server = session("peer", port, keys)?;
    let reply = |query: zenoh::query::Query| {
        let _ = query.reply(query.key_expr().clone(), [0_u8; 64].to_vec()).wait();
    };
    let _queryable = server.declare_queryable("bare").callback(reply).wait()?;
    let client = session("client", port, keys)?;
    let payload = vec![7_u8; N_RECORDS * size_of::<TickRecord>()];
    let ask = |_| {
        let start = Instant::now();
        let replies = client.get("bare").payload(payload.clone()).wait()?;
        replies.recv()?.result().map_err(|error| format!("{error:?}"))?;
        Ok(start.elapsed())
    };
    std::thread::sleep(Duration::from_millis(500));
    (0..TURNS).map(ask).collect()
}

/// A hub, and a learner that acknowledges at once.
fn turns(dir: &Path, port: u16, keys: Option<&Path>) -> Result<Vec<Duration>, Failure> {
    let cell = Cell::in_dir(dir, "kitchen")?;
    let config = HubConfig {
        listen: format!("127.0.0.1:{port}"),
        keys: keys.map(|keys| Keys::at(&keys.join("learner"))),
        cells: vec![cell.clone()],
        world: String::new(),
        id: 1,
    };
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let hub = scope.spawn(|| hub::run(&config, &stop, &|_event| {}));
        let learner = scope.spawn(|| learner(&cell, &stop));
        std::thread::sleep(Duration::from_millis(500));
        let times = session("client", port, keys).and_then(|client| measure(&client));
        stop.store(true, Ordering::Relaxed);
        hub.join().map_err(|_| "the hub has panicked")??;
        learner.join().map_err(|_| "the learner has panicked")??;
        times
    })
}

fn measure(client: &Session) -> Result<Vec<Duration>, Failure> {
    let mut seen = Seen::default();
    let mut times = Vec::new();
    while (times.len() as u64) < TURNS {
        let rollout = times.len() as u64 + 1;
        let header = EpisodeHeader {
            session: SESSION,
            rollout,
            n_records: N_RECORDS as u64,
            ..EpisodeHeader::default()
        };
        let bytes = head(seen).encode(Some((&header, &vec![TickRecord::ZERO; N_RECORDS])));
        let start = Instant::now();
        let replies = client.get("skillet/kitchen/turn").payload(bytes).wait()?;
        let Ok(reply) = replies.recv() else { continue };
        let elapsed = start.elapsed();
        let sample = reply.into_result().map_err(|error| format!("{error:?}"))?;
        let answer = Answer::decode(&sample.payload().to_bytes())?;
        seen = answer.head.seen;
        if answer.head.verdict == VERDICT_DURABLE {
            times.push(elapsed);
        }
    }
    Ok(times)
}

fn head(seen: Seen) -> TurnHead {
    let controller = Heartbeat { schema: SCHEMA, boot_id: 3, counter: 1, ..Heartbeat::NONE };
    TurnHead {
        bridge: 2,
        host: text::pack::<NAME_LEN>("here"),
        cell: text::pack::<NAME_LEN>("kitchen"),
        certificate: text::pack::<NAME_LEN>(""),
        world: text::pack::<WORLD_LEN>(""),
        controller,
        status: Status::ZERO,
        seen,
        commands: 0,
        has_episode: 0,
        has_reply: 0,
    }
}

fn learner(cell: &Cell, stop: &AtomicBool) -> Result<(), Failure> {
    let _lock = cell.lock(Role::Learner)?;
    let is_over = || stop.load(Ordering::Relaxed);
    let ports = LearnerPorts::open(cell, Duration::from_secs(30), &is_over)?;
    let ask = PolicyMsg { session: SESSION, rollout: 1, ..PolicyMsg::of_action(&[0.5]) }.sealed();
    ports.policies.send_copy(ask)?;
    while !is_over() {
        wait_for_episode(&[&ports], Duration::from_millis(50));
        while let Some(episode) = ports.episodes.receive()? {
            let durable_rollout = episode.user_header().rollout;
            let ack = Ack {
                schema: SCHEMA,
                session: SESSION,
                durable_rollout,
                rollout: durable_rollout,
                success: 1,
            };
            ports.acks.send_copy(ack)?;
        }
    }
    Ok(())
}
