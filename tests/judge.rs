//! Rewards and successes that people write, and sessions judged once more.

mod util;

use serde_json::Value;
use util::{Bench, bits};

/// The default reward as a user could write it, and the paper's.
const CATCH: &str = "1.5*clamp(apex_m, 0, 0.55) \
    + if(crossing_time_s > 0, 1*clamp(flip_angle_rad, 0, pi)/pi, 0) \
    + if(crossing_time_s > 0, 1*exp(-max(lateral_m, 0)/0.1), 0) \
    + if(caught, 1*exp(-max(final_lateral_m, 0)/0.1), 0) \
    + if(caught, 0.5*exp(-max(bounce_s, 0)/0.05), 0) \
    + if(caught, 0.5*exp(-max(clipped_share, 0)/0.05), 0) \
    + if(caught, 1*compliance, 0)";

fn config(bench: &Bench, name: &str, judge: &str) {
    std::fs::write(bench.path(name), format!("[task]\nname = \"pancake\"\n{judge}")).unwrap();
}

fn judge_table(success: &str, reward: &str) -> String {
    format!("[task.judge]\nsuccess = \"{success}\"\nreward = \"{reward}\"\n")
}

#[test]
fn a_written_reward_is_the_built_in_one_to_the_last_bit() {
    let bench = Bench::new();
    bench.ok(&["learn", "pancake", "--seed", "4", "--rollouts", "12", "--out", "built-in"]);
    // With a reward of one's own compliance is measured, and looked for, where it is asked for.
    let measured = "[learner.compliance]\nweight = 1.0\n";
    config(&bench, "written.toml", &format!("{}{measured}", judge_table("caught", CATCH)));
    let written = ["--rollouts", "12", "--out", "written", "--config", "written.toml"];
    bench.ok(&[&["learn", "pancake", "--seed", "4"], &written[..]].concat());
    assert_eq!(bits(&bench.trials("written")), bits(&bench.trials("built-in")));

    let again = ["judge", "built-in", "--config", "written.toml"];
    let said = bench.ok(&again);
    assert!(said.contains("12 trials re-judged: 0 with another reward, 0 with another"), "{said}");
    let rows = bench.json(&again)["trials"].as_array().unwrap().clone();
    assert!(rows.len() == 12 && rows.iter().all(|row| row["before"] == row["now"]));
}

#[test]
fn another_judge_says_what_would_have_been_and_touches_nothing() {
    let bench = Bench::new();
    bench.ok(&["learn", "pancake", "--seed", "4", "--rollouts", "6", "--out", "s"]);
    let before = std::fs::read(bench.path("s/session.db")).unwrap();
    config(&bench, "high.toml", &judge_table("apex_m > 0", "100*apex_m"));
    let said = bench.ok(&["judge", "s", "--config", "high.toml"]);
    assert!(said.contains("6 with another verdict; successes 0 before, 6 now"), "{said}");
    assert!(said.contains("trial 1: no success → success"), "{said}");
    assert_eq!(std::fs::read(bench.path("s/session.db")).unwrap(), before);
}

#[test]
fn what_cannot_be_judged_is_refused_before_it_starts() {
    let bench = Bench::new();
    let learn = ["learn", "pancake", "--rollouts", "2", "--out", "s", "--config", "my.toml"];
    for (success, reward, parts) in [
        ("cought", "apex_m", &["task.judge.success", "cought", "caught"][..]),
        ("caught", "apex_cm", &["task.judge.reward", "apex_cm", "apex_m"]),
        ("apex_m", "apex_m", &["task.judge.success", "truth"]),
        ("caught", "1.5*(apex_m", &["task.judge.reward"]),
        ("caught", "1/0", &["task.judge.reward"]),
    ] {
        config(&bench, "my.toml", &judge_table(success, reward));
        bench.refused(&learn, parts);
        assert!(!bench.path("s/session.db").exists(), "nothing began");
    }
    std::fs::write(
        bench.path("my.toml"),
        "[task]\nname = \"landscape\"\n[learner.reward]\nkind = \"catch\"\n",
    )
    .unwrap();
    let learn = ["learn", "landscape", "--rollouts", "2", "--out", "s", "--config", "my.toml"];
    bench.refused(
        &learn,
        &["learner.reward.kind is catch", "apex_m", "height", "task.judge.reward"],
    );
}

#[test]
fn a_rollout_without_a_verdict_is_set_aside_and_the_session_goes_on() {
    let bench = Bench::new();
    // Without a crossing this divides by nothing; some of the first amplitudes are too small for one.
    let judge = judge_table("caught", "apex_m + if(apex_m < 0.09, 1/crossing_time_s, 0)");
    config(&bench, "my.toml", &format!("{judge}[learner.exploration]\ngrows = false\n"));
    let learn = [
        "learn",
        "pancake",
        "--seed",
        "1",
        "--rollouts",
        "12",
        "--out",
        "s",
        "--config",
        "my.toml",
        "--json",
    ];
    let summary: Value = serde_json::from_str(&bench.ok(&learn)).unwrap();
    let trials = bench.trials("s");
    let aside: Vec<_> = trials.iter().filter(|trial| trial.set_aside).collect();
    assert!(!aside.is_empty() && aside.len() < trials.len(), "{summary:#}");
    assert_eq!(summary["set_aside"], aside.len());
    assert!(aside.iter().all(|trial| !trial.measures.is_empty() && trial.n_records > 0));
    let events: String =
        bench.store("s").events().unwrap().iter().map(|e| e.text.clone()).collect();
    assert!(events.contains("division by zero"), "{events}");

    // They are told nothing, and the session resumes.
    let learn = ["learn", "pancake", "--rollouts", "14", "--out", "s"];
    bench.ok(&learn);
    // Judged by another reward they count.
    config(&bench, "other.toml", &judge_table("caught", "apex_m"));
    let said = bench.ok(&["judge", "s", "--config", "other.toml"]);
    assert!(
        said.contains("trials re-judged") && said.contains("not judged → no success"),
        "{said}"
    );
}

#[test]
fn every_task_is_listed_with_its_measures() {
    let bench = Bench::new();
    let text = bench.ok(&["task", "list"]);
    let objects = &bench.json(&["task", "list"])["tasks"];
    for object in objects.as_array().unwrap() {
        assert!(text.contains(object["task"].as_str().unwrap()));
        assert!(!object["measures"].as_object().unwrap().is_empty(), "{object}");
    }
    assert_eq!(objects[0]["measures"]["flip_angle_rad"], "rad");
}
