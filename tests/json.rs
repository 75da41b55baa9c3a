//! docs/json.md describes what every command prints with --json: names, types and version.

mod util;

use std::collections::BTreeSet;
use std::io::Write;
use std::process::Stdio;
use std::thread::sleep;
use std::time::Duration;

use serde_json::{Value, json};
use util::fields::JsonPage;
use util::{Bench, eventually};

/// Sections whose objects are checked where their command is tested.
const ELSEWHERE: [&str; 2] = ["soak", "plant check"];
/// Parts of objects.
const SHARED: [&str; 4] = ["policy", "times", "mode", "host"];

/// A section, and a command whose output it describes. `s` is a session with modes, `c1` a cell with a controller.
const USES: [(&str, &str); 36] = [
    ("error", "report nowhere"),
    ("learn", "learn pancake --rollouts 3 --out l"),
    ("session list", "session list ."),
    ("session show", "session show s"),
    ("trials", "trials s"),
    ("policy list of a session", "policy list s"),
    ("policy show", "policy show s 1"),
    ("policy modes", "policy modes s"),
    ("policy forbid and policy allow of a session", "policy allow s 1"),
    ("judge", "judge s --config s/session.toml"),
    ("rate", "rate rated 7"),
    ("demo convert", "demo convert s/demonstration.csv --out d.csv"),
    ("demo add", "demo add s d.csv"),
    ("replay", "replay s"),
    ("replay --all", "replay s --all"),
    ("convert", "convert s --ros2"),
    ("report", "report s"),
    ("status", "status --cell c1"),
    ("cell list", "cell list"),
    ("policy import", "policy import s --cell c1"),
    ("policy activate and policy rollback", "policy activate 1 --cell c1"),
    ("policy pin, unpin, forbid and allow of a cell", "policy pin --cell c1"),
    ("policy list of a cell", "policy list --cell c1"),
    ("posture", "posture --reset --cell c1"),
    ("status", "status --cell c1"),
    ("cell list", "cell list"),
    ("record", "record --cell c1 --duration-s 0.2"),
    ("hold and rearm", "hold --cell c1"),
    ("hold and rearm", "rearm --cell c1"),
    ("task list", "task list"),
    ("arm check", "arm check wam.urdf"),
    ("study: the list", "study"),
    ("study", "study landscape --seeds 1"),
    ("bench", "bench tick --seconds 0.05 --rounds 1"),
    ("doctor", "doctor"),
    ("config", "config"),
];

fn parsed(text: &str, of: &str) -> Vec<Value> {
    let values = serde_json::Deserializer::from_str(text).into_iter();
    values.map(|value| value.unwrap_or_else(|error| panic!("{of}: {error}: {text}"))).collect()
}

/// Objects of commands that print several, or are called in another way.
fn others(bench: &Bench) -> Vec<(&'static str, Vec<Value>)> {
    let up = bench.ok(&["cell", "up", "c2", "--pace", "max", "--json"]);
    bench.wait_for_trials("sessions/c2", 3);
    let watch = bench.ok(&["watch", "--cell", "c2", "--json", "--duration-s", "1.5"]);
    let down = bench.ok(&["cell", "down", "c2", "--json"]);
    let config = bench.path("few.toml");
    let learner = ["learner", "--cell", "c1", "--session", "few", "--json", "--config"];
    bench.ok(&["policy", "unpin", "--cell", "c1"]);
    let learner = bench.ok(&[&learner[..], &[config.to_str().unwrap()]].concat());
    let mut serve = bench.skillet(&["task", "serve", "archery", "--json"]);
    let mut serve = serve.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut stdin = serve.stdin.take().unwrap();
    writeln!(stdin, "{}", json!({ "theta": [0.0, 0.0, 0.0], "path": true })).unwrap();
    drop(stdin);
    let served = String::from_utf8(serve.wait_with_output().unwrap().stdout).unwrap();
    let served = parsed(&served, "task serve");
    vec![
        ("cell up", parsed(&up, "cell up")),
        ("watch", parsed(&watch, "watch")),
        ("cell down", parsed(&down, "cell down")),
        ("learner", parsed(&learner, "learner")),
        ("task serve: the first line", served[..1].to_vec()),
        ("task serve: a rollout", served[1..].to_vec()),
    ]
}

fn stage() -> (Bench, util::Running) {
    let bench = Bench::new();
    bench.ok(&["learn", "pancake", "--seed", "7", "--rollouts", "25", "--out", "s"]);
    bench.write(
        "rated.toml",
        "[learner]\nrollouts = 3\n[learner.people]\nweight = 0.5\nwait = false\n",
    );
    let rated = ["learn", "pancake", "--config", "rated.toml", "--out", "rated"];
    bench.ok(&rated);
    bench.write("few.toml", "[learner]\nrollouts = 2\n");
    bench.write("wam.urdf", include_str!("../robots/wam7/wam7_pan.urdf"));
    let controller = bench.start(&["controller", "--cell", "c1", "--pace", "max"]);
    eventually("a controller", || {
        bench.run(&["status", "--cell", "c1"]).status.success().then_some(())
    });
    (bench, controller)
}

#[test]
fn every_command_prints_what_the_page_says() {
    let (bench, _controller) = stage();
    let page = JsonPage::read();
    let (mut faults, mut seen) = (Vec::new(), BTreeSet::new());
    for (section, command) in USES {
        let arguments: Vec<&str> = command.split(' ').chain(["--json"]).collect();
        if command.starts_with("rearm") {
            // Its cause must have been gone for 200 ticks.
            sleep(Duration::from_millis(1200));
        }
        let output = bench.run(&arguments);
        assert!(
            output.status.code() < Some(2) || section == "error",
            "{command}: {}",
            util::stderr(&output)
        );
        let objects = parsed(&String::from_utf8(output.stdout).unwrap(), command);
        assert_eq!(objects.len(), 1, "{command}");
        faults.extend(page.faults(section, &objects[0]));
        seen.insert(section);
    }
    for (section, objects) in others(&bench) {
        assert!(!objects.is_empty(), "{section}");
        faults.extend(objects.iter().flat_map(|object| page.faults(section, object)));
        seen.insert(section);
    }
    assert_eq!(faults, [""; 0], "{faults:#?}");
    seen.extend(ELSEWHERE.iter().chain(&SHARED));
    let described: BTreeSet<&str> = page.headings().collect();
    assert_eq!(seen, described, "every section has a command here");
}

#[test]
fn a_page_that_is_wrong_is_noticed() {
    let page = JsonPage::of(
        "### `a`\n\n| field | type | meaning |\n|---|---|---|\n| `x` | integer | |\n\
         | `b[]` | object | |\n| `b[].c` | text or null | |\n| `y` | map, optional | |\n",
    );
    let good = json!({ "schema": 1, "x": 1, "b": [{ "c": null }, { "c": "d" }] });
    assert_eq!(page.faults("a", &good), [""; 0]);
    for (wrong, what) in [
        (json!({ "x": 1, "b": [] }), "schema"),
        (json!({ "schema": 1, "b": [] }), "x is missing"),
        (json!({ "schema": 1, "x": 1.5, "b": [] }), "x is not integer"),
        (json!({ "schema": 1, "x": 1, "b": [{}] }), "b[].c is missing"),
        (json!({ "schema": 1, "x": 1, "b": [{ "c": 1 }] }), "b[].c is not text"),
        (json!({ "schema": 1, "x": 1, "b": [], "z": 1 }), "z is not documented"),
    ] {
        let faults = page.faults("a", &wrong);
        assert!(faults.len() == 1 && faults[0].contains(what), "{faults:?}");
    }
    let long = json!({ "schema": 1, "x": 1.4000000000000001 });
    let page = JsonPage::of("### `a`\n| `x` | number | |\n");
    assert!(page.faults("a", &long)[0].contains("artefact"));
}
