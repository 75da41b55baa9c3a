//! The reader of a log may be gone, be stuck or be a full disk: this neither ends nor blocks a process.

mod util;

use std::fs::OpenOptions;
use std::io::{PipeReader, PipeWriter, Write, pipe};
use std::process::{Command, Stdio};

use rustix::fs::{OFlags, fcntl_setfl};
use serde_json::Value;
use shm_types::cell::Cell;
use util::{Bench, Running, eventually, is_alive, kill};

const CONTROLLER: [&str; 5] = ["controller", "--cell", "c1", "--pace", "max"];

/// Takes no byte more: its reader stands still.
fn full_pipe() -> (PipeReader, PipeWriter) {
    let (reader, mut writer) = pipe().unwrap();
    fcntl_setfl(&writer, OFlags::NONBLOCK).unwrap();
    for chunk in [&[b'.'; 4096][..], b"."] {
        while writer.write(chunk).is_ok() {}
    }
    fcntl_setfl(&writer, OFlags::empty()).unwrap();
    (reader, writer)
}

/// Every place that takes no text, and what must live as long as it shall be that.
fn bad_places() -> Vec<(&'static str, Stdio, Option<PipeReader>)> {
    let (reader, stalled) = full_pipe();
    let (_, closed) = pipe().unwrap();
    let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
    vec![
        ("its reader stands still", stalled.into(), Some(reader)),
        ("its reader has gone", closed.into(), None),
        ("its disk is full", full.into(), None),
    ]
}

fn status(bench: &Bench) -> Option<Value> {
    let output = bench.run(&["status", "--cell", "c1", "--json"]);
    serde_json::from_slice(&output.stdout).ok().filter(|status: &Value| status["tick"].is_u64())
}

/// Everything that an operator may want of a controller, each with a line in its log.
fn expect_service(bench: &Bench) {
    eventually("a controller", || status(bench));
    bench.ok(&["hold", "--cell", "c1"]);
    eventually("the hold", || status(bench).filter(|s| !s["latched_fault"].is_null()));
    eventually("a re-arm", || bench.run(&["rearm", "--cell", "c1"]).status.success().then_some(()));
    bench.refused(&["policy", "activate", "9", "--cell", "c1"], &["policy 9"]);
}

fn traces(bench: &Bench) -> usize {
    Cell::in_dir(&bench.path("run"), "c1").unwrap().traces().len()
}

#[test]
fn a_controller_whose_log_goes_nowhere_answers_and_ends_cleanly() {
    for (why, place, _reader) in bad_places() {
        let bench = Bench::new();
        let mut command = bench.skillet(&CONTROLLER);
        let controller = Running::start(command.stdout(Stdio::null()).stderr(place));
        drop(command);
        expect_service(&bench);
        controller.signal("TERM");
        assert_eq!(controller.wait().status.code(), Some(0), "{why}");
        assert_eq!(traces(&bench), 0, "{why}");
    }
}

/// It gets a SIGHUP, and whatever it writes from then on is an error.
#[test]
fn a_controller_outlives_its_terminal() {
    let bench = Bench::new();
    let skillet = bench.skillet(&CONTROLLER);
    let line: Vec<_> = std::iter::once(skillet.get_program())
        .chain(skillet.get_args())
        .map(|word| word.to_str().unwrap())
        .collect();
    let mut terminal = Command::new("script");
    terminal.args(["--quiet", "--command", &format!("exec {}", line.join(" ")), "/dev/null"]);
    for (name, value) in skillet.get_envs() {
        match value {
            Some(value) => terminal.env(name, value),
            None => terminal.env_remove(name),
        };
    }
    let terminal = Running::start(terminal.stdin(Stdio::null()).stdout(Stdio::null()));
    let controller = terminal.child("controller");
    eventually("a controller", || status(&bench));
    terminal.signal("KILL");
    terminal.wait();
    expect_service(&bench);
    kill(controller, "TERM");
    eventually("its end", || (!is_alive(controller)).then_some(()));
    assert_eq!(traces(&bench), 0);
}

/// Its log and its progress: the two ways in which it speaks.
#[test]
fn a_learner_that_nobody_hears_learns() {
    let bench = Bench::new();
    let _controller = bench.start(&CONTROLLER);
    let config = bench.write("c.toml", "[learner]\nrollouts = 12\n");
    for json in [false, true] {
        for (i, (why, place, _reader)) in bad_places().into_iter().enumerate() {
            let session = format!("s{i}-{json}");
            let arguments = ["learner", "--cell", "c1", "--session", &session, "--config"];
            let more = [config.to_str().unwrap(), "--json"];
            let more = if json { &more[..] } else { &more[..1] };
            let mut command = bench.skillet(&[&arguments[..], more].concat());
            let (log, out) = match json {
                true => (Stdio::null(), place),
                false => (place, Stdio::null()),
            };
            let learner = Running::start(command.stdout(out).stderr(log));
            drop(command);
            assert_eq!(learner.wait().status.code(), Some(0), "{why}, {json}");
            assert_eq!(bench.trials(&session).len(), 12, "{why}, {json}");
        }
    }
}

#[test]
fn learn_ends_well_without_anybody_who_sees_its_progress() {
    for (why, place, _reader) in bad_places() {
        let bench = Bench::new();
        let arguments = ["learn", "pancake", "--rollouts", "20", "--json", "--out", "s"];
        let mut command = bench.skillet(&arguments);
        let learn = Running::start(command.stdout(Stdio::piped()).stderr(place));
        drop(command);
        let output = learn.wait();
        assert_eq!(output.status.code(), Some(0), "{why}");
        let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(summary["trials"], 20, "{why}");
    }
}

/// An error is said where it can be, and the exit code says it in any case.
#[test]
fn a_command_that_cannot_say_its_error_has_its_exit_code() {
    for (why, place, _reader) in bad_places() {
        let bench = Bench::new();
        let mut command = bench.skillet(&["report", "nowhere"]);
        let failed = Running::start(command.stdout(Stdio::null()).stderr(place));
        drop(command);
        assert_eq!(failed.wait().status.code(), Some(2), "{why}");
    }
}

/// `skillet watch --json | head -1`.
#[test]
fn results_that_nobody_reads_any_more_end_the_command() {
    let bench = Bench::new();
    let _controller = bench.start(&CONTROLLER);
    eventually("a controller", || status(&bench));
    let (reader, out) = pipe().unwrap();
    let mut command = bench.skillet(&["watch", "--json", "--cell", "c1"]);
    let watch = Running::start(command.stdout(out).stderr(Stdio::piped()));
    drop((command, reader));
    let output = watch.wait();
    assert_eq!((output.status.code(), util::stderr(&output).as_str()), (Some(0), ""));
}
