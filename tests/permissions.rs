//! What SECURITY.md promises: a cell, its state and its sessions are one user's alone.

mod util;

use std::fs;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use shm_types::cell::Cell;
use util::{Bench, eventually, stderr};

const NOBODY: &str = "65534";

/// What the cell has in shared memory.
fn shared_memory(bench: &Bench) -> Vec<PathBuf> {
    let traces = Cell::in_dir(&bench.path("run"), "c1").unwrap().traces().into_iter();
    traces.filter(|path| path.starts_with("/dev/shm")).collect()
}

fn walk(path: &Path, found: &mut Vec<PathBuf>) {
    found.push(path.to_path_buf());
    if path.is_dir() {
        fs::read_dir(path).unwrap().flatten().for_each(|entry| walk(&entry.path(), found));
    }
}

fn start(bench: &Bench) -> [util::Running; 2] {
    let controller = bench.start(&["controller", "--cell", "c1", "--pace", "max"]);
    // Longer than any of the tests.
    let config = bench.write("c.toml", "[learner]\nrollouts = 5000\n");
    let config = ["--config", config.to_str().unwrap()];
    let learner = ["learner", "--cell", "c1", "--session", "s"];
    let learner = bench.start(&[&learner[..], &config].concat());
    bench.wait_for_trials("s", 3);
    [controller, learner]
}

#[test]
fn nobody_else_has_any_right_to_any_file() {
    let bench = Bench::new();
    // What people usually have; the promise must not rest on it.
    let old = rustix::process::umask(rustix::fs::Mode::from_raw_mode(0o022));
    let services = start(&bench);
    bench.ok(&["learn", "pancake", "--rollouts", "2", "--out", "whole"]);
    bench.ok(&["policy", "import", "whole", "--cell", "c1"]);
    let mut found = shared_memory(&bench);
    assert!(found.len() > 5, "only {found:?} in shared memory");
    for place in ["run", "state", "s", "whole"] {
        walk(&bench.path(place), &mut found);
    }
    rustix::process::umask(old);
    let names: Vec<_> = found.iter().map(|path| path.display().to_string()).collect();
    for name in ["session.db", "controller.log", "report/", "policies/1.json", ".lock"] {
        assert!(names.iter().any(|path| path.contains(name)), "no {name} among {names:?}");
    }
    for path in &found {
        // What has just been removed is nobody's.
        let Ok(there) = fs::symlink_metadata(path) else { continue };
        // iceoryx2 gives folders to the group, too; they lie in one that does not.
        let inner = there.is_dir() && path.starts_with(bench.path("run/c1/g1"));
        let denied = if inner { 0o027 } else { 0o077 };
        assert_eq!(there.mode() & denied, 0, "{}: {:o}", path.display(), there.mode());
    }
    for service in services.into_iter().rev() {
        service.signal("TERM");
        service.wait();
    }
}

/// Another user, with the same program and every path known to him.
struct Other<'a> {
    bench: &'a Bench,
    program: PathBuf,
}

impl Other<'_> {
    fn runs(&self, program: &Path, arguments: &[&str]) -> Output {
        let mut command = Command::new("setpriv");
        command
            .args(["--reuid", NOBODY, "--regid", NOBODY, "--clear-groups", "--"])
            .arg(program)
            .args(arguments)
            .current_dir("/")
            .env("SKILLET_RUNTIME_DIR", self.bench.path("run"))
            .env("SKILLET_STATE_DIR", self.bench.path("state"))
            .stdin(Stdio::null());
        command.output().unwrap()
    }

    fn is_refused(&self, arguments: &[&str], words: &[&str]) {
        let output = self.runs(&self.program, arguments);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        for word in words {
            assert!(said.contains(word), "{arguments:?}: no '{word}' in: {said}");
        }
        assert!(!said.contains("InternalError") && !said.contains("panicked"), "{said}");
    }
}

#[test]
fn another_user_is_refused_everywhere() {
    let bench = Bench::new();
    if !rustix::process::geteuid().is_root() {
        eprintln!("SKIPPED, NOTHING SHOWN: only root can become another user");
        return;
    }
    // The folder around it is open to all: only the cell's own rights protect it.
    fs::set_permissions(bench.path(""), PermissionsExt::from_mode(0o755)).unwrap();
    let program = bench.path("skillet");
    fs::copy(env!("CARGO_BIN_EXE_skillet"), &program).unwrap();
    fs::set_permissions(&program, PermissionsExt::from_mode(0o755)).unwrap();
    let services = start(&bench);
    let other = Other { bench: &bench, program };
    assert!(other.runs(&other.program, &["--version"]).status.success());

    let own = ["belongs to another user (uid 0)", "SKILLET_RUNTIME_DIR"];
    other.is_refused(&["status", "--cell", "c1"], &own);
    other.is_refused(&["policy", "pin", "--cell", "c1"], &own);
    other.is_refused(&["policy", "rollback", "--cell", "c1"], &own);
    other.is_refused(&["controller", "--cell", "c1"], &own);
    let session = bench.path("s").to_str().unwrap().to_string();
    other.is_refused(&["learner", "--cell", "c1", "--session", &session], &["/s", "ermission"]);
    other.is_refused(&["policy", "list", &session], &["/s", "ermission"]);
    other.is_refused(&["report", &session], &["/s", "ermission"]);

    let mut files = shared_memory(&bench);
    assert!(!files.is_empty());
    files.extend(["s/session.db", "run/c1/controller.lock"].map(|name| bench.path(name)));
    for path in files {
        for tool in ["cat", "touch", "rm"] {
            let output = other.runs(Path::new(tool), &[path.to_str().unwrap()]);
            let gone = !path.exists() && tool != "rm";
            assert!(!output.status.success() || gone, "{tool} {}", path.display());
        }
    }
    for service in &services {
        let output = other.runs(Path::new("kill"), &["-TERM", &service.pid().to_string()]);
        assert!(!output.status.success(), "another user stopped a service");
    }
    let trials = bench.trials("s").len();
    eventually("learning that goes on", || (bench.trials("s").len() > trials + 2).then_some(()));
    for service in services.into_iter().rev() {
        service.signal("TERM");
        service.wait();
    }
}
