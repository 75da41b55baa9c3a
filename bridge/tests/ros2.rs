//! A node of a ROS 2 graph as a bare Zenoh client sees it: tokens, messages with what comes beside them, latched
//! messages. That other implementations of rmw_zenoh's layout understand it: tests/ros2_live.rs of the tool.

use std::net::TcpListener;
use std::time::{Duration, Instant};

use bridge::ros2::layout::{NodeName, Topic, gid};
use bridge::ros2::node::{Graph, Node};
use serde_json::json;
use zenoh::query::ReplyKeyExpr;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

const WATCHDOG: Duration = Duration::from_secs(30);
const HASH: &str = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18";

fn node() -> (Node, String) {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let address = format!("127.0.0.1:{port}");
    let name = NodeName { domain: 3, namespace: String::new(), name: "talker".into() };
    (Node::open(&Graph::Here(address.clone()), name).unwrap(), address)
}

fn client(address: &str) -> Session {
    let mut config = zenoh::Config::default();
    for (setting, value) in [
        ("mode", json!("client")),
        ("scouting/multicast/enabled", json!(false)),
        ("connect/endpoints", json!([format!("tcp/{address}")])),
    ] {
        config.insert_json5(setting, &value.to_string()).unwrap();
    }
    zenoh::open(config).wait().unwrap()
}

fn chatter(is_latched: bool) -> Topic<'static> {
    let (name, type_name) = ("/chatter", "std_msgs/msg/String");
    Topic { name, type_name, type_hash: HASH, is_latched }
}

fn attachment(sample: &Sample) -> Vec<u8> {
    sample.attachment().unwrap().to_bytes().to_vec()
}

#[test]
fn a_node_is_seen_and_heard_until_it_leaves() {
    let (mut node, address) = node();
    let mut publisher = node.publisher(&chatter(false)).unwrap();
    let client = client(&address);
    let tokens =
        client.liveliness().declare_subscriber("@ros2_lv/3/**").history(true).wait().unwrap();
    let token = || tokens.recv_timeout(WATCHDOG).unwrap().unwrap();
    let mut seen = [token(), token()].map(|sample| sample.key_expr().to_string());
    seen.sort_by_key(|token| token.contains("/MP/"));
    assert!(seen[0].ends_with("/0/0/NN/%/%/talker"), "{seen:?}");
    assert!(
        seen[1].contains("/0/1/MP/%/%/talker/%chatter/std_msgs::msg::dds_::String_/"),
        "{seen:?}"
    );

    let key = format!("3/chatter/std_msgs::msg::dds_::String_/{HASH}");
    let messages = client.declare_subscriber(&key).wait().unwrap();
    // Until the subscription has come over, messages are dropped.
    let start = Instant::now();
    let first = loop {
        publisher.put(b"hello").unwrap();
        if let Ok(Some(sample)) = messages.recv_timeout(Duration::from_millis(50)) {
            break sample;
        }
        assert!(start.elapsed() < WATCHDOG);
    };
    assert_eq!(&*first.payload().to_bytes(), b"hello");
    publisher.put(b"again").unwrap();
    let second = messages.recv_timeout(WATCHDOG).unwrap().unwrap();
    let [first, second] = [&first, &second].map(attachment);
    let number = |bytes: &[u8]| i64::from_le_bytes(bytes[..8].try_into().unwrap());
    assert_eq!(number(&second), number(&first) + 1);
    assert_eq!(second[17..], gid(&seen[1]));

    drop((publisher, node));
    let left = [token(), token()].map(|sample| sample.kind());
    assert_eq!(left, [SampleKind::Delete, SampleKind::Delete]);
}

#[test]
fn the_newest_message_of_a_latched_topic_waits_for_those_who_come_late() {
    let (mut node, address) = node();
    let mut publisher = node.publisher(&chatter(true)).unwrap();
    publisher.put(b"old").unwrap();
    publisher.put(b"new").unwrap();
    let client = client(&address);
    let key = format!("3/chatter/std_msgs::msg::dds_::String_/{HASH}");
    // As zenoh-ext's advanced subscriber asks.
    let replies = client.get(format!("{key}/@adv/**?_max=1")).accept_replies(ReplyKeyExpr::Any);
    let samples: Vec<Sample> =
        replies.wait().unwrap().into_iter().map(|reply| reply.into_result().unwrap()).collect();
    assert_eq!(samples.len(), 1);
    assert_eq!(samples[0].key_expr().as_str(), key);
    assert_eq!(&*samples[0].payload().to_bytes(), b"new");
    assert_eq!(attachment(&samples[0])[..8], 2i64.to_le_bytes());
    assert!(samples[0].timestamp().is_some());
    let detected = client.liveliness().get(format!("{key}/@adv/pub/**")).wait().unwrap();
    assert_eq!(detected.into_iter().count(), 1);
}
