//! A pin keeps a learner waiting and lasts over a restart: both are said, with the way out.

mod util;

use serde_json::Value;
use shm_types::policy_json;
use util::{Bench, Running, eventually, rocking};

const MAX: [&str; 5] = ["controller", "--cell", "c1", "--pace", "max"];

fn status(bench: &Bench) -> Option<Value> {
    let output = bench.run(&["status", "--cell", "c1", "--json"]);
    serde_json::from_slice(&output.stdout).ok().filter(|status: &Value| status["tick"].is_u64())
}

fn controller(bench: &Bench) -> Running {
    let controller = bench.start(&MAX);
    eventually("a controller", || status(bench));
    controller
}

#[test]
fn a_rollback_keeps_the_pin_is_counted_and_says_who_waits() {
    let bench = Bench::new();
    let policy = |arguments: &[&str]| {
        let arguments = [&["policy"], arguments, &["--cell", "c1"]].concat();
        eventually("its turn", || {
            let output = bench.run(&arguments);
            output.status.success().then(|| String::from_utf8(output.stdout).unwrap())
        })
    };
    let first = controller(&bench);
    for amplitude in [0.02, 0.04] {
        let text = policy_json::to_json(&rocking(amplitude)).unwrap();
        policy(&["import", bench.write("policy.json", &text).to_str().unwrap()]);
    }
    policy(&["activate", "1"]);
    policy(&["activate", "2"]);
    policy(&["pin"]);
    let config = bench.write("c.toml", "[learner]\nrollouts = 3\n");
    let learner = ["learner", "--cell", "c1", "--session", "s", "--config"];
    let learner = bench.start(&[&learner[..], &[config.to_str().unwrap()]].concat());
    let said = policy(&["rollback"]);
    assert!(said.contains("policy 1 applied") && said.contains("policy unpin --cell c1"), "{said}");
    let waits = "learner waits: policy 1 is pinned; run `skillet policy unpin --cell c1`";
    let status_now = eventually("the note", || {
        status(&bench).filter(|status| status["notes"].to_string().contains(waits))
    });
    assert_eq!((&status_now["rollbacks"], &status_now["pinned"]), (&1.into(), &true.into()));
    assert_eq!(status_now["pin_restored"], false);
    let text = bench.ok(&["status", "--cell", "c1"]);
    assert!(text.contains(waits) && text.contains("rolled back once"), "{text}");
    let watched = bench.ok(&["watch", "--cell", "c1", "--json", "--duration-s", "2"]);
    assert!(watched.contains(waits), "{watched}");

    // At the next start nobody has said anything yet.
    first.signal("KILL");
    first.wait();
    let second = controller(&bench);
    let restored = status(&bench).unwrap();
    assert_eq!(restored["pin_restored"], true);
    assert!(restored["notes"].to_string().contains("pinned by an earlier run"), "{restored:#}");
    policy(&["unpin"]);
    let output = learner.wait();
    assert_eq!(output.status.code(), Some(0), "{}", util::stderr(&output));
    let notes = &status(&bench).unwrap()["notes"];
    assert_eq!(notes, &serde_json::json!([]));
    second.signal("TERM");
    let log = util::stderr(&second.wait());
    assert!(log.contains("WARN policy 1 was pinned by an earlier run"), "{log}");
}
