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
    for stem in
        ["motion", "reward", "flip", "attractors", "coordinates", "terms", "robustness", "tick"]
    {
        assert!(whole.contains(&format!("<section id=\"{stem}\"")), "{stem}");
    }
    assert!(
        whole.contains("not measured; rerun with <code>--pace realtime</code>"),
        "no wake-up at full speed"
    );
    assert!(!whole.contains("http:") && !whole.contains("https:") && !whole.contains("<script"));
    assert!(whole.len() <= 1_000_000, "{} bytes", whole.len());
    let numbers = whole.split("<b>Figure ").skip(1).map(|rest| rest.split('.').next().unwrap());
    let numbers: Vec<usize> = numbers.map(|number| number.parse().unwrap()).collect();
    assert_eq!(numbers, (1..=numbers.len()).collect::<Vec<_>>(), "no number is missing");
    assert_eq!(numbers.len(), whole.matches("<section id=").count());
    // Whatever the page links to is there, and the arm is drawn.
    let ways: Vec<&str> = whole
        .split("href=\"")
        .skip(1)
        .map(|rest| rest.split('"').next().unwrap())
        .filter(|way| !way.starts_with("data:"))
        .collect();
    assert!(ways.contains(&"trials.csv") && ways.contains(&"rollout.mcap"), "{ways:?}");
    for way in ways {
        assert!(bench.path(&format!("s/report/{way}")).is_file(), "{way}");
    }
    let motion = text(&bench.path("s/report/motion.svg"));
    assert!(motion.contains("class=\"link\"") && !whole.contains("posture follows from"));
    for part in ["skillet learn pancake --seed 1", "resumed after rollout 3", "skillet 0."] {
        assert!(whole.contains(part), "{part}");
    }

    std::fs::write(bench.path("s/timing.json"), "{\"version\":1,").unwrap();
    let damaged = page();
    assert!(damaged.contains("timing.json: it is damaged"), "it is named");
    assert!(damaged.contains("<section id=\"flip\""), "the rest is there");
    assert!(!bench.path("s/report/tick.svg").exists(), "no figure of an earlier report is left");
    // The controller leaves the file alone, and learning goes on.
    learn("7");
    assert_eq!(text(&bench.path("s/timing.json")), "{\"version\":1,");
}

#[test]
fn several_sessions_are_one_page_with_bands_over_the_seeds() {
    let bench = Bench::new();
    for (seed, kind) in [("1", "catch"), ("2", "catch"), ("3", "paper")] {
        let config = format!(
            "[task]\nname = \"pancake\"\n\n[learner]\nseed = {seed}\nrollouts = 12\n\n[learner.reward]\nkind = \"{kind}\"\n"
        );
        std::fs::write(bench.path("c.toml"), config).unwrap();
        let session = format!("s{seed}");
        bench.ok(&["learn", "pancake", "--config", "c.toml", "--out", &session]);
    }
    bench.ok(&["report", "s1", "s2", "s3", "--out", "together"]);
    let page = text(&bench.path("together/index.html"));
    assert!(page.contains("A: 2 sessions; B: 1 session."), "{page}");
    assert!(page.contains("class=\"band learnt\"") && page.contains("class=\"band best\""));
    assert!(page.contains("href=\"../s1/report/index.html\""), "{page}");
    assert!(page.contains("kind = &quot;paper&quot;") && !page.contains("<script"));
    for stem in ["rewards", "successes"] {
        assert!(bench.path(&format!("together/{stem}.svg")).is_file(), "{stem}");
    }
    bench.refused(&["report", "s1", "s2", "--out", "s3"], &["s3", "this is a session"]);
}
