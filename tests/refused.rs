//! Proposals that admission refuses: trials without reward, with their reason; and when that must end.

mod util;

use shm_types::episode::FAULT_POLICY_REFUSED;
use util::{Bench, bits};

fn config(bench: &Bench, name: &str, spread: f64) -> String {
    // Attractors that are kept near are within reach of the arm.
    let wild = format!(
        "[learner.search.power]\ninitial_std = {spread:?}\nn_initial = 100\n\
         [learner.exploration]\nattractor_reach_m = 100.0\ngrows = false\n"
    );
    bench.write(name, &wild).to_str().unwrap().into()
}

#[test]
fn a_refused_proposal_is_a_trial_without_reward_and_learning_goes_on() {
    let bench = Bench::new();
    let config = config(&bench, "wild.toml", 8.0);
    let learn = |rollouts: &str, out: &str| {
        let arguments = ["learn", "pancake", "--config", &config, "--rollouts", rollouts];
        let output = bench.run(&[&arguments[..], &["--out", out]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", util::stderr(&output));
        util::stderr(&output)
    };
    let seen = learn("14", "s");
    let trials = bench.trials("s");
    let refused: Vec<_> = trials.iter().filter(|t| t.fault == FAULT_POLICY_REFUSED).collect();
    assert!(!refused.is_empty() && refused.len() < 12, "{} of 14 refused", refused.len());
    for trial in &refused {
        assert_eq!((trial.reward, trial.n_records, trial.set_aside), (0.0, 0, false));
        assert!(!trial.success);
    }
    assert_eq!(trials[0].fault, 0, "the start is not explored");
    let log = util::text(&bench.path("s/learner.log"));
    let line = format!("rollout {}: the controller refused its policy: ", refused[0].rollout);
    assert!(log.contains(&line) && log.contains("component"), "{log}");

    let shown = seen.lines().filter(|line| line.contains("refused the policy")).count();
    assert!(shown == 1 && seen.contains("component"), "one stands for all: {seen}");

    // It resumes, and comes out as one that never stopped.
    learn("20", "s");
    learn("20", "t");
    assert_eq!(bits(&bench.trials("s")), bits(&bench.trials("t")));
    bench.ok(&["replay", "s", "--all"]);
    bench.ok(&["report", "s"]);
    let rollout = refused[0].rollout.to_string();
    bench.refused(&["replay", "s", "--trial", &rollout], &[&rollout, "refused"]);
}

#[test]
fn a_search_whose_every_proposal_is_refused_ends_with_the_reason() {
    let bench = Bench::new();
    let config = config(&bench, "lost.toml", 100.0);
    let arguments = ["learn", "pancake", "--config", &config, "--rollouts", "90", "--out", "s"];
    bench.refused(&arguments, &["20 rollouts in a row", "component", "explore less"]);
    assert_eq!(bench.trials("s").len(), 21, "the start and those that were refused");
}
