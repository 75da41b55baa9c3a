//! What a failed transport advises fits what is missing.

mod util;

use std::process::{Command, Output};

use shm_types::cell::Cell;
use shm_types::ports::{ObserverPorts, ToolPorts};
use util::{Bench, Running, eventually, stderr};

fn controller(bench: &Bench) -> (Running, Cell) {
    let controller = bench.start(&["controller", "--cell", "c1", "--pace", "max"]);
    eventually("a controller", || {
        bench.run(&["status", "--cell", "c1"]).status.success().then_some(())
    });
    (controller, Cell::in_dir(&bench.path("run"), "c1").unwrap())
}

/// Everything that fits is in use, by as many members of the cell.
#[test]
fn too_many_clients_and_observers_are_called_that() {
    let bench = Bench::new();
    let (_controller, cell) = controller(&bench);
    let join = || eventually("a place", || ObserverPorts::open(&cell, util::WATCHDOG).ok());
    let observers: Vec<ObserverPorts> = (0..8).map(|_| join()).collect();
    let words = ["end one", "skillet watch"];
    for arguments in [&["watch", "--cell", "c1", "--json"][..], &["record", "--cell", "c1"]] {
        let said = refusal(&bench.run(arguments));
        assert!(words.iter().all(|word| said.contains(word)), "{said}");
    }
    drop(observers);
    let clients: Vec<ToolPorts> =
        (0..16).map_while(|_| ToolPorts::open(&cell, util::WATCHDOG).ok()).collect();
    assert!(clients.len() >= 8, "{}", clients.len());
    let said = refusal(&bench.run(&["hold", "--cell", "c1"]));
    assert!(words.iter().all(|word| said.contains(word)), "{said}");
    drop(clients);
    bench.ok(&["status", "--cell", "c1"]);
}

#[test]
fn too_few_open_files_are_called_that() {
    let bench = Bench::new();
    let (_controller, _) = controller(&bench);
    bench.ok(&["learn", "pancake", "--rollouts", "1", "--out", "s"]);
    let mut refused = 0;
    for arguments in
        ["status --cell c1", "watch --cell c1 --json --duration-s 0.1", "hold --cell c1"]
    {
        for files in 6..40 {
            let skillet = env!("CARGO_BIN_EXE_skillet");
            let mut command = Command::new("bash");
            command
                .args(["-c", &format!("ulimit -n {files}; exec {skillet} {arguments}")])
                .current_dir(bench.path("."))
                .env("SKILLET_RUNTIME_DIR", bench.path("run"))
                .env("SKILLET_STATE_DIR", bench.path("state"));
            let output = command.output().unwrap();
            if output.status.success() {
                break;
            }
            let said = stderr(&output);
            // Before it is a program of ours, the loader wants files, too.
            if said.contains("shared libraries") {
                continue;
            }
            let said = refusal(&output);
            assert!(said.contains("ulimit -n"), "{files} files: {said}");
            refused += 1;
        }
    }
    assert!(refused >= 6, "only {refused} refusals");
}

/// The message of an error, which blames nothing that is well.
fn refusal(output: &Output) -> String {
    // With `--json` it is on standard output.
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), stderr(output));
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(!said.contains("/dev/shm") && !said.contains("same build"), "{said}");
    assert!(!said.contains("panicked"), "{said}");
    said
}
