//! A session as a repertoire: policies for wishes, and a session that goes on under another one.

mod util;

use serde_json::Value;
use util::{Bench, bits};

/// Thirty rollouts that cover the heights of the flip.
fn learnt(bench: &Bench, out: &str) {
    let config = concat!(env!("CARGO_MANIFEST_DIR"), "/config/pancake-repertoire.toml");
    let learn = ["learn", "pancake", "--seed", "3", "--rollouts", "30", "--out", out];
    bench.ok(&[&learn[..], &["--config", config]].concat());
}

#[test]
fn a_wish_gets_a_policy_and_one_that_nothing_serves_hears_what_does() {
    let bench = Bench::new();
    learnt(&bench, "s");
    let export = |wish: &str| bench.ok(&["policy", "export", "s", "--where", wish]);
    let (low, high) = (export("apex_m < 0.4"), export("apex_m > 0.55"));
    let peak = |json: &str| -> f64 {
        let policy: Value = serde_json::from_str(json).unwrap();
        let heights = policy["components"].as_array().unwrap().iter();
        heights.map(|component| component["attractor"][2].as_f64().unwrap()).fold(0.0, f64::max)
    };
    assert_ne!(low, high);
    assert!(peak(&low) > 0.0 && peak(&high) > 0.0);
    assert_eq!(export("apex_m < 0.4"), low, "asked again");

    let refused = |wish: &str, words: &[&str]| {
        bench.refused(&["policy", "export", "s", "--where", wish], words);
    };
    refused("apex_m > 2", &["successful rollouts meets `apex_m > 2`", "apex_m between 0."]);
    refused("apx_m > 0.3", &["--where", "there is no measure `apx_m`; did you mean `apex_m`"]);
    refused("apex_m", &["--where", "number", "truth value"]);
    bench.refused(
        &["policy", "export", "nowhere", "--where", "apex_m > 0.3"],
        &["nowhere is not the folder of a session"],
    );
    bench.refused(&["policy", "export", "s", "--where", "true", "--mode", "1"], &["--mode"]);
}

#[test]
fn a_session_goes_on_under_a_wish_to_the_same_bits_and_says_so() {
    let bench = Bench::new();
    for out in ["s", "whole"] {
        learnt(&bench, out);
    }
    let on = |out: &str, rollouts: &str, more: &[&str]| {
        let learn = ["learn", "pancake", "--out", out, "--rollouts", rollouts];
        bench.ok(&[&learn[..], more].concat())
    };
    let wish = ["--where", "apex_m < 0.45"];
    on("whole", "44", &wish);
    on("s", "36", &wish);
    on("s", "44", &[]);
    let trials = bench.trials("s");
    assert_eq!(bits(&trials), bits(&bench.trials("whole")), "stopped or not");
    let apex = |i: usize| trials[i].measures.get("apex_m").unwrap();
    assert!(trials[30].success && apex(30) < 0.45, "the next one, from the repertoire");
    let under = &trials[30..];
    assert!(under.iter().filter(|trial| trial.success).count() >= 7, "and the search follows");
    for (i, trial) in trials.iter().enumerate() {
        let is_wished = i < 30 || apex(i) < 0.45;
        assert_eq!(trial.success, trial.judged_success && is_wished, "trial {}", i + 1);
    }
    assert!(
        trials[..30].iter().any(|trial| trial.success && apex(trial.rollout as usize - 1) > 0.45)
    );

    let report = std::fs::read_to_string(bench.path("s/report/index.html")).unwrap();
    assert!(report.contains("condition from rollout 31 on"), "the report says so");
    bench.ok(&["replay", "s", "--all"]);

    bench.refused(
        &["learn", "pancake", "--out", "s", "--where", "height < 1"],
        &["learner.where", "there is no measure `height`"],
    );
    on("s", "46", &["--where", ""]);
    let free = bench.trials("s");
    assert_eq!(bits(&free[..44]), bits(&trials));
    assert!(free[44..].iter().all(|trial| trial.success == trial.judged_success));
}
