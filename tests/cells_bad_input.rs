//! What can be wrong with the cells of a session: it is defined, it is said, and nothing is lost.
//!
//! | | tested in |
//! |---|---|
//! | two learners for one cell, one cell named twice | `cells.rs` |
//! | two controllers for one cell | `services.rs` |
//! | two bridges of one name, another world over a bridge, an episode of another session | `bridge/tests/turns.rs` |
//! | a clock an hour off, a bridge that reconnects to a session that ended | `bridge/tests/mishaps.rs` |
//! | a full disk under a session or a spool, of one cell | `disk.rs` |
//! | the same of several, another task or arm, another plant, a session that ended | here |

mod util;

use std::fs;
use std::time::Duration;

use serde_json::Value;
use shm_types::episode::EpisodeHeader;
use shm_types::{Digest, SCHEMA};
use util::place::Place;
use util::{Bench, Running, eventually, stderr};
use zerocopy::IntoBytes;

const ARM: &str = include_str!("../robots/wam7/wam7_pan.urdf");

fn controller(bench: &Bench, cell: &str, config: &str) -> Running {
    bench.start(&["controller", "--cell", cell, "--pace", "max", "--config", config])
}

fn config(bench: &Bench, name: &str, text: &str) -> String {
    bench.write(name, text).to_str().unwrap().to_string()
}

fn status(bench: &Bench, cell: &str) -> Option<Value> {
    let output = bench.run(&["status", "--cell", cell, "--json"]);
    serde_json::from_slice(&output.stdout).ok().filter(|value: &Value| value["health"].is_string())
}

fn number(bench: &Bench, cell: &str, field: &str) -> u64 {
    eventually(field, || status(bench, cell).and_then(|status| status[field].as_u64()))
}

fn ended(running: Running) -> String {
    running.signal("TERM");
    stderr(&running.wait())
}

fn expect_whole(bench: &Bench, session: &str, rollouts: u64) {
    let numbers: Vec<u64> = bench.trials(session).iter().map(|trial| trial.rollout).collect();
    assert_eq!(numbers, (1..=rollouts).collect::<Vec<_>>());
    let again = bench.ok(&["replay", session, "--all"]);
    assert!(again.contains(" 0 different"), "{again}");
}

#[test]
fn a_cell_with_another_arm_gets_no_rollouts_until_it_has_the_sessions() {
    let bench = Bench::new();
    let heavier = ARM.replacen("<mass value=\"", "<mass value=\"1", 1);
    assert_ne!(heavier, ARM);
    let urdf = bench.write("heavier.urdf", &heavier);
    let other = format!("[plant]\narm = \"{}\"\n", urdf.display());
    let other = config(&bench, "other.toml", &other);
    let own = config(&bench, "own.toml", "[learner]\nrollouts = 40\nseed = 3\n");
    let (_a, b) = (controller(&bench, "a", &own), controller(&bench, "b", &other));
    eventually("the controller of b", || status(&bench, "b"));
    let arguments = ["learner", "--cell", "a", "--cell", "b", "--session", "s", "--config", &own];
    let learner = bench.start(&arguments);
    let output = learner.wait();
    let said = stderr(&output);
    assert!(output.status.success(), "{said}");
    for word in
        ["cell b: its controller has task pancake on the arm with URDF ", "it gets no rollouts"]
    {
        assert!(said.contains(word), "no '{word}' in: {said}");
    }
    assert_eq!(number(&bench, "b", "rollouts_done"), 0);
    assert!(bench.trials("s").iter().all(|trial| trial.cell == "a"));
    ended(b);
    expect_whole(&bench, "s", 40);
}

/// It is the only cell, and the session waits for the right controller.
#[test]
fn a_cell_with_another_task_is_waited_for() {
    let bench = Bench::new();
    let other = config(&bench, "other.toml", "[task]\nname = \"landscape\"\n");
    let own = config(&bench, "own.toml", "[learner]\nrollouts = 12\nseed = 3\n");
    let wrong = controller(&bench, "a", &other);
    eventually("the controller", || status(&bench, "a"));
    let log = bench.path("learner.log");
    let mut learner =
        bench.skillet(&["learner", "--cell", "a", "--session", "s", "--config", &own]);
    learner.stderr(fs::File::create(&log).unwrap());
    let learner = Running::start(&mut learner);
    let said = |word: &str| fs::read_to_string(&log).unwrap_or_default().contains(word);
    eventually("the other task is said", || {
        said("has task landscape, the session task pancake").then_some(())
    });
    std::thread::sleep(Duration::from_millis(500));
    assert_eq!(number(&bench, "a", "rollouts_done"), 0);
    ended(wrong);
    let _right = controller(&bench, "a", &own);
    assert!(learner.wait().status.success());
    assert!(said("its controller has the session's task and arm"));
    expect_whole(&bench, "s", 12);
}

#[test]
fn trials_know_the_arm_and_the_plant_of_their_cell() {
    let bench = Bench::new();
    bench.ok(&["learn", "pancake", "--cells", "2", "--rollouts", "12", "--out", "s"]);
    let found: Value = serde_json::from_str(&bench.ok(&["trials", "s", "--json"])).unwrap();
    let rows = found["trials"].as_array().unwrap();
    let cells = bench.store("s").cells().unwrap();
    assert_eq!(cells.len(), 2, "{cells:?}");
    assert!(cells.iter().all(|cell| cell.urdf_sha256.len() == 64), "{cells:?}");
    for row in rows {
        let plant = row["plant"].as_str().unwrap();
        assert!(plant.starts_with("built-in (Rapier ") && row["arm"] == "wam7", "{row}");
        assert!(cells[0].urdf_sha256.starts_with(row["arm_urdf"].as_str().unwrap()), "{row}");
    }
    bench.ok(&["report", "s"]);
    let page = fs::read_to_string(bench.path("s/report/index.html")).unwrap();
    assert!(page.contains("cell 2") && page.contains("plant built-in (Rapier "));
}

/// As a controller would have written it: no record.
fn spooled(session: u64, rollout: u64) -> Vec<u8> {
    let header = EpisodeHeader { session, rollout, ..Default::default() };
    let mut bytes = b"SKEPISOD".to_vec();
    bytes.extend(SCHEMA.to_ne_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(Digest::new().bytes(&bytes).finish().to_ne_bytes());
    bytes
}

/// The last acknowledgement may be lost with a learner; the next one gives it, although there is nothing to learn.
#[test]
fn a_session_that_ended_still_acknowledges() {
    let bench = Bench::new();
    let own = config(&bench, "own.toml", "[learner]\nrollouts = 5\n");
    let learner = ["learner", "--cell", "a", "--session", "s", "--config", &own];
    let first = controller(&bench, "a", &own);
    bench.ok(&learner);
    ended(first);
    let session = bench.store("s").meta().session_id;
    let spool = bench.path("state/a/spool");
    fs::write(spool.join(format!("{session:016x}-00000005.episode")), spooled(session, 5)).unwrap();
    let _second = controller(&bench, "a", &own);
    assert_eq!(number(&bench, "a", "spooled_episodes"), 1);
    bench.ok(&learner);
    eventually("an empty spool", || (number(&bench, "a", "spooled_episodes") == 0).then_some(()));
    assert_eq!(number(&bench, "a", "rollouts_done"), 0);
}

/// Both cells wait for the learner, which waits for its disk; then all goes on, and nothing is executed twice.
#[test]
fn a_full_disk_under_the_session_of_two_cells_loses_nothing() {
    let bench = Bench::new();
    let Some(place) = Place::new(&bench, "12m") else { return };
    let own = config(&bench, "own.toml", "[learner]\nrollouts = 60\nseed = 3\n");
    let _controllers = [controller(&bench, "a", &own), controller(&bench, "b", &own)];
    let session = place.inside("s");
    let arguments = ["learner", "--cell", "a", "--cell", "b", "--session", &session];
    let learner = place.start(&bench, &[&arguments[..], &["--config", &own]].concat());
    place.wait_for_trials(&bench, "s", 3);
    eventually("a learner that waits", || {
        place.fill();
        let before = place.trial_count(&bench, "s");
        std::thread::sleep(Duration::from_secs(1));
        (place.trial_count(&bench, "s") == before).then_some(())
    });
    let is_told = |cell| status(&bench, cell).unwrap()["findings"].to_string().contains("disk");
    eventually("both are told why", || (is_told("a") && is_told("b")).then_some(()));
    place.free();
    let output = learner.wait();
    let said = stderr(&output);
    assert!(output.status.success() && said.contains("stored; continuing"), "{said}");
    let done = number(&bench, "a", "rollouts_done") + number(&bench, "b", "rollouts_done");
    assert_eq!(done, 60, "each once");
    place.rescue("s", &bench.path("rescued"));
    expect_whole(&bench, "rescued", 60);
}

/// The spool of one of two cells fails: it is said there, and the session is whole.
#[test]
fn a_full_disk_under_the_spool_of_one_of_two_cells_loses_nothing() {
    let bench = Bench::new();
    let Some(place) = Place::new(&bench, "2m") else { return };
    let own = config(&bench, "own.toml", "[learner]\nrollouts = 60\nseed = 3\n");
    let state = format!("[cell]\nstate_dir = \"{}\"\n", place.inside("state"));
    let full = config(&bench, "full.toml", &state);
    let arguments = ["controller", "--cell", "a", "--pace", "max", "--config", &full];
    let (a, _b) = (place.start(&bench, &arguments), controller(&bench, "b", &own));
    eventually("the controller of a", || status(&bench, "a"));
    place.fill();
    let arguments = ["learner", "--cell", "a", "--cell", "b", "--session", "s", "--config", &own];
    let output = bench.start(&arguments).wait();
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(number(&bench, "a", "state_errors") > 0);
    let said = ended(a);
    assert!(said.contains("not spooled"), "{said}");
    expect_whole(&bench, "s", 60);
}
