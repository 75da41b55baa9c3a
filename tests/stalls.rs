//! Stalls and learners that never sent a heartbeat are reported and stay visible.

mod util;

use std::time::Duration;

use serde_json::Value;
use shm_types::cell::{Cell, Role};
use util::{Bench, eventually};

fn status(bench: &Bench) -> Option<Value> {
    let output = bench.run(&["status", "--cell", "c1", "--json"]);
    serde_json::from_slice(&output.stdout).ok().filter(|status: &Value| status["tick"].is_u64())
}

fn says(status: &Value, words: &str) -> bool {
    status["findings"].to_string().contains(words)
}

#[test]
fn a_loop_that_stood_still_says_so_and_is_not_well_for_a_while() {
    for pace in ["realtime", "max"] {
        let bench = Bench::new();
        let controller = bench.start(&["controller", "--cell", "c1", "--pace", pace]);
        // It answers before its loop begins, and a loop that has not begun does not stand still. Without
        // deadlines nothing ticks between rollouts.
        let before = eventually("a loop", || {
            status(&bench).filter(|s| pace == "max" || s["tick"].as_u64() > Some(0))
        });
        assert!(!says(&before, "stalled for 2"), "{before:#}");
        controller.signal("STOP");
        std::thread::sleep(Duration::from_millis(2500));
        controller.signal("CONT");
        let after = eventually("the stall", || {
            status(&bench).filter(|s| s["stalls"]["longest_s"].as_f64() >= Some(2.0))
        });
        assert!(after["stalls"]["count"].as_u64() >= Some(1), "{after:#}");
        assert_eq!(after["health"], "degraded", "{pace}");
        assert!(says(&after, "the loop stalled for"), "{after:#}");
        let text = String::from_utf8(bench.run(&["status", "--cell", "c1"]).stdout).unwrap();
        assert!(text.contains("stalls      ") && text.contains("since the start"), "{text}");
        controller.signal("TERM");
        let log = util::stderr(&controller.wait());
        assert!(log.contains("WARN the loop stalled for 2."), "{pace}: {log}");
    }
}

#[test]
fn a_learner_that_says_nothing_is_not_well() {
    let bench = Bench::new();
    let _controller = bench.start(&["controller", "--cell", "c1", "--pace", "max"]);
    eventually("a controller", || status(&bench));
    let cell = Cell::in_dir(&bench.path("run"), "c1").unwrap();
    let learner = cell.lock(Role::Learner).unwrap();
    let mute = eventually("a finding", || status(&bench).filter(|s| says(s, "no heartbeat for")));
    assert_eq!(mute["health"], "degraded");
    drop(learner);
    eventually("its end", || status(&bench).filter(|s| !says(s, "no heartbeat for")));
}
