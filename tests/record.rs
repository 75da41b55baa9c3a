//! Recordings: complete, readable by others, whole after a crash; replays that give the same again.

mod util;

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use prost::Message;
use serde_json::Value;
use util::{Bench, eventually};

/// As a reader without our code would declare it: numbers of fields are part of the format.
#[derive(Clone, PartialEq, Message)]
struct Tick {
    #[prost(uint64, tag = "1")]
    tick: u64,
    #[prost(uint32, tag = "2")]
    phase: u32,
    #[prost(float, repeated, tag = "4")]
    q_rad: Vec<f32>,
    #[prost(float, repeated, tag = "9")]
    activations: Vec<f32>,
    #[prost(float, repeated, tag = "10")]
    stiffness_per_s2: Vec<f32>,
    #[prost(uint32, optional, tag = "20")]
    tick_ns: Option<u32>,
    #[prost(uint64, tag = "22")]
    policy_digest: u64,
}

#[derive(Clone, PartialEq, Message)]
struct Outcome {
    #[prost(uint64, tag = "2")]
    rollout: u64,
    #[prost(uint64, tag = "5")]
    n_records: u64,
}

#[derive(Clone, PartialEq, Message)]
struct Measure {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(string, tag = "2")]
    unit: String,
    #[prost(double, tag = "3")]
    value: f64,
}

#[derive(Clone, PartialEq, Message)]
struct Measures {
    #[prost(uint64, tag = "2")]
    rollout: u64,
    #[prost(message, repeated, tag = "4")]
    measures: Vec<Measure>,
}

/// Everything in a file, by topic; the library checks every checksum.
fn read(path: &Path) -> BTreeMap<String, Vec<(u64, Vec<u8>)>> {
    let bytes = std::fs::read(path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().expect("a whole file has a summary");
    let mut topics: BTreeMap<_, Vec<_>> = BTreeMap::new();
    let mut latest = 0;
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        assert!(message.log_time >= latest, "{}: time only grows", message.channel.topic);
        latest = message.log_time;
        let schema = message.channel.schema.as_ref().unwrap();
        assert_eq!(schema.encoding, "protobuf");
        let messages = topics.entry(message.channel.topic.clone()).or_default();
        messages.push((message.log_time, message.data.into_owned()));
    }
    let n_messages: usize = topics.values().map(Vec::len).sum();
    assert_eq!(summary.stats.unwrap().message_count as usize, n_messages);
    topics
}

fn ticks(topics: &BTreeMap<String, Vec<(u64, Vec<u8>)>>) -> Vec<Tick> {
    topics["/tick"].iter().map(|(_, data)| Tick::decode(&data[..]).unwrap()).collect()
}

fn is_gapless(ticks: &[Tick]) -> bool {
    ticks.windows(2).all(|pair| pair[1].tick == pair[0].tick + 1)
}

#[test]
fn a_learnt_session_is_recorded_tick_by_tick() {
    let bench = Bench::new();
    let learn = ["learn", "pancake", "--rollouts", "4", "--out", "s", "--record"];
    bench.ok(&learn);
    let topics = read(&bench.path("s/recording.mcap"));
    let trials = bench.trials("s");
    let n_records: u64 = trials.iter().map(|trial| trial.n_records).sum();
    let ticks = ticks(&topics);
    assert_eq!(ticks.len() as u64, n_records, "every tick");

    let mut first = 0;
    for (trial, (_, outcome)) in trials.iter().zip(&topics["/outcome"]) {
        let outcome = Outcome::decode(&outcome[..]).unwrap();
        assert_eq!((outcome.rollout, outcome.n_records), (trial.rollout, trial.n_records));
        let rollout = &ticks[first..first + trial.n_records as usize];
        assert!(
            is_gapless(rollout) && rollout.iter().all(|t| t.policy_digest == trial.policy_digest)
        );
        first += rollout.len();
    }
    for (trial, (_, measures)) in trials.iter().zip(&topics["/measures"]) {
        let recorded = Measures::decode(&measures[..]).unwrap();
        assert_eq!(recorded.rollout, trial.rollout);
        let recorded =
            recorded.measures.iter().map(|m| (m.name.as_str(), m.unit.as_str(), m.value));
        assert!(recorded.eq(trial.measures.iter().map(|m| (m.name, m.unit, m.value))));
    }
    for tick in &ticks {
        assert!(tick.phase >= 2 && tick.q_rad.len() == 7 && tick.tick_ns.is_none());
        let sum: f32 = tick.activations.iter().sum();
        assert!((sum - 1.0).abs() < 0.03, "activations sum to {sum}");
        assert_eq!(tick.stiffness_per_s2.len(), 10, "of four learnt coordinates");
        assert!(tick.stiffness_per_s2[0] > 1.0);
    }
    for topic in ["/policy", "/trial", "/mixture", "/tf", "/joint_states", "/bodies", "/springs"] {
        assert!(topics.contains_key(topic), "{topic} is missing");
    }
    assert_eq!((topics["/policy"].len(), topics["/trial"].len()), (4, 4));
    let times: Vec<u64> = topics["/tick"].iter().map(|(time, _)| *time).collect();
    assert!(times.windows(2).all(|pair| pair[1] > pair[0]), "time only grows");

    // The same session again gives the same recording.
    let again = ["learn", "pancake", "--rollouts", "4", "--out", "again", "--record"];
    bench.ok(&again);
    let again = read(&bench.path("again/recording.mcap"));
    assert_eq!(again["/tf"], topics["/tf"]);
}

#[test]
fn a_trial_is_replayed_bit_for_bit_and_a_changed_world_is_noticed() {
    let bench = Bench::new();
    bench.ok(&["learn", "pancake", "--rollouts", "4", "--out", "s"]);
    let all: Value = serde_json::from_str(&bench.ok(&["replay", "s", "--all", "--json"])).unwrap();
    assert_eq!((&all["trials"], all["different"].as_array().unwrap().len()), (&4.into(), 0));

    let one: Value =
        serde_json::from_str(&bench.ok(&["replay", "s", "--trial", "3", "--json"])).unwrap();
    assert_eq!(one["identical"], true);
    let topics = read(&bench.path("s/replay-3.mcap"));
    assert_eq!(topics["/tick"].len() as u64, bench.trials("s")[2].n_records);
    bench.refused(&["replay", "s", "--trial", "9"], &["no trial 9", "1..=4"]);

    let config = bench.path("s/session.toml");
    let text = util::text(&config).replace("friction = 0.4", "friction = 0.35");
    std::fs::write(&config, text).unwrap();
    let output = bench.run(&["replay", "s", "--all", "--json"]);
    assert_eq!(output.status.code(), Some(1));
    let all: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(!all["different"].as_array().unwrap().is_empty());
}

#[test]
fn worlds_without_an_arm_are_recorded_and_replayed() {
    let bench = Bench::new();
    bench.ok(&["learn", "skittles", "--rollouts", "6", "--out", "s", "--record"]);
    let topics = read(&bench.path("s/recording.mcap"));
    assert_eq!(topics["/outcome"].len(), 6);
    assert!(!topics.contains_key("/tf"));
    let all: Value = serde_json::from_str(&bench.ok(&["replay", "s", "--all", "--json"])).unwrap();
    assert!(all["different"].as_array().unwrap().is_empty());
    bench.ok(&["replay", "s"]);
}

#[test]
fn a_running_cell_is_recorded_without_a_gap_and_by_rollout() {
    let bench = Bench::new();
    let _controller = bench.start(&["controller", "--cell", "c1", "--pace", "realtime"]);
    let config = bench.write("c.toml", "[learner]\nrollouts = 40\n");
    let learner = ["learner", "--cell", "c1", "--session", "s", "--config"];
    let _learner = bench.start(&[&learner[..], &[config.to_str().unwrap()]].concat());
    bench.wait_for_trials("s", 1);
    let record = ["record", "--cell", "c1", "--by-rollout", "--duration-s", "5", "--json"];
    let said: Value = serde_json::from_str(&bench.ok(&record)).unwrap();
    assert_eq!(said["ticks_lost"], 0);
    let files = said["files"].as_array().unwrap();
    assert!(files.len() >= 3, "{said}");
    let mut all = Vec::new();
    for file in files {
        let topics = read(&bench.path(file.as_str().unwrap()));
        assert!(topics.contains_key("/bodies"), "every file stands alone");
        all.extend(ticks(&topics));
    }
    assert!(is_gapless(&all));
    assert_eq!(Some(all.len() as u64), said["ticks_seen"].as_u64());
    assert!(all.iter().all(|tick| tick.tick_ns.is_some()));
    assert!(all.iter().filter(|tick| tick.phase >= 2).all(|tick| !tick.activations.is_empty()));
}

/// What a killed recorder leaves becomes a whole file, but for its last second.
#[test]
fn a_killed_recorder_loses_its_last_second_and_no_more() {
    let bench = Bench::new();
    let _controller = bench.start(&["controller", "--cell", "c1", "--pace", "realtime"]);
    let part = bench.path("c1.mcap.part");
    let recorder = eventually("a recorder", || {
        let mut recorder = bench.start(&["record", "--cell", "c1"]);
        std::thread::sleep(Duration::from_millis(300));
        (!recorder.has_ended() && part.exists()).then_some(recorder)
    });
    let started = std::time::Instant::now();
    eventually("two seconds on disk", || {
        (started.elapsed() > Duration::from_secs(3) && part.metadata().unwrap().len() > 10_000)
            .then_some(())
    });
    recorder.signal("KILL");
    recorder.wait();
    let output = bench.run(&["record", "--cell", "c1", "--duration-s", "0.5"]);
    assert_eq!(output.status.code(), Some(0), "{}", util::stderr(&output));
    assert!(util::stderr(&output).contains("repaired"), "{}", util::stderr(&output));
    assert!(!part.exists());
    let recovered = ticks(&read(&bench.path("c1.mcap")));
    assert!(is_gapless(&recovered));
    assert!(recovered.len() > 1000, "{} ticks", recovered.len());
    assert!(bench.path("c1-2.mcap").exists(), "the new recording has a name of its own");
}
