//! A short `skillet soak` with kills, swaps and observers, and everything it counts.

mod util;

use serde_json::Value;
use util::Bench;

#[test]
fn a_short_soak_loses_nothing_and_leaves_nothing() {
    let bench = Bench::new();
    let arguments = ["soak", "--minutes", "0.4", "--rollouts", "12", "--seed", "1", "--json"];
    let output = bench.run(&[&arguments[..], &["--out", "o"]].concat());
    let summary: Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", util::stderr(&output)));
    assert_eq!(output.status.code(), Some(0), "{summary:#}");
    assert_eq!(summary["passed"], true);
    let both = &summary["cells"]["both"];
    // What it says it did, it must have done.
    assert!(both["controller"]["kills"].as_u64() > Some(0), "{summary:#}");
    assert!(both["learner"]["kills"].as_u64() > Some(0), "{summary:#}");
    // Each death of a plant alone was seen, and ended by a re-arm.
    let plant = &summary["cells"]["plant"];
    assert!(plant["plant"]["kills"].as_u64() > Some(0), "{summary:#}");
    let held = plant["kills"]["plant"].as_u64().unwrap_or(0);
    assert_eq!(plant["holds"]["seen"], held);
    assert!(plant["rearms"]["accepted"].as_u64() >= Some(held), "{summary:#}");
    assert!(plant["rearms"]["refused"].as_u64() >= Some(held), "{summary:#}");
    for cell in ["both", "learner", "plant"] {
        let cell = &summary["cells"][cell];
        let episodes = &cell["episodes"];
        let sessions = cell["sessions"].as_u64().unwrap();
        assert!(sessions > 0 && episodes["learnt"] == 12 * sessions, "{summary:#}");
        assert_eq!(episodes["produced"], episodes["learnt"]);
    }
}

/// A soak that cannot see a difference would be worth nothing.
#[test]
fn a_soak_notices_a_session_that_is_not_the_undisturbed_one() {
    let bench = Bench::new();
    let arguments = ["soak", "--minutes", "0.05", "--rollouts", "6", "--out", "o"];
    assert_eq!(bench.run(&arguments).status.code(), Some(0));
    // The same folder again, with references of another search.
    for cell in ["both", "learner", "plant"] {
        for session in ["session-0", "undisturbed-1", "undisturbed-2", "undisturbed-3"] {
            let _ = std::fs::remove_dir_all(bench.path("o").join(cell).join(session));
        }
        let reference = bench.path("o").join(cell).join("undisturbed-0");
        let other = ["learn", "pancake", "--seed", "77", "--rollouts", "6", "--out"];
        std::fs::remove_dir_all(&reference).unwrap();
        bench.ok(&[&other[..], &[reference.to_str().unwrap()]].concat());
    }
    let output = bench.run(&arguments);
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains("1 different") && text.contains("FAILED: in the cell '"), "{text}");
    assert!(util::stderr(&output).contains("differs from an undisturbed run"));
}
