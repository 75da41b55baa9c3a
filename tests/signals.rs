//! How a command is asked to end: signals within a moment are one request, as is the end of its terminal.

mod util;

use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::Value;
use shm_types::cell::Cell;
use util::{Bench, Running, eventually, kill};

/// As `timeout` does it, and worse.
fn ask_at_once(process: &Running) {
    let script = "for i in 1 2 3 4 5; do kill -TERM $0 2>/dev/null; sleep 0.01; done";
    Command::new("sh").args(["-c", script, &process.pid().to_string()]).status().unwrap();
}

fn is_there(bench: &Bench) {
    eventually("a controller", || {
        bench.run(&["status", "--cell", "c1"]).status.success().then_some(())
    });
}

fn traces(bench: &Bench) -> Vec<std::path::PathBuf> {
    Cell::in_dir(&bench.path("run"), "c1").unwrap().traces()
}

#[test]
fn services_take_signals_within_a_moment_as_one_request() {
    let bench = Bench::new();
    let config = bench.write("c.toml", "[learner]\nrollouts = 100000\n");
    let learner = ["learner", "--cell", "c1", "--session", "s", "--config"];
    for (n, pace) in ["max", "realtime"].into_iter().enumerate() {
        let controller = bench.start(&["controller", "--cell", "c1", "--pace", pace]);
        is_there(&bench);
        let before = if n == 0 { 0 } else { bench.trials("s").len() };
        let learner = bench.start(&[&learner[..], &[config.to_str().unwrap()]].concat());
        bench.wait_for_trials("s", before + 1);
        for (service, code) in [(learner, 1), (controller, 0)] {
            ask_at_once(&service);
            let output = service.wait();
            assert_eq!(output.status.code(), Some(code), "{}", util::stderr(&output));
            assert!(util::stderr(&output).contains("ended "), "{}", util::stderr(&output));
        }
        assert_eq!(traces(&bench), Vec::<std::path::PathBuf>::new());
    }
}

#[test]
fn learn_ends_as_a_whole_by_signals_or_with_its_terminal() {
    let bench = Bench::new();
    let learn = ["learn", "pancake", "--rollouts", "100000", "--out", "s"];
    for (n, signal) in ["TERM", "HUP"].into_iter().enumerate() {
        let learn = bench.start(&learn);
        bench.wait_for_trials("s", 3 * (n + 1));
        match signal {
            "TERM" => ask_at_once(&learn),
            _ => learn.signal_group(signal),
        }
        let output = learn.wait();
        assert_eq!(output.status.code(), Some(1), "{}", util::stderr(&output));
        let left: Vec<_> = std::fs::read_dir(bench.path("run")).unwrap().flatten().collect();
        assert!(left.is_empty(), "{left:?}");
    }
    let trials = bench.trials("s").len().to_string();
    bench.ok(&["learn", "pancake", "--rollouts", &trials, "--out", "s"]);
}

/// What `nohup` starts lives on without its terminal.
#[test]
fn a_hangup_that_is_ignored_ends_nothing() {
    let bench = Bench::new();
    let skillet = bench.skillet(&["learn", "pancake", "--rollouts", "30", "--json", "--out", "s"]);
    let mut command = Command::new("sh");
    command.args(["-c", "trap '' HUP; exec \"$0\" \"$@\""]).arg(skillet.get_program());
    command.args(skillet.get_args()).current_dir(bench.path("")).stdout(Stdio::piped());
    for (name, value) in skillet.get_envs() {
        command.envs(value.map(|value| (name, value)));
    }
    let learn = Running::start(&mut command);
    bench.wait_for_trials("s", 3);
    learn.signal_group("HUP");
    assert_eq!(learn.wait().status.code(), Some(0));
    assert_eq!(bench.trials("s").len(), 30);
}

#[test]
fn tools_finish_what_they_write() {
    let bench = Bench::new();
    let _controller = bench.start(&["controller", "--cell", "c1", "--pace", "realtime"]);
    is_there(&bench);
    let record = bench.start(&["record", "--cell", "c1", "--out", "r.mcap", "--json"]);
    let watch = bench.start(&["watch", "--cell", "c1", "--json"]);
    std::thread::sleep(Duration::from_millis(1500));
    for tool in [record, watch] {
        ask_at_once(&tool);
        let output = tool.wait();
        assert_eq!(output.status.code(), Some(0), "{}", util::stderr(&output));
        assert!(!output.stdout.is_empty());
    }
    assert!(bench.path("r.mcap").exists());

    let study = bench.start(&["study", "landscape", "--seeds", "100000", "--out", "study"]);
    eventually("a seed", || {
        let files = std::fs::read_dir(bench.path("study")).ok()?.flatten();
        files.map(|file| file.metadata().unwrap().len()).find(|len| *len > 0)
    });
    ask_at_once(&study);
    let output = study.wait();
    assert_eq!(output.status.code(), Some(1), "{}", util::stderr(&output));
    assert!(util::stderr(&output).contains("rerun the command to continue"));
}

#[test]
fn a_bench_leaves_nothing() {
    let bench = Bench::new();
    for name in ["transport", "swap"] {
        let mut command = bench.skillet(&["bench", name, "--seconds", "60"]);
        command.stdout(Stdio::null()).stderr(Stdio::piped());
        let process = Running::start(command.env("TMPDIR", bench.path("")));
        let cells = || std::fs::read_dir(bench.path("run")).into_iter().flatten().flatten();
        let name = eventually("its cell", || cells().next().map(|entry| entry.file_name()));
        let cell = Cell::in_dir(&bench.path("run"), name.to_str().unwrap()).unwrap();
        eventually("its shared memory", || (cell.traces().len() > 3).then_some(()));
        ask_at_once(&process);
        let output = process.wait();
        assert_eq!(output.status.code(), Some(1), "{}", util::stderr(&output));
        eventually("an empty cell", || cell.traces().is_empty().then_some(()));
    }
}

/// The signal does not reach its services, so they finish their sessions. A second signal, later, ends the soak without
/// waiting for them.
#[test]
fn a_soak_is_asked_once_or_twice() {
    let bench = Bench::new();
    let soak = ["soak", "--minutes", "5", "--rollouts", "12", "--json", "--out"];
    let wait = |out: &str| {
        let database = bench.path(out).join("both/session-0/session.db");
        eventually("a session", || database.exists().then_some(()));
    };
    let once = bench.start(&[&soak[..], &["o"]].concat());
    wait("o");
    once.signal_group("INT");
    once.signal_group("TERM");
    let output = once.wait();
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(1), "{summary:#}");
    assert_eq!((&summary["passed"], &summary["failures"]), (&true.into(), &serde_json::json!([])));

    let soak = ["soak", "--minutes", "5", "--rollouts", "500", "--out", "p"];
    let twice = bench.start(&soak);
    wait("p");
    kill(twice.pid(), "TERM");
    std::thread::sleep(Duration::from_millis(1300));
    kill(twice.pid(), "TERM");
    assert_eq!(twice.wait().status.code(), Some(130));
}
