//! Same configuration and seed, same bits: run twice, stopped and resumed, in real time.

mod util;

use util::{Bench, bits};

fn learn(bench: &Bench, out: &str, rollouts: &str, more: &[&str]) {
    let arguments = ["learn", "pancake", "--seed", "5", "--json", "--out", out, "--rollouts"];
    bench.ok(&[&arguments[..], &[rollouts], more].concat());
}

#[test]
fn stopping_at_trial_40_and_resuming_changes_no_bit() {
    let bench = Bench::new();
    learn(&bench, "whole", "60", &[]);
    learn(&bench, "parts", "40", &[]);
    assert_eq!(bench.trials("parts").len(), 40);
    learn(&bench, "parts", "60", &[]);

    let (whole, parts) = (bench.trials("whole"), bench.trials("parts"));
    assert_eq!(whole.len(), 60);
    assert_eq!(bits(&whole), bits(&parts));
    // The trials differ from each other: equality above is not the equality of constants.
    let rewards: std::collections::BTreeSet<u64> =
        whole.iter().map(|trial| trial.reward.to_bits()).collect();
    assert!(rewards.len() > 50, "{} different rewards", rewards.len());
}

#[test]
fn real_time_gives_the_same_numbers_as_maximum_pace() {
    let bench = Bench::new();
    learn(&bench, "max", "4", &["--pace", "max"]);
    learn(&bench, "realtime", "4", &["--pace", "realtime"]);
    assert_eq!(bits(&bench.trials("max")), bits(&bench.trials("realtime")));
}

#[test]
fn another_seed_gives_other_trials() {
    let bench = Bench::new();
    learn(&bench, "a", "3", &[]);
    bench.ok(&["learn", "pancake", "--seed", "6", "--rollouts", "3", "--out", "b", "--json"]);
    let (a, b) = (bits(&bench.trials("a")), bits(&bench.trials("b")));
    assert_eq!(a[0], b[0], "rollout 1 executes the initial policy whatever the seed");
    assert_ne!(a[1], b[1]);
}
