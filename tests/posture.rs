//! `skillet posture` on a real controller process: the elbow goes aside in what is served, and nothing else
//! changes.

mod util;

use serde_json::{Value, json};
use shm_types::cell::Cell;
use shm_types::episode::TickRecord;
use shm_types::policy_json;
use shm_types::ports::ObserverPorts;
use util::{Bench, Running, bits, eventually, kill, rocking};

const CONTROLLER: [&str; 5] = ["controller", "--cell", "c1", "--pace", "max"];

fn status(bench: &Bench) -> Option<Value> {
    serde_json::from_slice(&bench.run(&["status", "--cell", "c1", "--json"]).stdout).ok()
}

fn controller(bench: &Bench) -> Running {
    let controller = bench.start(&CONTROLLER);
    eventually("a controller", || status(bench).filter(|status| status["controller"] == "running"));
    controller
}

/// A policy that is served from now on.
fn serve(bench: &Bench) {
    let path = bench.write("policy.json", &policy_json::to_json(&rocking(0.02)).unwrap());
    bench.ok(&["policy", "import", path.to_str().unwrap(), "--cell", "c1"]);
    bench.ok(&["policy", "activate", "1", "--cell", "c1"]);
    bench.ok(&["policy", "pin", "--cell", "c1"]);
}

/// Waits for a tick under a policy like this one.
fn until(bench: &Bench, what: &str, is_it: impl Fn(&TickRecord) -> bool) {
    let cell = Cell::in_dir(&bench.path("run"), "c1").unwrap();
    let observer = ObserverPorts::open(&cell, util::WATCHDOG).unwrap();
    eventually(what, || {
        while let Ok(Some(sample)) = observer.telemetry.receive() {
            let executed = |tick: &&TickRecord| tick.phase == 2 || tick.phase == 3;
            let mut ticks = sample.ticks().iter().map(|tick| &tick.record).filter(executed);
            if ticks.any(&is_it) {
                return Some(());
            }
        }
        None
    });
}

#[test]
fn the_elbow_goes_aside_while_a_policy_is_served_and_comes_back() {
    let bench = Bench::new();
    let first = controller(&bench);
    serve(&bench);
    let ask = |arguments: &[&str]| bench.run(&[&["posture", "--cell", "c1"], arguments].concat());

    let moved = ask(&["--joint", "1", "--by", "0.4", "--json"]);
    assert!(moved.status.success(), "{}", util::stderr(&moved));
    let moved: Value = serde_json::from_slice(&moved.stdout).unwrap();
    assert_eq!(moved["posture_offset_rad"], json!([0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
    assert_eq!((&moved["cell"], &moved["posture_in_s"]), (&"c1".into(), &1.0.into()));
    assert!(moved["applied_tick"].is_u64() && moved["latency_ms"].as_f64() > Some(0.0));
    until(&bench, "an elbow aside", |tick| tick.q[0] > 0.15 && tick.q[2] < -0.15);
    let told = status(&bench).unwrap();
    assert_eq!(told["posture_offset_rad"], moved["posture_offset_rad"]);
    assert_eq!((&told["posture_in_s"], &told["health"]), (&1.0.into(), &"ok".into()));
    let note = told["notes"].to_string();
    assert!(note.contains("0.4 rad at joint 1") && note.contains("posture --reset"), "{note}");

    for (arguments, words) in [
        (&["--joint", "1", "--by", "0.4", "--in", "0.3"][..], ["2.50 rad/s", "0.75 s or more"]),
        (&["--reset", "--in", "0.1"], ["0.1 s", "0.25 to 60 s"]),
        (&["--joint", "4", "--by", "2"], ["joint 4 (j4_elbow_pitch)", "its offset within"]),
        (&["--offset", "nan"], ["joint 1", "not a finite number"]),
        (&["--offset", "0,0,0,0,0,0,0,0.1"], ["8 numbers", "at most 7 joints"]),
        (&["--joint", "8", "--by", "0.1"], ["8", "1..=7"]),
        (&["--joint", "1"], ["--by", "required"]),
        (&["--reset", "--in", "-1"], ["--in", "more than 0"]),
        (&[], ["--joint", "--reset"]),
    ] {
        bench.refused(&[&["posture", "--cell", "c1"], arguments].concat(), &words);
    }
    assert_eq!(status(&bench).unwrap()["posture_offset_rad"], moved["posture_offset_rad"]);

    let said = bench.ok(&["posture", "--reset", "--cell", "c1"]);
    assert!(said.contains("returns to its start within 1.0 s"), "{said}");
    until(&bench, "an elbow back", |tick| tick.t_s > 0.8 && tick.q[0].abs() < 0.05);
    assert!(status(&bench).unwrap()["posture_offset_rad"].is_null());

    let said = bench.ok(&["posture", "--offset", "-0.2,0,0.1", "--cell", "c1"]);
    assert!(said.contains("-0.2 rad at joint 1, 0.1 rad at joint 3"), "{said}");
    kill(first.pid(), "KILL");
    first.wait();
    let _second = controller(&bench);
    assert!(status(&bench).unwrap()["posture_offset_rad"].is_null(), "a restart forgets it");
}

#[test]
fn a_learners_session_comes_out_the_same() {
    let bench = Bench::new();
    let _controller = controller(&bench);
    let config = bench.write("c.toml", "[learner]\nrollouts = 25\nseed = 3\n");
    let learner = ["learner", "--cell", "c1", "--session", "s", "--config"];
    let learner = bench.start(&[&learner[..], &[config.to_str().unwrap()]].concat());
    bench.wait_for_trials("s", 5);
    let said = bench.ok(&["posture", "--joint", "1", "--by", "0.4", "--cell", "c1"]);
    assert!(said.contains("the learner's rollouts keep the start posture"), "{said}");
    assert!(learner.wait().status.success());
    let undisturbed =
        ["learn", "pancake", "--seed", "3", "--rollouts", "25", "--out", "undisturbed"];
    bench.ok(&undisturbed);
    assert_eq!(bits(&bench.trials("s")), bits(&bench.trials("undisturbed")));
}

#[test]
fn an_arm_without_a_null_space_and_a_task_without_an_arm_are_told_so() {
    let bench = Bench::new();
    let task = bench.write("throws.toml", "[task]\nname = \"skittles\"\n");
    let six = concat!(env!("CARGO_MANIFEST_DIR"), "/config/pancake-ur10e.toml");
    for (config, word) in [(task.to_str().unwrap(), "no arm"), (six, "6 joints")] {
        let controller = bench.start(&[&CONTROLLER[..], &["--config", config]].concat());
        eventually("a controller", || status(&bench).filter(|s| s["controller"] == "running"));
        bench.refused(&["posture", "--joint", "1", "--by", "0.1", "--cell", "c1"], &[word]);
        controller.signal("TERM");
        controller.wait();
    }
}
