//! The layouts for Foxglove and PlotJuggler: every topic, field and index in them is in a recording.

mod util;

use std::collections::BTreeMap;
use std::path::Path;

use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FileDescriptorSet};
use serde_json::Value;
use util::Bench;

/// Written only when there is something to say.
const RARE: &str = "/log";

/// The message of a topic, and the longest of each repeated field of scalars.
struct Topic {
    message: DescriptorProto,
    lengths: BTreeMap<String, usize>,
}

fn layout(name: &str) -> String {
    util::text(&Path::new(env!("CARGO_MANIFEST_DIR")).join("dist/layouts").join(name))
}

fn varint(bytes: &mut &[u8]) -> u64 {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let byte = bytes[0];
        *bytes = &bytes[1..];
        value |= u64::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            break;
        }
    }
    value
}

/// Number and content of each field that is a string of bytes, packed numbers among them.
fn of_bytes(mut bytes: &[u8]) -> Vec<(i32, usize)> {
    let mut found = Vec::new();
    while !bytes.is_empty() {
        let key = varint(&mut bytes);
        let length = match key & 7 {
            0 => {
                varint(&mut bytes);
                0
            }
            1 => 8,
            2 => varint(&mut bytes) as usize,
            _ => 4,
        };
        if key & 7 == 2 {
            found.push(((key >> 3) as i32, length));
        }
        bytes = &bytes[length..];
    }
    found
}

fn add(topics: &mut BTreeMap<String, Topic>, recording: &Path) {
    let bytes = std::fs::read(recording).unwrap();
    for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
        let schema = message.channel.schema.as_ref().unwrap();
        let topic = topics.entry(message.channel.topic.clone()).or_insert_with(|| {
            let set = FileDescriptorSet::decode(&*schema.data).unwrap();
            let name = schema.name.rsplit('.').next().unwrap();
            let mut messages = set.file.into_iter().flat_map(|file| file.message_type);
            let message = messages.find(|message| message.name() == name).unwrap();
            Topic { message, lengths: BTreeMap::new() }
        });
        for (number, length) in of_bytes(&message.data) {
            let field = topic.message.field.iter().find(|field| field.number() == number).unwrap();
            let width = match field.r#type() {
                Type::Float => 4,
                Type::Double => 8,
                _ => continue,
            };
            let longest = topic.lengths.entry(field.name().into()).or_default();
            *longest = (*longest).max(length / width);
        }
    }
}

/// A session and a live recording of its cell.
fn topics(bench: &Bench) -> BTreeMap<String, Topic> {
    bench.ok(&["learn", "pancake", "--rollouts", "12", "--record", "--out", "s"]);
    let _controller = bench.start(&["controller", "--cell", "c1", "--pace", "max"]);
    bench.ok(&["policy", "import", "s", "--cell", "c1"]);
    bench.ok(&["policy", "activate", "1", "--cell", "c1"]);
    bench.ok(&["record", "--cell", "c1", "--duration-s", "2"]);
    let mut topics = BTreeMap::new();
    for recording in ["s/recording.mcap", "c1.mcap"] {
        add(&mut topics, &bench.path(recording));
    }
    topics
}

/// Looks up the topic and the field of a path whose parts are divided by `divider`.
fn check(topics: &BTreeMap<String, Topic>, path: &str, divider: char) {
    let (topic, field) = path[1..].split_once(divider).unwrap_or_else(|| panic!("{path}"));
    let known = topics.get(&format!("/{topic}")).unwrap_or_else(|| panic!("{path}: no such topic"));
    let (name, index) = match field.strip_suffix(']').and_then(|field| field.split_once('[')) {
        Some((name, index)) => (name, Some(index.parse::<usize>().unwrap())),
        None => (field, None),
    };
    let found = known.message.field.iter().find(|field| field.name() == name);
    let found = found.unwrap_or_else(|| panic!("{path}: no such field"));
    assert_eq!(found.label() == Label::Repeated, index.is_some(), "{path}: an index");
    if let Some(index) = index {
        let length = known.lengths.get(name).copied().unwrap_or(0);
        assert!(index < length, "{path}: it has {length} elements");
    }
}

/// All texts below the keys of this name.
fn values<'a>(value: &'a Value, key: &str, found: &mut Vec<&'a str>) {
    match value {
        Value::Object(map) => {
            for (name, value) in map {
                found.extend(value.as_str().filter(|_| name == key));
                values(value, key, found);
            }
        }
        Value::Array(list) => list.iter().for_each(|value| values(value, key, found)),
        _ => {}
    }
}

#[test]
fn what_the_layouts_show_is_in_a_recording() {
    let bench = Bench::new();
    let topics = topics(&bench);
    let foxglove: Value = serde_json::from_str(&layout("foxglove.json")).unwrap();
    let mut paths = Vec::new();
    values(&foxglove, "value", &mut paths);
    assert!(paths.len() > 15, "{paths:?}");
    paths.iter().for_each(|path| check(&topics, path, '.'));
    for topic in foxglove["configById"]["3D!skillet"]["topics"].as_object().unwrap().keys() {
        assert!(topics.contains_key(topic), "{topic}");
    }
    let mut logs = Vec::new();
    values(&foxglove, "topicToRender", &mut logs);
    assert_eq!(logs, [RARE]);

    let plotjuggler = layout("plotjuggler.xml");
    let document = roxmltree::Document::parse(&plotjuggler).unwrap();
    let curves = document.descendants().filter(|node| node.has_tag_name("curve"));
    let names: Vec<&str> = curves.map(|node| node.attribute("name").unwrap()).collect();
    assert!(names.len() > 15, "{names:?}");
    names.iter().for_each(|path| check(&topics, path, '/'));
}

/// Every panel has a place, and every place a panel.
#[test]
fn the_panels_of_foxglove_are_those_that_are_laid_out() {
    let foxglove: Value = serde_json::from_str(&layout("foxglove.json")).unwrap();
    let mut placed = Vec::new();
    values(&foxglove["layout"], "first", &mut placed);
    values(&foxglove["layout"], "second", &mut placed);
    placed.sort_unstable();
    let mut panels: Vec<&String> = foxglove["configById"].as_object().unwrap().keys().collect();
    panels.sort_unstable();
    assert_eq!(placed, panels);
}

#[test]
#[should_panic(expected = "no such field")]
fn a_field_that_was_renamed_is_found() {
    let message = DescriptorProto::default();
    let topic = Topic { message, lengths: BTreeMap::new() };
    check(&BTreeMap::from([("/tick".to_string(), topic)]), "/tick.q_rad[0]", '.');
}
