//! Python reads what Skillet writes and tells, with packages that know nothing of Skillet.
//!
//! With SKILLET_PYTHON (an interpreter that has the packages, as `.ci/run` prepares it) these tests must
//! run; without it and without the packages they say that they have shown nothing.

mod util;

use std::path::Path;
use std::process::Command;

use serde_json::Value;
use util::{Bench, eventually, python_with, stderr};

fn script(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

#[test]
fn the_reference_reader_reads_a_recording() {
    let Some(python) = python_with("mcap_protobuf") else { return };
    let bench = Bench::new();
    bench.ok(&["learn", "pancake", "--rollouts", "2", "--out", "s", "--record"]);
    let recording = bench.path("s/recording.mcap");
    let output =
        Command::new(&python).arg(script("tests/read_recording.py")).arg(recording).output();
    let output = output.unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let read: Value = serde_json::from_slice(&output.stdout).unwrap();
    let trials = bench.trials("s");
    let n_records: u64 = trials.iter().map(|trial| trial.n_records).sum();
    assert_eq!(read["ticks"], n_records);
    assert_eq!(read["gaps"], 0);
    assert_eq!(read["apex_m"][1], trials[1].measures.get("apex_m").unwrap());
    assert_eq!(read["rewards"][1], trials[1].reward);
    assert_eq!(read["frames"].as_array().unwrap().len(), 9, "seven joints, pan and pancake");
    assert_eq!(read["attachments"], serde_json::json!(["arm.urdf", "session.toml"]));
}

/// What `tests/read_bag.py` says of `bag` after comparing it with `recording`.
fn read_bag(python: &str, bag: &Path, recording: &Path, more: &[&str]) -> Value {
    let mut command = Command::new(python);
    command.arg(script("tests/read_bag.py")).arg(bag).arg(recording).args(more);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn readers_of_ros_2_bags_read_what_was_converted() {
    let Some(python) = python_with("rosbags, mcap_ros2, mcap_protobuf") else { return };
    let bench = Bench::new();
    bench.ok(&["learn", "pancake", "--rollouts", "3", "--out", "s", "--record"]);
    bench.ok(&["convert", "s/recording.mcap", "--ros2", "-o", "flips"]);
    let read = read_bag(&python, &bench.path("flips"), &bench.path("s/recording.mcap"), &[]);
    let trials = bench.trials("s");
    let n_records: u64 = trials.iter().map(|trial| trial.n_records).sum();
    for topic in ["/joint_states", "/skillet/pose", "/skillet/pose_desired", "/skillet/wrench"] {
        assert_eq!(read["counts"][topic], n_records, "{topic}");
    }
    assert_eq!(read["types"]["/joint_states"], "sensor_msgs/msg/JointState");
    assert!(read["gap_m"].as_f64().unwrap() < 1e-9, "/tf leads to /skillet/pose: {read}");
    let chain: Vec<&str> =
        read["chain"].as_array().unwrap().iter().flat_map(Value::as_str).collect();
    assert_eq!((chain[0], *chain.last().unwrap()), ("pan", "base"), "links of the URDF");
    assert_eq!(read["objects"], serde_json::json!(["pancake"]));
    assert_eq!(read["is_described"], true);
    assert!(read["desired_gap_m"].as_f64().unwrap() > 0.01, "the spring pulls: {read}");
    let force = read["force_n"].as_f64().unwrap();
    assert!((10.0..1000.0).contains(&force), "{force} N at the tip");
    let events = read["events"].as_array().unwrap();
    let of = |kind: &str| events.iter().filter(|e| e["event"] == kind).cloned().collect::<Vec<_>>();
    for (i, trial) in trials.iter().enumerate() {
        assert_eq!(of("policy")[i]["policy_digest"], format!("{:016x}", trial.policy_digest));
        assert_eq!(of("outcome")[i]["n_records"], trial.n_records);
        assert_eq!(of("trial")[i]["reward"], trial.reward);
        let apex = trial.measures.get("apex_m").unwrap();
        assert_eq!(of("measures")[i]["measures"]["apex_m"], apex);
    }

    // A trial of the session, run again; a recording of it is rounded.
    bench.ok(&["convert", "s", "--ros2", "--trial", "2"]);
    bench.ok(&["replay", "s", "--trial", "2"]);
    let (bag, recording) = (bench.path("s/trial-2-ros2"), bench.path("s/replay-2.mcap"));
    let read = read_bag(&python, &bag, &recording, &["--rounded"]);
    assert_eq!(read["counts"]["/joint_states"], trials[1].n_records);
    assert_eq!(read["events"].as_array().unwrap().len(), 4);
}

#[test]
fn a_subscriber_in_python_sees_the_loop() {
    let Some(python) = python_with("iceoryx2") else { return };
    let bench = Bench::new();
    let _controller = bench.start(&["controller", "--cell", "c1", "--pace", "realtime"]);
    eventually("a controller", || {
        (bench.run(&["status", "--cell", "c1"]).status.success()).then_some(())
    });
    let output = Command::new(&python)
        .arg(script("examples/live.py"))
        .args(["c1", "2"])
        .env("SKILLET_RUNTIME_DIR", bench.path("run"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let text = String::from_utf8(output.stdout).unwrap();
    let seen: u64 = text.lines().last().unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!(seen > 500, "{text}");
    assert!(text.contains("pan at [0.7"), "the layouts agree: {text}");
}

/// How many tests below `folder` passed.
fn unittests(python: &str, folder: &str) -> u32 {
    let discover = ["-m", "unittest", "discover"];
    let mut command = Command::new(python);
    command.args(discover).arg(script(folder)).env("SKILLET", env!("CARGO_BIN_EXE_skillet"));
    let output = command.output().unwrap();
    let said = stderr(&output);
    assert!(output.status.success(), "{said}");
    let counted = said.split("Ran ").nth(1).and_then(|rest| rest.split(' ').next());
    counted.and_then(|n| n.parse().ok()).unwrap()
}

#[test]
fn the_client_for_plants_behaves_whatever_its_controller_does() {
    let Some(python) = python_with("struct") else { return };
    assert!(unittests(&python, "clients/python") >= 25);
}

/// `pip install ./clients/python` first, as `.ci/run` does.
#[test]
fn the_python_package_is_the_tool_in_python() {
    let Some(python) = python_with("skillet") else { return };
    assert!(unittests(&python, "clients/python/tests") >= 50);
}

/// The whole road: MuJoCo in Rapier's place, checked as its author would, then learnt from scratch.
#[test]
fn a_pancake_is_learnt_in_mujoco() {
    let Some(python) = python_with("mujoco") else { return };
    let bench = Bench::new();
    let program = format!("{python} {}", script("examples/plant_mujoco.py").display());
    let checked = bench.run(&["plant", "check", "--samples", "300", "--program", &program]);
    assert_eq!(checked.status.code(), Some(0), "{}", stderr(&checked));
    let learn = ["learn", "pancake", "--seed", "6", "--rollouts", "24", "--out", "s"];
    bench.ok(&[&learn[..], &["--plant-program", &program]].concat());
    let trials = bench.trials("s");
    assert_eq!(trials.len(), 24);
    assert!(trials.iter().all(|trial| trial.was_executed()));
    assert!(trials.iter().any(|trial| trial.success), "no flip was caught");
}

/// What docs/peg.md promises: a task of one's own without Rust. The world draws the hole's place by the rollout, so
/// that a trial can be repeated out of its turn.
#[test]
fn a_peg_is_learnt_by_python_and_toml_alone() {
    let Some(python) = python_with("mujoco") else { return };
    let bench = Bench::new();
    let config = script("examples/peg/peg.toml").display().to_string();
    let program = format!("{python} {}", script("examples/peg/plant.py").display());
    let of_peg = ["--config", &config, "--plant-program", &program];
    let judge = format!("{python} {}", script("examples/peg/judge.py").display());
    let check = ["plant", "check", "--config", &config, "--samples", "200", "--program", &program];
    let checked = bench.run(&check);
    assert_eq!(checked.status.code(), Some(0), "{}", stderr(&checked));
    let learn = ["learn", "custom", "--rollouts", "24", "--out", "s", "--judge", &judge];
    bench.ok(&[&learn[..], &of_peg].concat());
    let trials = bench.trials("s");
    assert_eq!(trials.len(), 24);
    assert!(trials.iter().all(|trial| trial.was_executed()));
    let measured = |name: &str, i: usize| trials[i].measures.get(name).unwrap();
    assert!(measured("force_n", 0) > 20.0 || measured("depth_m", 0) < 0.025, "it is stiff");
    assert!(trials.iter().any(|trial| trial.success), "no peg went in");
    let said = bench.ok(&["replay", "s", "--trial", "17"]);
    assert!(said.contains("identical, bit for bit"), "{said}");
}

#[test]
fn a_box_is_pushed_in_mujoco() {
    let Some(python) = python_with("mujoco") else { return };
    let bench = Bench::new();
    let config = script("examples/push/push.toml").display().to_string();
    let program = format!("{python} {}", script("examples/push/plant.py").display());
    let learn = ["learn", "custom", "--rollouts", "6", "--out", "s", "--config", &config];
    bench.ok(&[&learn[..], &["--plant-program", &program]].concat());
    let trials = bench.trials("s");
    let miss = trials.iter().map(|trial| trial.measures.get("miss_m").unwrap());
    assert!(miss.clone().all(|miss| miss < 0.13) && trials.iter().all(|t| t.was_executed()));
    assert!(miss.fold(f64::MAX, f64::min) < 0.06, "it was moved");
}
