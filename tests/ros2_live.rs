//! `skillet bridge ros2` on a stand-in for a ROS 2 graph, found and read by implementations that know nothing of Skillet.
//! ROS itself was not tried. `cargo test --features bridge --test ros2_live`.

mod util;

use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};

use serde_json::{Value, json};
use util::{Bench, eventually, python_with, stderr};

/// One that nobody listens on, so far.
fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// `tests/read_ros_graph.py`, which says one line after the other.
struct Reader {
    child: Child,
    lines: BufReader<ChildStdout>,
}

impl Reader {
    fn start(python: &str, port: u16, domain: &str, namespace: &str) -> Reader {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/read_ros_graph.py");
        let mut command = Command::new(python);
        command.arg(script).args([&port.to_string(), domain, namespace]);
        // pyzeros leaves a folder somewhere.
        command.env("CYDR_CACHE_DIR", Path::new(env!("CARGO_TARGET_TMPDIR")).join("cydr"));
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap());
        Reader { child, lines }
    }

    fn line(&mut self) -> Value {
        let mut line = String::new();
        self.lines.read_line(&mut line).unwrap();
        serde_json::from_str(&line).unwrap_or_else(|_| {
            let mut said = String::new();
            let mut errors = BufReader::new(self.child.stderr.take().unwrap());
            std::io::Read::read_to_string(&mut errors, &mut said).unwrap();
            panic!("the reader said '{line}' and {said}")
        })
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn strings(value: &Value) -> Vec<&str> {
    value.as_array().unwrap().iter().flat_map(Value::as_str).collect()
}

#[test]
fn independent_readers_find_a_cell_on_the_graph_and_understand_it() {
    // msgspec comes with pyzeros, which would leave a folder where it is imported.
    let Some(python) = python_with("zenoh, rosbags, msgspec, zenoh_ros2_sdk") else { return };
    let bench = Bench::new();
    let port = free_port();
    // Neither its router nor its controller is there.
    let publisher = bench.start(
        &["bridge", "ros2", "--cell", "kitchen-1", "--namespace", "line/arm", "--domain", "7"]
            .into_iter()
            .chain(["--connect", &format!("127.0.0.1:{port}")])
            .collect::<Vec<_>>(),
    );
    let mut reader = Reader::start(&python, port, "7", "/line/arm");
    let _controller = bench.start(&["controller", "--cell", "kitchen-1", "--pace", "realtime"]);
    eventually("a controller", || {
        bench.run(&["status", "--cell", "kitchen-1"]).status.success().then_some(())
    });
    let _learner = bench.start(&["learner", "--cell", "kitchen-1", "--session", "s"]);

    let read = reader.line();
    let topic = |name: &str| format!("/line/arm{name}");
    for (name, type_name) in [
        ("/joint_states", "sensor_msgs/msg/JointState"),
        ("/tf", "tf2_msgs/msg/TFMessage"),
        ("/tf_static", "tf2_msgs/msg/TFMessage"),
        ("/robot_description", "std_msgs/msg/String"),
        ("/skillet/pose", "geometry_msgs/msg/PoseStamped"),
        ("/skillet/pose_desired", "geometry_msgs/msg/PoseStamped"),
        ("/skillet/wrench", "geometry_msgs/msg/WrenchStamped"),
        ("/skillet/policy", "std_msgs/msg/String"),
    ] {
        assert_eq!(read["types"][topic(name)], json!([type_name]), "{read}");
    }
    assert_eq!(read["nodes"], json!(["/line/arm skillet_kitchen_1"]));
    assert_eq!(read["latched"], json!([topic("/robot_description"), topic("/tf_static")]));
    assert_eq!(read["node_tokens"].as_array().unwrap().len(), 1);
    assert_eq!(strings(&read["joints"]).len(), 7);
    assert_eq!(read["is_described"], true);

    // Ticks of a loop of 1 kHz, a hundred a second where the host keeps up, never from the future; /tf leads where the
    // pose says.
    assert!(read["on_grid"].as_f64().unwrap() > 0.9, "{read}");
    assert!(read["step_ms_min"].as_f64().unwrap() > 0.0, "{read}");
    assert!(read["rate_hz"].as_f64().unwrap() < 102.0, "{read}");
    assert!(read["delay_ms_min"].as_f64().unwrap() > 0.0, "{read}");
    assert!(read["placed"].as_u64().unwrap() > 100, "{read}");
    assert!(read["gap_m"].as_f64().unwrap() < 1e-9, "{read}");
    let chain = strings(&read["chain"]);
    assert_eq!((chain[0], *chain.last().unwrap()), ("pan", "base"), "links of the URDF");

    // What was told is what the learner has stored.
    let trials = bench.trials("s");
    let told = read["events"].as_array().unwrap();
    let of = |kind: &str| told.iter().find(|event| event["event"] == kind).unwrap();
    let stored = |event: &Value| {
        let trial = trials.iter().find(|trial| event["rollout"] == trial.rollout).unwrap();
        assert_eq!(event["policy_digest"], format!("{:016x}", trial.policy_digest));
        trial
    };
    assert_eq!(of("trial")["reward"], stored(of("trial")).reward);
    let apex = stored(of("measures")).measures.get("apex_m").unwrap();
    assert_eq!(of("measures")["measures"]["apex_m"], apex);
    assert_eq!(of("outcome")["n_records"], stored(of("outcome")).n_records);

    publisher.signal("TERM");
    assert!(reader.line()["left"].as_u64().unwrap() >= 9);
    let output = publisher.wait();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let said = stderr(&output);
    assert!(said.contains("no Zenoh router") && said.contains("rmw_zenohd"), "{said}");
    assert!(said.contains("/line/arm/skillet_kitchen_1 of domain 7"), "{said}");
}

#[test]
fn it_waits_for_a_controller_and_ends_when_it_is_asked() {
    let bench = Bench::new();
    let listen = format!("127.0.0.1:{}", free_port());
    let output = bench.run(&[
        "bridge",
        "ros2",
        "--cell",
        "none",
        "--listen",
        &listen,
        "--duration-s",
        "1.5",
    ]);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(
        said.contains("no controller in the cell 'none'") && said.contains("waiting"),
        "{said}"
    );

    let waiting = bench.start(&["bridge", "ros2", "--cell", "none", "--connect", &listen]);
    std::thread::sleep(std::time::Duration::from_millis(1500));
    waiting.signal("TERM");
    let output = waiting.wait();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(stderr(&output).matches("no Zenoh router").count(), 1, "said once");
}

#[test]
fn what_ros_would_not_understand_is_refused() {
    let bench = Bench::new();
    let refused = |more: &[&str], words: &[&str]| {
        bench.refused(&[&["bridge", "ros2", "--cell", "c1"], more].concat(), words);
    };
    refused(&["--listen", "0.0.0.0:7447"], &["0.0.0.0:7447", "127.0.0.1"]);
    refused(&["--connect", "oven"], &["oven", "HOST:PORT"]);
    refused(&["--namespace", "my-arm"], &["my-arm", "letters"]);
    refused(&["--rate", "0"], &["--rate"]);
    let mut command = bench.skillet(&["bridge", "ros2", "--cell", "c1"]);
    let output = command.env("ROS_DOMAIN_ID", "seven").output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("ROS_DOMAIN_ID is 'seven'"), "{}", stderr(&output));
}
