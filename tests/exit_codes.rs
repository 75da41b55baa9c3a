//! One table of exit codes for every command, and errors as JSON where a command prints JSON.
//!
//! A new command needs a row here: which of its uses end with which code.

mod util;

use std::collections::BTreeSet;

use serde_json::Value;
use util::{Bench, Running, eventually};

const DONE: i32 = 0;
const NEGATIVE: i32 = 1;
const ERROR: i32 = 2;
const NO_CONTROLLER: i32 = 3;

/// A command, and uses of it with the code of each. `s` is a session with one mode, the cell `c1` has a
/// controller, the cell `none` has not.
type Row = (&'static str, &'static [(i32, &'static str)]);

const ROWS: [Row; 63] = [
    ("learn", &[(DONE, "pancake --rollouts 2 --out l"), (ERROR, "pancake --config absent.toml")]),
    ("controller", &[(ERROR, "--cell c1"), (ERROR, "--cell UP"), (ERROR, "--config absent.toml")]),
    ("learner", &[(DONE, "--cell c1 --session s"), (ERROR, "--session l2 --config absent.toml")]),
    ("status", &[(DONE, "--cell c1"), (NO_CONTROLLER, "--cell none"), (ERROR, "--cell UP")]),
    ("hold", &[(DONE, "--cell c1"), (NO_CONTROLLER, "--cell none"), (ERROR, "--cell UP")]),
    // After the hold above.
    ("rearm", &[(DONE, "--cell c1"), (NO_CONTROLLER, "--cell none"), (ERROR, "--cell UP")]),
    (
        "posture",
        &[
            (DONE, "--joint 1 --by -0.2 --in 2 --cell c1"),
            (DONE, "--offset 0,0,0.2 --cell c1"),
            (DONE, "--reset --cell c1"),
            (ERROR, "--joint 3 --by 99 --cell c1"),
            (ERROR, "--joint 3 --cell c1"),
            (NO_CONTROLLER, "--reset --cell none"),
        ],
    ),
    ("policy list", &[(DONE, "s"), (DONE, "--cell none"), (ERROR, "nowhere")]),
    ("policy show", &[(DONE, "s 1"), (ERROR, "s 999"), (ERROR, "nowhere 1")]),
    ("policy modes", &[(DONE, "s"), (ERROR, "nowhere")]),
    (
        "policy forbid",
        &[
            (ERROR, "s 1"),
            (ERROR, "s 9"),
            (ERROR, "99 --cell c1"),
            (NO_CONTROLLER, "1 --cell none"),
        ],
    ),
    (
        "policy allow",
        &[(DONE, "s 1"), (ERROR, "s 9"), (ERROR, "99 --cell c1"), (NO_CONTROLLER, "1 --cell none")],
    ),
    ("policy export", &[(DONE, "s"), (ERROR, "1 --cell none")]),
    (
        "policy import",
        &[(DONE, "s --cell c1"), (ERROR, "absent --cell c1"), (NO_CONTROLLER, "s --cell none")],
    ),
    // What the line above imported.
    (
        "policy activate",
        &[(DONE, "1 --cell c1"), (ERROR, "99 --cell c1"), (NO_CONTROLLER, "1 --cell none")],
    ),
    ("policy pin", &[(DONE, "--cell c1"), (NO_CONTROLLER, "--cell none"), (ERROR, "--cell UP")]),
    ("policy unpin", &[(DONE, "--cell c1"), (NO_CONTROLLER, "--cell none"), (ERROR, "--cell UP")]),
    ("policy rollback", &[(NO_CONTROLLER, "--cell none"), (ERROR, "--cell UP")]),
    (
        "watch",
        &[
            (DONE, "--cell c1 --json --duration-s 0.1"),
            (NO_CONTROLLER, "--cell none"),
            (ERROR, "--cell c1"),
        ],
    ),
    (
        "record",
        &[
            (DONE, "--cell c1 --duration-s 0.1"),
            (NO_CONTROLLER, "--cell none"),
            (ERROR, "--cell c1 --out recording.bag"),
        ],
    ),
    ("replay", &[(DONE, "s"), (DONE, "s --all"), (ERROR, "nowhere"), (ERROR, "s --trial 99")]),
    (
        "convert",
        &[
            (DONE, "s --ros2"),
            // The bag of the line above is in the way.
            (ERROR, "s --ros2"),
            (DONE, "s --ros2 --force"),
            (ERROR, "s"),
            (ERROR, "nowhere --ros2"),
            (ERROR, "s --ros2 --trial 99 -o bag"),
            (ERROR, "s/session.toml --ros2"),
        ],
    ),
    (
        "arm check",
        &[
            (DONE, "wam.urdf"),
            (NEGATIVE, "massless.urdf"),
            (ERROR, "absent.urdf"),
            (ERROR, "s/session.toml"),
        ],
    ),
    ("plant serve", &[(ERROR, "--cell UP"), (ERROR, "--config absent.toml")]),
    (
        "plant check",
        &[
            // The process that serves the cell is in the way.
            (ERROR, "--cell c1"),
            (ERROR, "--cell none --program false"),
            (ERROR, "--config absent.toml"),
        ],
    ),
    (
        "demo convert",
        &[
            (DONE, "s/demonstration.csv --out d.csv"),
            (NEGATIVE, "far.csv --out far-demo.csv"),
            (ERROR, "absent.csv --out e.csv"),
        ],
    ),
    (
        "demo add",
        &[
            (DONE, "s s/demonstration.csv"),
            (ERROR, "s far.csv"),
            (ERROR, "s absent.csv"),
            (ERROR, "nowhere s/demonstration.csv"),
        ],
    ),
    (
        "rate",
        &[
            // Ratings do not count there.
            (ERROR, "s 7"),
            (ERROR, "s 11"),
            (ERROR, "s"),
            (ERROR, "nowhere --better"),
        ],
    ),
    (
        "judge",
        &[
            (DONE, "s --config s/session.toml"),
            (ERROR, "s"),
            (ERROR, "nowhere --config s/session.toml"),
            (ERROR, "s --config absent.toml"),
        ],
    ),
    ("task list", &[(DONE, "")]),
    (
        "task serve",
        &[(DONE, "pancake"), (ERROR, "nothing"), (ERROR, "pancake --config absent.toml")],
    ),
    ("session list", &[(DONE, ""), (DONE, "l"), (ERROR, "file")]),
    ("session show", &[(DONE, "s"), (ERROR, "nowhere")]),
    // Up and down with processes: tests/cell_up.rs.
    ("cell up", &[(ERROR, "UP"), (ERROR, "c9 --config absent.toml"), (ERROR, "c9 --task nothing")]),
    ("cell down", &[(DONE, "none"), (ERROR, "UP")]),
    ("cell list", &[(DONE, "")]),
    ("trials", &[(DONE, "s"), (ERROR, "nowhere")]),
    ("report", &[(DONE, "s"), (ERROR, "nowhere")]),
    ("study", &[(DONE, ""), (ERROR, "nothing")]),
    ("doctor", &[]),
    ("bench tick", &[(DONE, "--seconds 0.05 --rounds 1"), (ERROR, "--seconds many")]),
    ("bench sim", &[(ERROR, "--seconds many")]),
    ("bench transport", &[(ERROR, "--seconds many")]),
    ("bench latency", &[(ERROR, "--seconds many")]),
    ("bench learner", &[(ERROR, "--seconds many")]),
    ("bench swap", &[(ERROR, "--swaps many")]),
    (
        "soak",
        &[
            (ERROR, "--minutes 0"),
            (ERROR, "--minutes 1 --out file/below"),
            // Without the feature `bridge`, and with it.
            (ERROR, "--hosts 3 --cells 1"),
            (ERROR, "--hosts 3 --loss 2"),
        ],
    ),
    // With the feature `bridge` and without it.
    ("bridge serve", &[(ERROR, "--listen 0.0.0.0:7447 --allow kitchen")]),
    ("bridge join", &[(ERROR, "--connect nowhere --cell c9")]),
    ("bridge keys", &[(ERROR, "--out keys --learner oven --cells UP")]),
    ("bridge ros2", &[(ERROR, "--listen 0.0.0.0:7447 --cell c1"), (ERROR, "--cell UP")]),
    (
        "config",
        &[
            (DONE, ""),
            (DONE, "landscape"),
            (DONE, "--schema"),
            (DONE, "--check file"),
            (NEGATIVE, "--check massless.urdf"),
            (ERROR, "--config absent.toml"),
            (ERROR, "--check absent.toml"),
            (ERROR, "nothing"),
        ],
    ),
    ("completions", &[(DONE, "bash"), (ERROR, "tcsh")]),
    ("man", &[(DONE, "--out man"), (ERROR, "--out file/below")]),
    // No commands of their own, but pages of the manual.
    ("session", &[(ERROR, "")]),
    ("cell", &[(ERROR, "")]),
    ("policy", &[(ERROR, "")]),
    ("arm", &[(ERROR, "")]),
    ("demo", &[(ERROR, "")]),
    ("task", &[(ERROR, "")]),
    ("plant", &[(ERROR, "")]),
    ("bench", &[(ERROR, "")]),
    ("bridge", &[(ERROR, "")]),
];

/// Every command there is, from the manual: one page each.
fn commands(bench: &Bench) -> BTreeSet<String> {
    bench.ok(&["man", "--out", "man"]);
    let pages = std::fs::read_dir(bench.path("man")).unwrap().flatten();
    let names = pages.map(|page| page.file_name().to_string_lossy().into_owned());
    let names = names
        .filter_map(|name| name.strip_suffix(".1")?.strip_prefix("skillet-").map(str::to_string));
    names.map(|name| name.replace('-', " ")).collect()
}

fn words<'a>(command: &'a str, rest: &'a str) -> Vec<&'a str> {
    command.split(' ').chain(rest.split_whitespace()).collect()
}

fn setting() -> (Bench, Running) {
    let bench = Bench::new();
    bench.ok(&["learn", "pancake", "--rollouts", "3", "--out", "s"]);
    bench.write("file", "");
    bench.write("wam.urdf", include_str!("../robots/wam7/wam7_pan.urdf"));
    bench.write("massless.urdf", "<robot name=\"r\"><link name=\"base\"/></robot>");
    // At rest, and then out of reach.
    let row = |i: usize| {
        let x = 0.78 + 0.02 * (i.saturating_sub(20)) as f64;
        format!("{:.2},{x},0.0,0.72,0.0\n", i as f64 * 0.01)
    };
    let rows: String = (0..100).map(row).collect();
    bench.write("far.csv", &format!("t_s,x_m,y_m,z_m,pitch_rad\n{rows}"));
    let controller = bench.start(&["controller", "--cell", "c1", "--pace", "max"]);
    eventually("a controller", || {
        bench.run(&["status", "--cell", "c1"]).status.success().then_some(())
    });
    (bench, controller)
}

#[test]
fn every_command_ends_with_the_codes_of_the_table() {
    let (bench, _controller) = setting();
    let in_table: BTreeSet<String> = ROWS.iter().map(|(command, _)| command.to_string()).collect();
    assert_eq!(commands(&bench), in_table, "every command has a row in this test");
    for (command, uses) in ROWS {
        let help = bench.ok(&words(command, "--help"));
        let has_json = help.contains("--json");
        let unknown = [(ERROR, "--no-such-flag")];
        for (code, rest) in uses.iter().chain(&unknown) {
            let arguments = words(command, rest);
            let output = bench.run(&arguments);
            let said = util::stderr(&output);
            assert_eq!(output.status.code(), Some(*code), "{arguments:?}: {said}");
            assert!(!said.contains("panicked"), "{arguments:?}: {said}");
            if has_json && *code >= ERROR {
                as_json(&bench, &arguments, *code);
            }
        }
    }
}

/// The same failure with `--json`: an object, and nothing else on standard output.
fn as_json(bench: &Bench, arguments: &[&str], code: i32) {
    // With it `watch` needs no terminal, and does not end.
    if arguments == ["watch", "--cell", "c1"] {
        return;
    }
    let output = bench.run(&[arguments, &["--json"]].concat());
    assert_eq!(output.status.code(), Some(code), "{arguments:?} --json");
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    let told: Value = serde_json::from_str(&text)
        .unwrap_or_else(|error| panic!("{arguments:?} --json said '{text}': {error}"));
    assert_eq!(told["error"]["exit_code"], code, "{arguments:?}: {told}");
    let message = told["error"]["message"].as_str().unwrap();
    assert!(message.len() > 10 && told["error"]["causes"].is_array(), "{arguments:?}: {told}");
    if arguments[0] != "learner" {
        assert_eq!(util::stderr(&output), "", "{arguments:?}");
    }
}

#[test]
fn the_page_and_the_help_have_the_same_table() {
    let help = Bench::new().ok(&["--help"]);
    let table = help.split("Exit codes of every command:\n").nth(1).unwrap();
    let rows: Vec<(&str, &str)> =
        table.lines().map_while(|line| line.trim().split_once("  ")).collect();
    assert_eq!(rows.len(), 4, "{help}");
    let page = include_str!("../docs/exit-codes.md");
    for (code, meaning) in rows {
        let row = format!("| {code} | {meaning} |");
        assert!(page.contains(&row), "docs/exit-codes.md has no row `{row}`");
    }
}
