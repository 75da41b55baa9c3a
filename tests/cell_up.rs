//! `skillet cell up | down | list`: services in the background, their logs, their end.

mod util;

use std::fs;
use std::process::{Command, Stdio};

use serde_json::Value;
use util::{Bench, WATCHDOG, eventually, is_alive, kill};

/// A bench whose cells end with it: their services are no children of the test.
struct Cells(Bench);

impl Cells {
    fn new() -> Cells {
        Cells(Bench::new())
    }

    fn json(&self, arguments: &[&str]) -> Value {
        serde_json::from_str(&self.0.ok(&[arguments, &["--json"]].concat())).unwrap()
    }

    fn listed(&self) -> Vec<Value> {
        self.json(&["cell", "list"])["cells"].as_array().unwrap().clone()
    }
}

impl Drop for Cells {
    fn drop(&mut self) {
        for cell in fs::read_dir(self.0.path("run")).into_iter().flatten().flatten() {
            self.0.run(&["cell", "down", cell.file_name().to_str().unwrap()]);
        }
    }
}

fn pid(value: &Value) -> u32 {
    value.as_u64().unwrap_or_else(|| panic!("no process: {value}")) as u32
}

/// The session of a process, as `setsid` numbers it.
fn terminal_session(pid: u32) -> u32 {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap();
    let fields: Vec<&str> = stat.rsplit_once(')').unwrap().1.split_whitespace().collect();
    fields[3].parse().unwrap()
}

#[test]
fn a_cell_comes_up_outlives_its_shell_and_goes_down() {
    let cells = Cells::new();
    let bench = &cells.0;
    // A shell that is killed with everything in its process group.
    let mut shell = Command::new("setsid");
    let up = bench.skillet(&["cell", "up", "kitchen", "--pace", "max", "--json"]);
    shell.arg(up.get_program()).args(up.get_args()).current_dir(bench.path("."));
    shell.envs(up.get_envs().filter_map(|(key, value)| Some((key, value?))));
    let output = shell.stdin(Stdio::null()).output().unwrap();
    assert!(output.status.success(), "{}", util::stderr(&output));
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(
        (&told["controller_started"], &told["learner_started"]),
        (&true.into(), &true.into())
    );
    let (controller, learner) = (pid(&told["controller_pid"]), pid(&told["learner_pid"]));
    for process in [controller, learner] {
        assert!(util::is_skillet(process));
        assert_eq!(terminal_session(process), process, "it has left the terminal");
    }
    bench.wait_for_trials("sessions/kitchen", 2);
    for (role, words) in [("controller", "controller ready"), ("learner", "learner ready")] {
        let log = told[format!("{role}_log")].as_str().unwrap();
        assert!(util::text(log.as_ref()).contains(words), "{role}");
        assert!(log.starts_with(bench.path("state").to_str().unwrap()), "{log}");
    }

    let [row] = &cells.listed()[..] else { panic!("one cell") };
    assert_eq!(row["cell"], "kitchen");
    assert_eq!((&row["controller"], &row["learner"]), (&"running".into(), &"running".into()));
    assert_eq!((pid(&row["controller_pid"]), pid(&row["learner_pid"])), (controller, learner));
    assert!(row["session"].as_str().unwrap().ends_with("sessions/kitchen"));
    assert!(row["controller_uptime_s"].as_f64().unwrap() < WATCHDOG.as_secs_f64());

    // Again: nothing happens, and it says so.
    let again = cells.json(&["cell", "up", "kitchen"]);
    assert_eq!(again["controller_started"], false);
    assert_eq!((pid(&again["controller_pid"]), pid(&again["learner_pid"])), (controller, learner));
    bench.refused(
        &["cell", "up", "kitchen", "--session", "other"],
        &["already works on", "cell down"],
    );

    let down = bench.ok(&["cell", "down", "kitchen"]);
    assert!(down.contains(&format!("controller  stopped, process {controller}")), "{down}");
    assert!(down.contains("sessions/kitchen"), "{down}");
    assert!(!is_alive(controller) && !is_alive(learner));
    for role in ["controller", "learner"] {
        let log = util::text(&bench.path(&format!("state/kitchen/log/{role}.log")));
        assert!(log.contains(&format!("{role} ended cleanly")), "{log}");
    }
    assert!(cells.listed().is_empty(), "nothing is left");
    assert!(bench.ok(&["cell", "down", "kitchen"]).contains("nothing runs in cell 'kitchen'"));
    assert!(fs::read_dir(bench.path("run")).unwrap().next().is_none(), "no socket is left");
}

#[test]
fn a_start_that_fails_shows_its_log_and_leaves_nothing_running() {
    let cells = Cells::new();
    let bench = &cells.0;
    // What the controller refuses, after everything was checked.
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    bench.write("c.toml", &format!("[metrics]\nlisten = \"{address}\"\n"));
    let up = ["cell", "up", "kitchen", "--config", "c.toml", "--pace", "max"];
    bench.refused(&up, &["the controller ended with exit code 2", "controller.log:", &address]);
    assert!(cells.listed().is_empty());
    // What is wrong with the input is said at once.
    bench.refused(&["cell", "up", "kitchen", "--config", "absent.toml"], &["absent.toml"]);
    bench.refused(&["cell", "up", "UP"], &["cell name"]);

    // The learner fails: the controller is stopped again.
    bench.ok(&["learn", "pancake", "--rollouts", "2", "--out", "s"]);
    fs::write(bench.path("s/session.db"), "no database").unwrap();
    fs::remove_file(bench.path("s/session.copy.db")).unwrap();
    let up = ["cell", "up", "kitchen", "--session", "s", "--pace", "max"];
    bench.refused(
        &up,
        &["the learner ended with exit code 2", "learner.log:", "not a Skillet session"],
    );
    assert!(cells.listed().is_empty());
}

#[test]
fn the_parts_of_a_cell_are_started_and_stopped_as_they_are_needed() {
    let cells = Cells::new();
    let bench = &cells.0;
    let up = ["cell", "up", "c1", "--pace", "max", "--task", "archery"];
    let first = cells.json(&[&up[..], &["--no-learner"]].concat());
    assert_eq!((&first["learner_started"], &first["session"]), (&false.into(), &Value::Null));
    let controller = pid(&first["controller_pid"]);
    let second = cells.json(&[&up[..], &["--session", "s"]].concat());
    assert_eq!(
        (pid(&second["controller_pid"]), &second["learner_started"]),
        (controller, &true.into())
    );
    bench.refused(
        &["cell", "up", "c2", "--task", "pancake", "--session", "s"],
        &["archery", "--session"],
    );
    // It ends when its session is complete; then there is nothing to start.
    eventually("the end of the session", || {
        cells.listed().first().filter(|row| row["learner"] == "absent").map(|_| ())
    });
    let text = bench.ok(&[&up[..], &["--session", "s"]].concat());
    assert!(text.contains("not started: the session has all its"), "{text}");

    // A stopped process is woken up to end.
    kill(controller, "STOP");
    bench.ok(&["cell", "down", "c1"]);
    assert!(!is_alive(controller));
    // What a killed one leaves stands for no process.
    let third = cells.json(&[&up[..], &["--no-learner"]].concat());
    kill(pid(&third["controller_pid"]), "KILL");
    eventually("its end", || (!is_alive(pid(&third["controller_pid"]))).then_some(()));
    let [row] = &cells.listed()[..] else { panic!("its folder") };
    assert_eq!((&row["controller"], &row["controller_pid"]), (&"absent".into(), &Value::Null));
    assert!(bench.ok(&["cell", "down", "c1"]).contains("nothing runs"));
    assert!(cells.listed().is_empty());
}

/// One learner for two cells ends with the last of them.
#[test]
fn a_learner_of_several_cells_is_left_to_the_others() {
    let cells = Cells::new();
    let bench = &cells.0;
    for cell in ["left", "right"] {
        bench.ok(&["cell", "up", cell, "--no-learner", "--pace", "max"]);
    }
    let config = bench.write("c.toml", "[learner]\nrollouts = 5000\n");
    let both = ["learner", "--cell", "left", "--cell", "right", "--session", "both", "--config"];
    let mut learner = bench.start(&[&both[..], &[config.to_str().unwrap()]].concat());
    bench.wait_for_trials("both", 2);
    let down = cells.json(&["cell", "down", "left"]);
    assert_eq!(down["learner_left_for"], serde_json::json!(["right"]));
    assert!(!learner.has_ended());
    cells.json(&["cell", "down", "right"]);
    assert_eq!(learner.wait().status.code(), Some(1), "stopped before its end");
}
