//! `skillet session list | show`: sessions at a glance, without a trace in their folders.

mod util;

use std::fs;
use std::path::Path;

use serde_json::Value;
use util::{Bench, eventually};

fn files(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).unwrap().flatten().map(|entry| entry.file_name());
    let mut names: Vec<String> = names.map(|name| name.to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn sessions_are_listed_with_what_they_have_learnt() {
    let bench = Bench::new();
    assert!(bench.ok(&["session", "list"]).contains("no session in sessions"));
    let learn = |task: &str, seed: &str, out: &str| {
        bench.json(&["learn", task, "--seed", seed, "--rollouts", "30", "--out", out])
    };
    let first = learn("archery", "7", "sessions/arrows");
    learn("skittles", "2", "sessions/? of % and #");
    fs::create_dir(bench.path("sessions/none")).unwrap();
    let before = files(&bench.path("sessions/arrows"));
    let list = bench.json(&["session", "list"]);
    let [second, arrows] = &list["sessions"].as_array().unwrap()[..] else { panic!("{list}") };
    assert_eq!((&second["task"], &second["seed"]), (&"skittles".into(), &2.into()));
    assert_eq!((&arrows["session"], &arrows["trials"]), (&"sessions/arrows".into(), &30.into()));
    for field in ["task", "seed", "successes", "best_reward", "rollouts"] {
        assert_eq!(arrows[field], first[field], "{field}");
    }
    assert_eq!(arrows["in_use"], false);
    assert_eq!(files(&bench.path("sessions/arrows")), before, "a look leaves nothing behind");

    let shown = bench.json(&["session", "show", "sessions/arrows"]);
    for field in ["task", "seed", "trials", "successes", "first_success", "best_rollout", "modes"] {
        assert_eq!(shown[field], first[field], "{field}");
    }
    let text = bench.ok(&["session", "list"]);
    assert!(
        text.lines().any(|line| line.starts_with("arrows") && line.contains("30/30")),
        "{text}"
    );
    bench.refused(&["session", "show", "sessions/none"], &["no session here"]);
}

/// What people say and wish for decides what a success is: then the whole session is read.
#[test]
fn a_list_agrees_with_the_session_under_a_wish_and_with_a_learner_at_work() {
    let bench = Bench::new();
    let learn = ["learn", "pancake", "--rollouts", "20", "--out", "sessions/s"];
    bench.ok(&learn);
    bench.ok(&[&learn[..3], &["22", "--out", "sessions/s", "--where", "apex_m < 0.4"]].concat());
    let row = || bench.json(&["session", "list"])["sessions"][0].clone();
    let shown = bench.json(&["session", "show", "sessions/s"]);
    for field in ["trials", "successes", "best_reward"] {
        assert_eq!(row()[field], shown[field], "{field}");
    }
    let config = util::text(&bench.path("sessions/s/session.toml"));
    bench.write("sessions/s/session.toml", &config.replace("rollouts = 22", "rollouts = 5000"));
    let controller = bench.start(&["controller", "--cell", "c1", "--pace", "max"]);
    let _learner = bench.start(&["learner", "--cell", "c1", "--session", "sessions/s"]);
    let working = eventually("new trials", || {
        Some(row()).filter(|row: &Value| row["trials"].as_u64() > Some(22))
    });
    assert_eq!((&working["in_use"], &working["rollouts"]), (&true.into(), &5000.into()));
    assert!(bench.ok(&["session", "list"]).contains("learning now"));
    drop(controller);
}

#[test]
fn a_session_that_cannot_be_read_is_named_with_the_reason() {
    let bench = Bench::new();
    bench.ok(&["learn", "archery", "--rollouts", "2", "--out", "sessions/a"]);
    fs::write(bench.path("sessions/a/session.db"), "no database").unwrap();
    let row = bench.json(&["session", "list"])["sessions"][0].clone();
    assert_eq!(row["trials"], Value::Null);
    assert!(row["problem"].as_str().unwrap().contains("not a Skillet session"), "{row}");
    bench.refused(&["session", "list", "sessions/a/session.db"], &["cannot list the folder"]);
}
