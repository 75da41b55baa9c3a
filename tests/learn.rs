//! The main job through the real executable: results, interruption, deaths.

mod util;

use serde_json::Value;
use util::{Bench, bits, eventually, is_alive, kill, stderr, text};

fn learn(out: &str) -> Vec<&str> {
    vec!["learn", "pancake", "--seed", "1", "--out", out]
}

#[test]
fn learns_writes_a_session_and_says_so_in_one_json_object() {
    let bench = Bench::new();
    let arguments = [&learn("s")[..], &["--rollouts", "12", "--json"]].concat();
    let summary: Value = serde_json::from_str(&bench.ok(&arguments)).unwrap();
    for key in ["task", "seed", "rollouts", "first_success", "success_last20", "best_reward"] {
        assert!(summary.get(key).is_some(), "{key} is missing in {summary}");
    }
    assert_eq!(summary["trials"], 12);
    assert_eq!(summary["task"], "pancake");
    assert!(summary["rollouts_per_s"].as_f64().unwrap() > 0.0);
    assert!(summary["wall_s"].as_f64().unwrap() > 0.0);

    let session = bench.path("s");
    for file in ["session.toml", "session.db", "report/index.html", "demonstration.csv"] {
        assert!(session.join(file).is_file(), "{file}");
    }
    let page = text(&session.join("report/index.html"));
    assert!(page.contains("<svg") && !page.contains("NaN"), "a page with figures");
    let left = bench.path("run").read_dir().unwrap().flatten().map(|entry| entry.file_name());
    assert_eq!(left.count(), 0, "the private cell is gone");

    let trials = bench.trials("s");
    assert_eq!(trials.len(), 12);
    assert!(trials.iter().all(|trial| trial.n_records > 100 && trial.applied_tick > 0));
}

#[test]
fn initial_policy_does_not_toss() {
    let bench = Bench::new();
    bench.ok(&[&learn("s")[..], &["--rollouts", "1", "--json"]].concat());
    let first = &bench.trials("s")[0].measures;
    assert!(!first.has("tossed") && !first.has("dropped"));
    let apex_m = first.get("apex_m").unwrap();
    assert!((0.05..0.3).contains(&apex_m), "it lifts the pan all the same: {apex_m}");
}

/// The point of it all. Other machines may round differently, so no single seed is demanded.
#[test]
fn most_of_four_seeds_flip_the_pancake_within_40_rollouts() {
    let bench = Bench::new();
    let seeds = ["10", "24", "34", "36"];
    let sessions = seeds.map(|seed| {
        let more = ["--rollouts", "40", "--json", "--seed", seed, "--out", seed];
        bench.start(&[&["learn", "pancake"][..], &more].concat())
    });
    let first_successes = sessions.map(|session| {
        let summary: Value = serde_json::from_slice(&session.wait().stdout).unwrap();
        summary["first_success"].as_u64()
    });
    let found = first_successes.iter().flatten().count();
    assert!(found >= 2, "first caught flips of seeds {seeds:?}: {first_successes:?}");
}

#[test]
fn ctrl_c_ends_both_children_and_the_session_resumes() {
    let bench = Bench::new();
    let running = bench.start(&[&learn("s")[..], &["--rollouts", "20"]].concat());
    let children = [running.child("controller"), running.child("learner")];
    bench.wait_for_trials("s", 3);
    running.signal("INT");
    let output = running.wait();
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    eventually("end of the children", || children.iter().all(|c| !is_alive(*c)).then_some(()));
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.contains("skillet learn pancake --out s"), "how to go on: {said}");

    bench.ok(&[&learn("s")[..], &["--rollouts", "20"]].concat());
    bench.ok(&[&learn("undisturbed")[..], &["--rollouts", "20"]].concat());
    assert_eq!(bits(&bench.trials("s")), bits(&bench.trials("undisturbed")));
}

#[test]
fn ctrl_c_of_a_terminal_at_any_moment_is_an_orderly_end() {
    let bench = Bench::new();
    for (n, delay_ms) in [0, 5, 15, 30, 60, 120, 250, 500].into_iter().enumerate() {
        let out = format!("s{n}");
        let running = bench.start(&[&learn(&out)[..], &["--rollouts", "500"]].concat());
        // Before this, the process is not ours yet: it has not begun to run skillet.
        eventually("start", || util::is_skillet(running.pid()).then_some(()));
        std::thread::sleep(std::time::Duration::from_millis(100 + delay_ms));
        running.signal_group("INT");
        let output = running.wait();
        assert_eq!(output.status.code(), Some(1), "{delay_ms} ms: {}", stderr(&output));
        bench.ok(&[&learn(&out)[..], &["--rollouts", "1"]].concat());
    }
}

#[test]
fn sessions_started_together_take_folders_of_their_own_or_say_so() {
    let bench = Bench::new();
    let first = bench.start(&[&learn("s")[..], &["--rollouts", "500"]].concat());
    bench.wait_for_trials("s", 1);
    bench.refused(&learn("s"), &["this session is in use"]);
    first.signal("INT");
    assert_eq!(first.wait().status.code(), Some(1));
}

#[test]
fn killed_children_are_named_and_nothing_is_lost() {
    let bench = Bench::new();
    for (victim, survivor) in [("controller", "learner"), ("learner", "controller")] {
        let running = bench.start(&[&learn(victim)[..], &["--rollouts", "20"]].concat());
        let other = running.child(survivor);
        let pid = running.child(victim);
        bench.wait_for_trials(victim, 2);
        kill(pid, "KILL");
        let output = running.wait();
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(&format!("the {victim} was killed by signal 9")), "{message}");
        assert!(message.contains(&format!("The {survivor} was ended cleanly")), "{message}");
        eventually("end of the survivor", || (!is_alive(other)).then_some(()));

        bench.ok(&[&learn(victim)[..], &["--rollouts", "20"]].concat());
        assert_eq!(bench.trials(victim).len(), 20);
    }
    assert_eq!(bits(&bench.trials("controller")), bits(&bench.trials("learner")));
}

#[test]
fn a_killed_parent_takes_its_children_along() {
    let bench = Bench::new();
    let running = bench.start(&[&learn("s")[..], &["--rollouts", "500"]].concat());
    let children = [running.child("controller"), running.child("learner")];
    bench.wait_for_trials("s", 1);
    running.signal("KILL");
    running.wait();
    eventually("end of the children", || children.iter().all(|c| !is_alive(*c)).then_some(()));
}

#[test]
fn policies_can_be_listed_and_shown() {
    let bench = Bench::new();
    bench.ok(&[&learn("s")[..], &["--rollouts", "3"]].concat());
    let listed: Value =
        serde_json::from_str(&bench.ok(&["policy", "list", "s", "--json"])).unwrap();
    assert_eq!(listed["policies"].as_array().unwrap().len(), 3);
    assert!(bench.ok(&["policy", "list", "s", "--best", "1"]).lines().count() == 2);
    let shown: Value =
        serde_json::from_str(&bench.ok(&["policy", "show", "s", "2", "--json"])).unwrap();
    assert_eq!(shown["policy"]["components"].as_array().unwrap().len(), 8);
    assert!(bench.ok(&["policy", "show", "s", "0"]).contains("component 8"));
    bench.refused(&["policy", "show", "s", "99"], &["policy 99", "policy list"]);
}

#[test]
fn rollouts_of_500_hz_and_4_khz_fit_into_an_episode() {
    let bench = Bench::new();
    for (period_us, records_per_s) in [(2000, 500.0), (250, 1000.0)] {
        let config = bench.write("c.toml", &format!("[controller]\nperiod_us = {period_us}\n"));
        let out = format!("s{period_us}");
        let arguments = ["learn", "pancake", "--rollouts", "2", "--out", &out, "--config"];
        bench.ok(&[&arguments[..], &[config.to_str().unwrap()]].concat());
        for trial in bench.trials(&out) {
            // 1.4 s and at most 1.2 s to settle.
            let seconds = trial.n_records as f64 / records_per_s;
            assert!((1.3..2.7).contains(&seconds), "{period_us} µs: {} records", trial.n_records);
            assert_eq!(trial.fault, 0);
        }
    }
}
