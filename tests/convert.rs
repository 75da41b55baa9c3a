//! ROS 2 bags as the tool writes them: all of it CDR, whole or not there, nothing replaced unasked. That others
//! read them is shown in tests/python.rs.

mod util;

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::Path;

use serde_json::Value;
use util::Bench;

fn file(bag: &Path) -> Vec<u8> {
    let name = bag.file_name().unwrap().to_str().unwrap();
    fs::read(bag.join(format!("{name}_0.mcap"))).unwrap()
}

/// The first message of a topic.
fn first(bag: &Path, topic: &str) -> Vec<u8> {
    let bytes = file(bag);
    let mut messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    messages.find(|message| message.channel.topic == topic).unwrap().data.into_owned()
}

/// Messages by topic; every channel is CDR with a ROS definition.
fn counts(bag: &Path) -> BTreeMap<String, u64> {
    let bytes = file(bag);
    let mut counts = BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let channel = message.unwrap().channel;
        assert_eq!(channel.message_encoding, "cdr", "rosbag2 refuses a file with anything else");
        assert_eq!(channel.schema.as_ref().unwrap().encoding, "ros2msg");
        *counts.entry(channel.topic.clone()).or_insert(0) += 1;
    }
    counts
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

#[test]
fn sessions_and_recordings_become_bags() {
    let bench = Bench::new();
    bench.ok(&["learn", "pancake", "--rollouts", "2", "--out", "s", "--record"]);
    let trials = bench.trials("s");
    let said = json(&bench.ok(&["convert", "s", "--ros2", "--rollout", "1", "--json"]));
    assert_eq!((&said["identical"], &said["bag"]), (&true.into(), &"s/trial-1-ros2".into()));
    let found = counts(&bench.path("s/trial-1-ros2"));
    for topic in ["/joint_states", "/skillet/pose", "/skillet/pose_desired", "/skillet/wrench"] {
        assert_eq!(found[topic], trials[0].n_records);
    }
    assert_eq!(
        (found["/tf_static"], found["/robot_description"], found["/skillet/policy"]),
        (1, 1, 4)
    );
    assert_eq!(said["topics"], serde_json::to_value(&found).unwrap());
    let metadata = util::text(&bench.path("s/trial-1-ros2/metadata.yaml"));
    let total: u64 = found.values().sum();
    assert!(metadata.contains(&format!("  message_count: {total}\n")), "{metadata}");
    assert!(metadata.contains("    - \"trial-1-ros2_0.mcap\"\n"), "{metadata}");

    // Beside the recording, when nothing else is said.
    let said = bench.ok(&["convert", "s/recording.mcap", "--ros2"]);
    assert!(said.starts_with("s/recording-ros2\n"), "{said}");
    let n_records: u64 = trials.iter().map(|trial| trial.n_records).sum();
    assert_eq!(counts(&bench.path("s/recording-ros2"))["/joint_states"], n_records);
}

/// A pan that `[plant.pan]` mounts is no link of the URDF, and has a frame all the same.
#[test]
fn a_pan_of_the_configuration_has_a_frame() {
    let bench = Bench::new();
    let (bare, _) =
        include_str!("../robots/wam7/wam7_pan.urdf").split_once("<link name=\"pan\">").unwrap();
    bench.write("bare.urdf", &format!("{bare}</robot>"));
    let pan = "pan = { mass_kg = 0.5, xyz_m = [0, 0, 0.3], rpy_rad = [0, -1.570796, 0] }";
    bench.write("c.toml", &format!("[plant]\narm = \"bare.urdf\"\ntip = \"flange\"\n{pan}\n"));
    bench.ok(&["learn", "pancake", "--config", "c.toml", "--rollouts", "1", "--out", "s"]);
    bench.ok(&["convert", "s", "--ros2", "-o", "deep/mounted"]);
    let fixed = first(&bench.path("deep/mounted"), "/tf_static");
    // The strings of its parent and its own name, as CDR writes them.
    let holds = |name: &[u8]| fixed.windows(name.len()).any(|bytes| bytes == name);
    assert!(holds(b"\x07\0\0\0flange\0") && holds(b"\x04\0\0\0pan\0"), "{fixed:?}");
}

#[test]
fn a_task_without_an_arm_has_its_events() {
    let bench = Bench::new();
    bench.ok(&["learn", "skittles", "--rollouts", "3", "--out", "s", "--record"]);
    bench.ok(&["convert", "s/recording.mcap", "--ros2", "-o", "skittles"]);
    let found = counts(&bench.path("skittles"));
    assert_eq!(found.keys().collect::<Vec<_>>(), ["/skillet/policy"]);
    assert_eq!(found["/skillet/policy"], 4 * 3);
}

#[test]
fn a_changed_world_is_noticed() {
    let bench = Bench::new();
    bench.ok(&["learn", "pancake", "--rollouts", "2", "--out", "s"]);
    let config = bench.path("s/session.toml");
    fs::write(&config, util::text(&config).replace("friction = 0.4", "friction = 0.35")).unwrap();
    let output = bench.run(&["convert", "s", "--ros2", "-o", "bag"]);
    assert_eq!(output.status.code(), Some(1), "{}", util::stderr(&output));
    assert!(String::from_utf8_lossy(&output.stdout).contains("DIFFERENT"));
    assert!(bench.path("bag/metadata.yaml").exists());
}

#[test]
fn what_is_there_stays_unless_it_is_a_bag_and_force_is_given() {
    let bench = Bench::new();
    bench.ok(&["learn", "pancake", "--rollouts", "1", "--out", "s"]);
    fs::create_dir(bench.path("empty")).unwrap();
    fs::create_dir(bench.path("thesis")).unwrap();
    bench.write("thesis/text.tex", "years of work");
    let convert = |out| ["convert", "s", "--ros2", "-o", out];
    let force = |out| [&convert(out)[..], &["--force"]].concat();
    bench.refused(&convert("thesis"), &["thesis", "already exists", "--force"]);
    bench.refused(&force("thesis"), &["thesis", "not a bag"]);
    assert_eq!(util::text(&bench.path("thesis/text.tex")), "years of work");
    bench.ok(&force("empty"));
    let whole = counts(&bench.path("empty"));
    bench.refused(&convert("empty"), &["already exists"]);
    bench.ok(&force("empty"));
    assert_eq!(counts(&bench.path("empty")), whole);
}

#[test]
fn what_cannot_be_converted_is_named_and_leaves_no_folder() {
    let bench = Bench::new();
    bench.ok(&["learn", "pancake", "--rollouts", "1", "--out", "s", "--record"]);
    let refused = |input: &str, words: &[&str]| {
        bench.refused(&["convert", input, "--ros2", "-o", "bag"], words);
        let left = fs::read_dir(bench.path(".")).unwrap().flatten();
        let left: Vec<String> = left.map(|e| e.file_name().to_string_lossy().into()).collect();
        assert!(!left.iter().any(|name| name.contains("bag")), "{left:?}");
    };
    refused("absent", &["absent", "no such recording or session"]);
    fs::create_dir(bench.path("empty")).unwrap();
    refused("empty", &["empty", "no session here"]);
    bench.write("c1.mcap.part", "");
    refused("c1.mcap.part", &[".mcap.part", "skillet record"]);
    bench.write("text.mcap", "text");
    refused("text.mcap", &["text.mcap", "not a whole MCAP file"]);
    let recording = fs::read(bench.path("s/recording.mcap")).unwrap();
    fs::write(bench.path("half.mcap"), &recording[..recording.len() / 2]).unwrap();
    refused("half.mcap", &["half.mcap", "not a whole MCAP file"]);

    // Recordings that are not of this version, or not ours.
    let write = |name: &str, profile: &str, attached: &[(&str, &str)]| {
        let file = File::create(bench.path(name)).unwrap();
        let mut writer = mcap::WriteOptions::new().profile(profile).create(file).unwrap();
        for (name, text) in attached {
            let attachment = mcap::Attachment {
                log_time: 0,
                create_time: 0,
                name: (*name).into(),
                media_type: "text/plain".into(),
                data: text.as_bytes().into(),
            };
            writer.attach(&attachment).unwrap();
        }
        let channel = writer.add_channel(0, "/tick", "protobuf", &BTreeMap::new()).unwrap();
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time: 0,
            publish_time: 0,
        };
        writer.write_to_known_channel(&header, b"").unwrap();
        writer.finish().unwrap();
    };
    write("foreign.mcap", "", &[]);
    refused("foreign.mcap", &["foreign.mcap", "session.toml"]);
    write("old.mcap", "", &[("session.toml", "[cell]\nsize = 3\n")]);
    refused("old.mcap", &["old.mcap", "another version", "size"]);
    let config = util::text(&bench.path("s/session.toml"));
    write("armless.mcap", "", &[("session.toml", &config)]);
    refused("armless.mcap", &["armless.mcap", "arm.urdf"]);
    let urdf = util::text(&bench.path("s/arm.urdf"));
    write("damaged.mcap", "", &[("session.toml", &config), ("arm.urdf", &urdf)]);
    refused("damaged.mcap", &["damaged.mcap", "/tick at 0 ns", "0 joints"]);
    write("bag-already.mcap", "ros2", &[]);
    bench.refused(&["convert", "bag-already.mcap", "--ros2"], &["is a ROS 2 bag already"]);
    let trial = ["convert", "s/recording.mcap", "--ros2", "--trial", "1", "-o", "bag"];
    bench.refused(&trial, &["--trial", "recording"]);
}
