//! Several cells and one learner: real processes that come, go and are killed.

mod util;

use std::collections::BTreeSet;
use std::time::Duration;

use learner::store::TrialRecord;
use serde_json::Value;
use util::{Bench, Running, kill, stderr};

const LEARNER: [&str; 9] =
    ["learner", "--cell", "a", "--cell", "b", "--cell", "c", "--session", "s"];

fn controller(bench: &Bench, cell: &str) -> Running {
    bench.start(&["controller", "--cell", cell, "--pace", "max"])
}

/// Every rollout is there once, and is what its policy leads to.
fn expect_whole(bench: &Bench, session: &str, rollouts: u64) -> Vec<TrialRecord> {
    let mut trials = bench.trials(session);
    let numbers: Vec<u64> = trials.iter().map(|trial| trial.rollout).collect();
    assert_eq!(numbers, (1..=rollouts).collect::<Vec<_>>());
    let again = bench.ok(&["replay", session, "--all"]);
    assert!(again.contains(" 0 different"), "{again}");
    trials.sort_by_key(|trial| trial.told);
    let places: Vec<u64> = trials.iter().map(|trial| trial.told).collect();
    assert_eq!(places, (1..=rollouts).collect::<Vec<_>>());
    trials
}

#[test]
fn cells_come_go_and_die_while_the_learner_learns() {
    let bench = Bench::new();
    let config = bench.write("c.toml", "[learner]\nrollouts = 90\nseed = 3\n");
    let first = bench.start(&[&LEARNER[..], &["--config", config.to_str().unwrap()]].concat());
    let a = controller(&bench, "a");
    bench.wait_for_trials("s", 8);
    let b = controller(&bench, "b");
    bench.wait_for_trials("s", 24);
    kill(a.pid(), "KILL");
    a.wait();
    bench.wait_for_trials("s", 32);
    kill(first.pid(), "KILL");
    first.wait();
    let _c = controller(&bench, "c");
    let second = bench.start(&LEARNER);
    bench.wait_for_trials("s", 48);
    kill(b.pid(), "KILL");
    b.wait();
    let _a = controller(&bench, "a");
    let _b = controller(&bench, "b");
    let output = second.wait();
    assert!(output.status.success(), "{}", stderr(&output));

    let trials = expect_whole(&bench, "s", 90);
    let cells: BTreeSet<&str> = trials.iter().map(|trial| trial.cell.as_str()).collect();
    assert_eq!(cells, BTreeSet::from(["a", "b", "c"]));
    assert!(trials.iter().any(|trial| trial.asked_after + 1 < trial.told), "in flight together");
    // The session can be resumed: all of it is reproduced.
    bench.ok(&LEARNER);
}

/// What a cell has executed while there was no learner, it hands in itself: nothing is executed twice.
#[test]
fn a_learner_that_comes_back_asks_each_cell_for_what_it_was_given() {
    let bench = Bench::new();
    let config = bench.write("c.toml", "[learner]\nrollouts = 120\nseed = 3\n");
    let learner = ["learner", "--cell", "a", "--cell", "b", "--session", "s", "--config"];
    let learner = [&learner[..], &[config.to_str().unwrap()]].concat();
    let _controllers = [controller(&bench, "a"), controller(&bench, "b")];
    for n in 1..8 {
        let running = bench.start(&learner);
        bench.wait_for_trials("s", 12 * n);
        kill(running.pid(), "KILL");
        running.wait();
        // Long enough to execute what they were asked for.
        std::thread::sleep(Duration::from_millis(600));
    }
    bench.ok(&learner);
    expect_whole(&bench, "s", 120);
    let done = |cell| {
        let status = bench.run(&["status", "--cell", cell, "--json"]).stdout;
        let status: Value = serde_json::from_slice(&status).unwrap();
        status["rollouts_done"].as_u64().unwrap()
    };
    assert_eq!(done("a") + done("b"), 120, "each once");
}

/// Its rollout is given to the other one, under its number, when its time is up.
#[test]
fn the_rollout_of_a_cell_that_stands_still_is_left_to_another() {
    let bench = Bench::new();
    let config = bench.write("c.toml", "[learner]\nrollouts = 40\n");
    let learner = ["learner", "--cell", "a", "--cell", "b", "--session", "s", "--config"];
    let (a, _b) = (controller(&bench, "a"), controller(&bench, "b"));
    let learner = bench.start(&[&learner[..], &[config.to_str().unwrap()]].concat());
    bench.wait_for_trials("s", 10);
    kill(a.pid(), "STOP");
    let output = learner.wait();
    kill(a.pid(), "CONT");
    let said = stderr(&output);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("cell a: controller silent"), "{said}");
    expect_whole(&bench, "s", 40);
}

#[test]
fn a_cell_is_asked_by_one_learner_and_once() {
    let bench = Bench::new();
    let _a = controller(&bench, "a");
    bench.refused(
        &["learner", "--cell", "a", "--cell", "b", "--cell", "a", "--session", "s"],
        &["--cell a", "twice"],
    );
    let config = bench.write("c.toml", "[learner]\nrollouts = 4000\n");
    let config = ["--config", config.to_str().unwrap()];
    let learner = ["learner", "--cell", "a", "--session", "s"];
    let first = bench.start(&[&learner[..], &config].concat());
    bench.wait_for_trials("s", 2);
    let second = ["learner", "--cell", "b", "--cell", "a", "--session", "t"];
    bench.refused(&second, &["cell 'a' has a learner already"]);
    first.signal("TERM");
    first.wait();
}

#[test]
fn learn_with_several_cells_survives_the_death_of_one() {
    let bench = Bench::new();
    let arguments = ["learn", "pancake", "--cells", "3", "--rollouts", "60", "--out", "s"];
    let learn = bench.start(&arguments);
    bench.wait_for_trials("s", 10);
    kill(learn.child("controller"), "KILL");
    let output = learn.wait();
    let said = stderr(&output);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("continuing with 2 of the cells"), "{said}");
    let trials = expect_whole(&bench, "s", 60);
    let cells: BTreeSet<&str> = trials.iter().map(|trial| trial.cell.as_str()).collect();
    assert!(cells.len() >= 2, "{cells:?}");
    bench.refused(&["learn", "pancake", "--cells", "0", "--out", "t"], &["--cells"]);
}
