//! A session whose rollouts end early says so, and why: in the progress, the summary and as JSON.

mod util;

use util::{Bench, stderr};

#[test]
fn rollouts_that_end_early_are_counted_by_reason_wherever_a_session_is_summed_up() {
    let bench = Bench::new();
    let reason = "the pan left the workspace";
    // The pan starts at 0.72 m and dips.
    bench.write("c.toml", "[controller]\nworkspace_floor_m = 0.7\n");
    let learn = ["learn", "pancake", "--config", "c.toml", "--rollouts", "10", "--out", "s"];
    let output = bench.run(&learn);
    let (progress, summary) = (stderr(&output), String::from_utf8(output.stdout).unwrap());
    assert_eq!(output.status.code(), Some(0), "{progress}");
    let faults = bench.trials("s").iter().filter(|trial| trial.fault != 0).count();
    assert!(faults > 5, "the test needs rollouts that end early, found {faults}");
    let sentence = format!("{faults} ended early: {reason}");
    let last = progress.lines().find(|line| line.starts_with("rollout 10/10")).unwrap();
    assert!(last.contains(&sentence), "{last}");
    assert!(summary.contains(&sentence), "{summary}");

    // Resumed, with nothing left to do: what was stored counts.
    let json: serde_json::Value =
        serde_json::from_str(&bench.ok(&[&learn[..], &["--json"]].concat())).unwrap();
    assert_eq!(json["ended_early"], serde_json::json!({ reason: faults }), "{json}");

    let sound = bench.ok(&["learn", "pancake", "--rollouts", "2", "--out", "sound"]);
    assert!(!sound.contains("ended early"), "{sound}");
}
