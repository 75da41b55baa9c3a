//! The report through the real executable: what a session leaves for it, also when part is damaged.

mod util;

use serde_json::Value;
use util::{Bench, text};

fn ticks(bench: &Bench) -> u64 {
    let timing: Value = serde_json::from_str(&text(&bench.path("s/timing.json"))).unwrap();
    let [timing] = timing["loops"].as_array().unwrap().as_slice() else { panic!("{timing}") };
    timing["ticks"].as_u64().unwrap()
}

#[test]
fn timing_adds_up_over_the_runs_of_a_session_and_damage_is_named() {
    let bench = Bench::new();
    let learn = |rollouts| {
        bench.ok(&["learn", "pancake", "--seed", "1", "--out", "s", "--rollouts", rollouts])
    };
    learn("3");
    let first = ticks(&bench);
    learn("6");
    assert!(ticks(&bench) > first, "the second run is added to the {first} ticks of the first");

    let page = || {
        bench.ok(&["report", "s"]);
        text(&bench.path("s/report/index.html"))
    };
    let whole = page();
    for stem in ["reward", "flip", "motion", "modes", "attractors", "ellipsoids", "tick"] {
        assert!(whole.contains(&format!("<section id=\"{stem}\"")), "{stem}");
        assert!(bench.path(&format!("s/report/{stem}.svg")).is_file(), "{stem}.svg");
    }
    assert!(whole.contains("Not measured: rerun with"), "no wake-up at full speed");
    assert!(!whole.contains("http:") && !whole.contains("https:") && !whole.contains("<script"));

    std::fs::write(bench.path("s/timing.json"), "{\"version\":1,").unwrap();
    let damaged = page();
    assert!(damaged.contains("timing.json: it is damaged"), "it is named");
    assert!(damaged.contains("<section id=\"flip\""), "the rest is there");
    assert!(!bench.path("s/report/tick.svg").exists(), "no figure of an earlier report is left");
    // The controller leaves the file alone, and learning goes on.
    learn("7");
    assert_eq!(text(&bench.path("s/timing.json")), "{\"version\":1,");
}
