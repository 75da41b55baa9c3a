//! The live view: as JSON, and as a 3-D viewer connects to it.

mod util;

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket, stream::MaybeTlsStream};
use util::{Bench, Running, eventually};

/// A controller and a learner at the pace of the simulation: a hundred times what a viewer can take.
fn cell(bench: &Bench) -> [Running; 2] {
    let controller = bench.start(&["controller", "--cell", "c1", "--pace", "max"]);
    let config = bench.write("c.toml", "[learner]\nrollouts = 400\n");
    let learner = ["learner", "--cell", "c1", "--session", "s", "--config"];
    let learner = bench.start(&[&learner[..], &[config.to_str().unwrap()]].concat());
    bench.wait_for_trials("s", 12);
    [controller, learner]
}

#[test]
fn a_watcher_that_comes_late_sees_the_whole_curve() {
    let bench = Bench::new();
    let _services = cell(&bench);
    let said = bench.ok(&["watch", "--cell", "c1", "--json", "--duration-s", "2.5"]);
    let lines: Vec<Value> = said.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(lines.len() >= 3, "{said}");
    let last = &lines[lines.len() - 1];
    let trials = bench.trials("s");
    let shown = last["trials"].as_u64().unwrap() as usize;
    assert!(shown >= 12 && shown <= trials.len(), "{shown} of {}", trials.len());
    let best = trials[..shown].iter().map(|trial| trial.reward).fold(0.0, f64::max);
    assert_eq!(last["best_reward"], best, "those before it came, too");
    assert_eq!((&last["rollouts"], &last["controller"]), (&json!(400), &json!("running")));
    assert!(last["ticks_seen"].as_u64().unwrap() > 1000);
    assert!(last["modes"].as_u64().unwrap() >= 1);
    let policy = last["policy_digest"].as_str().unwrap();
    assert!(policy.len() == 16 && policy != "0000000000000000");
}

#[test]
fn what_is_no_terminal_and_no_loopback_is_refused() {
    let bench = Bench::new();
    let _services = cell(&bench);
    bench.refused(&["watch", "--cell", "c1"], &["not a terminal", "--json"]);
    let public = ["watch", "--cell", "c1", "--serve", "0.0.0.0:8765"];
    bench.refused(&public, &["0.0.0.0:8765", "loopback", "tunnel"]);
}

/// Topics by number, once the server has told them.
fn advertised(
    socket: &mut WebSocket<MaybeTlsStream<std::net::TcpStream>>,
) -> BTreeMap<String, u64> {
    let mut topics = BTreeMap::new();
    while !topics.contains_key("/tf") {
        let Message::Text(text) = socket.read().unwrap() else { continue };
        let message: Value = serde_json::from_str(&text).unwrap();
        for channel in message["channels"].as_array().into_iter().flatten() {
            let topic = channel["topic"].as_str().unwrap().to_string();
            topics.insert(topic, channel["id"].as_u64().unwrap());
        }
    }
    topics
}

#[test]
fn viewers_get_at_most_fifty_pictures_a_second() {
    let bench = Bench::new();
    let _services = cell(&bench);
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let address = format!("127.0.0.1:{port}");
    let _server = bench.start(&["watch", "--cell", "c1", "--serve", &address]);
    let request = || {
        let mut request = format!("ws://{address}").into_client_request().unwrap();
        let protocol = "foxglove.sdk.v1".parse().unwrap();
        request.headers_mut().insert("Sec-WebSocket-Protocol", protocol);
        request
    };
    let (mut socket, _) = eventually("a server", || tungstenite::connect(request()).ok());
    let topics = advertised(&mut socket);
    let subscribed = ["/tf", "/tick", "/bodies", "/springs", "/joint_states"];
    let subscriptions: Vec<Value> = subscribed
        .iter()
        .enumerate()
        .map(|(i, topic)| json!({ "id": i, "channelId": topics[*topic] }))
        .collect();
    let subscribe = json!({ "op": "subscribe", "subscriptions": subscriptions });
    socket.send(Message::text(subscribe.to_string())).unwrap();

    let (start, mut counts) = (Instant::now(), [0_u32; 5]);
    while start.elapsed() < Duration::from_secs(3) {
        if let Message::Binary(data) = socket.read().unwrap()
            && data[0] == 1
        {
            // Message data: one byte, subscription, time, payload. Channels are numbered as they come.
            let id = u32::from_le_bytes(data[1..5].try_into().unwrap());
            let by_subscription = counts.get_mut(id as usize);
            *by_subscription.expect("a subscription of ours") += 1;
        }
    }
    let [frames, ticks, bodies, springs, joints] = counts;
    assert!((30..=160).contains(&frames), "{frames} in 3 s");
    // The last picture may be cut in two.
    for others in [ticks, springs, joints] {
        assert!(frames.abs_diff(others) <= 1, "{counts:?}");
    }
    assert!(bodies >= 1, "also for those who come late");
}
