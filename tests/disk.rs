//! Disks that are full or read-only: it is said, learning goes on or waits, nothing is lost, and the
//! session is that of an undisturbed run, bit for bit.

mod util;

use std::fs;
use std::thread::sleep;
use std::time::Duration;

use learner::store::Store;
use serde_json::Value;
use shm_types::episode::EpisodeHeader;
use shm_types::{Digest, SCHEMA};
use util::place::Place;
use util::{Bench, bits, eventually, is_alive, kill, stderr};
use zerocopy::IntoBytes;

const ROLLOUTS: &str = "60";
const CONTROLLER: [&str; 5] = ["controller", "--cell", "c1", "--pace", "max"];
/// Room for some spooled episodes, or for a session.
const SIZE: &str = "12m";

fn status(bench: &Bench) -> Option<Value> {
    let output = bench.run(&["status", "--cell", "c1", "--json"]);
    // Exit code 1: the cell is unhealthy, as intended here.
    serde_json::from_slice(&output.stdout).ok().filter(|value: &Value| value["health"].is_string())
}

/// One number of the status, once there is a controller.
fn number(bench: &Bench, field: &str) -> u64 {
    eventually(field, || status(bench).and_then(|status| status[field].as_u64()))
}

/// A configuration whose controller keeps its state in `state`.
fn config(bench: &Bench, state: Option<&str>) -> String {
    let cell = state.map_or(String::new(), |dir| format!("[cell]\nstate_dir = \"{dir}\"\n"));
    let text = format!("{cell}[learner]\nrollouts = {ROLLOUTS}\nseed = 3\n");
    bench.write("c.toml", &text).to_str().unwrap().to_string()
}

fn undisturbed(bench: &Bench) -> Vec<Vec<u64>> {
    bench.ok(&["learn", "pancake", "--seed", "3", "--rollouts", ROLLOUTS, "--out", "undisturbed"]);
    bits(&bench.trials("undisturbed"))
}

/// The state folder fails while episodes are spooled, by `break_it`, and is well again.
fn spool_fails(break_it: impl Fn(&Place), fix: impl Fn(&Place)) {
    let bench = Bench::new();
    let Some(place) = Place::new(&bench, SIZE) else { return };
    let config = config(&bench, Some(&place.inside("state")));
    let controller = place.start(&bench, &[&CONTROLLER[..], &["--config", &config]].concat());
    let learner = ["learner", "--cell", "c1", "--session", "s", "--config", &config];
    let learner = bench.start(&learner);
    bench.wait_for_trials("s", 3);
    eventually("a failed write", || {
        break_it(&place);
        (number(&bench, "state_errors") > 0).then_some(())
    });
    let before = bench.trials("s").len();
    bench.wait_for_trials("s", before + 5);
    let text = bench.ok(&["status", "--cell", "c1"]);
    assert!(text.contains("writes failed; see the controller's log"), "{text}");

    fix(&place);
    let after = bench.trials("s").len();
    bench.wait_for_trials("s", after + 2);
    let errors = number(&bench, "state_errors");
    let output = learner.wait();
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(number(&bench, "state_errors"), errors, "the spool works again");
    eventually("an empty spool", || (number(&bench, "spooled_episodes") == 0).then_some(()));
    let left: Vec<_> = fs::read_dir(place.outside("state/spool")).unwrap().flatten().collect();
    assert!(left.is_empty(), "{left:?}");
    controller.signal("TERM");
    let said = stderr(&controller.wait());
    for word in ["not spooled", "state/spool/", ".episode", "free space or fix permissions"] {
        assert!(said.contains(word), "no '{word}' in: {said}");
    }
    assert_eq!(bits(&bench.trials("s")), undisturbed(&bench));
}

#[test]
fn a_disk_that_fills_up_under_the_spool_stops_nothing() {
    spool_fails(Place::fill, Place::free);
}

#[test]
fn a_state_folder_that_becomes_read_only_stops_nothing() {
    spool_fails(|place| place.remount("ro"), |place| place.remount("rw"));
}

/// Fills the disk until the session stands still: nothing is asked, nothing stored.
fn stand_still(bench: &Bench, place: &Place, trials: &dyn Fn() -> usize) -> usize {
    eventually("a learner that waits", || {
        place.fill();
        let before = trials();
        let mut looks = (0..8).map(|_| {
            sleep(Duration::from_millis(250));
            let idle = status(bench).is_some_and(|status| status["phase"] == "idle");
            idle && trials() == before
        });
        looks.all(|still| still).then_some(before)
    })
}

/// The learner waits by itself, or is killed and comes back.
#[test]
fn a_disk_that_fills_up_under_the_session_makes_the_learner_wait() {
    let bench = Bench::new();
    let Some(place) = Place::new(&bench, SIZE) else { return };
    let config = config(&bench, None);
    let _controller = bench.start(&CONTROLLER);
    let session = place.inside("s");
    let learner = ["learner", "--cell", "c1", "--session", &session, "--config", &config];
    let first = place.start(&bench, &learner);
    place.wait_for_trials(&bench, "s", 3);
    let trials = || place.trial_count(&bench, "s");

    let stored = stand_still(&bench, &place, &trials) as u64;
    assert!(is_alive(first.pid()), "it waits");
    let done = number(&bench, "rollouts_done");
    let open = number(&bench, "unacknowledged_episodes");
    assert_eq!(done - stored, open, "nothing is acknowledged that is not stored");
    assert_eq!(number(&bench, "spooled_episodes"), open, "what is not, the controller keeps");
    eventually("a beat while it waits", || {
        status(&bench)
            .filter(|status| status["learner_age_s"].as_f64().is_some_and(|age| age < 0.5))
            .filter(|status| status["findings"].to_string().contains("waiting for its disk"))
    });
    place.free();
    place.wait_for_trials(&bench, "s", stored as usize + 3);

    let stored = stand_still(&bench, &place, &trials);
    kill(first.pid(), "KILL");
    let said = stderr(&first.wait());
    for word in ["no space left", "session.db", "free some", "retrying", "stored; continuing"] {
        assert!(said.contains(word), "no '{word}' in: {said}");
    }
    let refused = place.start(&bench, &learner).wait();
    assert_eq!(refused.status.code(), Some(2), "{}", stderr(&refused));
    let said = stderr(&refused);
    assert!(said.contains("disk/s") && said.contains("free"), "{said}");
    assert_eq!(trials(), stored, "as it was");
    place.free();
    let output = place.start(&bench, &learner).wait();
    assert!(output.status.success(), "{}", stderr(&output));
    place.rescue("s", &bench.path("rescued"));
    assert_eq!(bits(&bench.trials("rescued")), undisturbed(&bench));
}

/// A learner that runs holds its file open, and the kernel refuses to make it read-only meanwhile.
#[test]
fn read_only_folders_are_refused_at_the_start() {
    let bench = Bench::new();
    let Some(place) = Place::new(&bench, SIZE) else { return };
    let (state, session) = (place.inside("state"), place.inside("s"));
    let config = config(&bench, Some(&state));
    let controller = [&CONTROLLER[..], &["--config", &config]].concat();
    let learner = ["learner", "--cell", "c1", "--session", &session, "--config", &config];
    let refused = |arguments: &[&str], words: &[&str]| {
        let output = place.start(&bench, arguments).wait();
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{said}");
        words.iter().for_each(|word| assert!(said.contains(word), "no '{word}' in: {said}"));
    };
    let of_state = [state.as_str(), "Read-only", "check permissions"];
    let of_session = [session.as_str(), "Read-only", "check permissions"];

    place.remount("ro");
    refused(&controller, &of_state);
    refused(&learner, &of_session);
    place.remount("rw");
    let running = place.start(&bench, &controller);
    let learning = place.start(&bench, &learner);
    place.wait_for_trials(&bench, "s", 3);
    for process in [learning, running] {
        process.signal("TERM");
        process.wait();
    }
    place.remount("ro");
    refused(&controller, &of_state);
    refused(&learner, &[session.as_str(), "Read-only"]);
}

/// As a controller would have written it: no record.
fn spooled(session: u64, rollout: u64) -> Vec<u8> {
    let header = EpisodeHeader { session, rollout, ..Default::default() };
    let mut bytes = b"SKEPISOD".to_vec();
    bytes.extend(SCHEMA.to_ne_bytes());
    bytes.extend(header.as_bytes());
    let digest = Digest::new().bytes(&bytes).finish();
    bytes.extend(digest.to_ne_bytes());
    bytes
}

#[test]
fn a_full_spool_pauses_its_session_and_no_other() {
    let bench = Bench::new();
    let config = config(&bench, None);
    let first = bench.start(&CONTROLLER);
    let learner = bench.start(&["learner", "--cell", "c1", "--session", "s", "--config", &config]);
    bench.wait_for_trials("s", 3);
    first.signal("TERM");
    first.wait();
    let session = Store::open(&bench.path("s/session.db")).unwrap().meta().session_id;
    let spool = bench.path("state/c1/spool");
    let put = |session: u64| {
        for rollout in 1_000_001..=1_000_064 {
            let name = format!("{session:016x}-{rollout:08}.episode");
            fs::write(spool.join(name), spooled(session, rollout)).unwrap();
        }
    };
    // One that never comes back changes nothing.
    put(session ^ 1);
    let before = bench.trials("s").len();
    let second = bench.start(&CONTROLLER);
    bench.wait_for_trials("s", before + 3);
    second.signal("TERM");
    second.wait();

    put(session);
    let third = bench.start(&["controller", "--cell", "c1", "--pace", "realtime"]);
    eventually("a full spool", || status(&bench).filter(|status| status["spool_full"] == true));
    let output = bench.run(&["status", "--cell", "c1"]);
    assert_eq!(output.status.code(), Some(1), "it needs attention");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains("it is full, learning is paused"), "{text}");
    let (paused, tick) = (bench.trials("s").len(), number(&bench, "tick"));
    sleep(Duration::from_secs(3));
    assert_eq!(bench.trials("s").len(), paused, "learning is paused");
    assert!(number(&bench, "tick") > tick + 100, "the loop goes on");
    third.signal("TERM");
    third.wait();
    for entry in fs::read_dir(&spool).unwrap().flatten() {
        if entry.file_name().to_string_lossy().contains("-010000") {
            fs::remove_file(entry.path()).unwrap();
        }
    }
    let _fourth = bench.start(&CONTROLLER);
    let output = learner.wait();
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(bits(&bench.trials("s")), undisturbed(&bench));
}
