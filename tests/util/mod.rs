//! Drives the real executable, and reads what it wrote.
#![allow(dead_code)] // each test file uses its own part

pub mod browser;
pub mod document;
pub mod fields;
pub mod page;
pub mod place;

use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use learner::store::{Store, TrialRecord};
use shm_types::cell::Cell;
use shm_types::policy::{PolicyMsg, packed_index};
use tempfile::TempDir;

/// How long anything may take before the test gives up on it.
pub const WATCHDOG: Duration = Duration::from_secs(90);

/// A folder of its own for each test, with its own cells.
pub struct Bench {
    dir: TempDir,
}

impl Bench {
    pub fn new() -> Bench {
        Bench { dir: tempfile::Builder::new().prefix("sk").tempdir().unwrap() }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    pub fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, text).unwrap();
        path
    }

    /// `skillet <arguments>`, not yet started.
    pub fn skillet(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_skillet"));
        command
            .args(arguments)
            .current_dir(self.dir.path())
            .env("SKILLET_RUNTIME_DIR", self.path("run"))
            .env("SKILLET_STATE_DIR", self.path("state"))
            .env_remove("RUST_LOG")
            .stdin(Stdio::null());
        command
    }

    pub fn run(&self, arguments: &[&str]) -> Output {
        self.skillet(arguments).output().unwrap()
    }

    /// Runs and expects exit code 0; returns standard output.
    pub fn ok(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
        String::from_utf8(output.stdout).unwrap()
    }

    /// The same with `--json`: the object, whose version is the documented one.
    pub fn json(&self, arguments: &[&str]) -> serde_json::Value {
        let text = self.ok(&[arguments, &["--json"]].concat());
        let object: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(object["schema"], 1, "{arguments:?}: {text}");
        object
    }

    /// Runs and expects exit code 2 with every one of `words` in the message.
    pub fn refused(&self, arguments: &[&str], words: &[&str]) {
        let output = self.run(arguments);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?} gave: {message}");
        for word in words {
            assert!(message.contains(word), "{arguments:?}: no '{word}' in: {message}");
        }
        assert!(!message.contains("panicked"), "{message}");
    }

    /// Starts a process whose output is read later.
    pub fn start(&self, arguments: &[&str]) -> Running {
        let mut command = self.skillet(arguments);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        Running::start(&mut command)
    }

    pub fn trials(&self, session: &str) -> Vec<TrialRecord> {
        self.store(session).trials().unwrap()
    }

    pub fn store(&self, session: &str) -> Store {
        Store::open(&self.path(session).join("session.db")).unwrap()
    }

    /// Waits until the session holds at least `n` trials.
    pub fn wait_for_trials(&self, session: &str, n: usize) {
        let database = self.path(session).join("session.db");
        eventually(&format!("{n} trials"), || {
            let count = Store::open(&database).and_then(|store| store.trial_count()).unwrap_or(0);
            (count >= n as u64).then_some(())
        });
    }
}

impl Drop for Bench {
    /// Killed processes leave shared memory; nobody else would come to clear it.
    fn drop(&mut self) {
        Cell::remove_idle(&self.path("run"), "");
    }
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// An interpreter with `package`, if there is one; several are set apart by commas.
pub fn python_with(package: &str) -> Option<String> {
    let named = std::env::var("SKILLET_PYTHON").ok();
    let python = named.clone().unwrap_or_else(|| "python3".into());
    let import = Command::new(&python).args(["-c", &format!("import {package}")]).output();
    let has_package = import.is_ok_and(|output| output.status.success());
    assert!(has_package || named.is_none(), "{python} lacks the package {package}");
    if !has_package {
        eprintln!("nothing shown: {python} has no package {package}");
    }
    has_package.then_some(python)
}

pub fn eventually<T>(what: &str, mut f: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    while start.elapsed() < WATCHDOG {
        if let Some(value) = f() {
            return value;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    panic!("{what}: not within {WATCHDOG:?}");
}

/// A process that does not outlive its test.
pub struct Running {
    child: Option<Child>,
}

impl Running {
    pub fn start(command: &mut Command) -> Running {
        Running { child: Some(command.process_group(0).spawn().unwrap()) }
    }

    pub fn pid(&self) -> u32 {
        self.child.as_ref().unwrap().id()
    }

    pub fn has_ended(&mut self) -> bool {
        self.child.as_mut().unwrap().try_wait().unwrap().is_some()
    }

    pub fn signal(&self, signal: &str) {
        kill(self.pid(), signal);
    }

    /// As a terminal does it: to the process and its children.
    pub fn signal_group(&self, signal: &str) {
        let group = format!("-{}", self.pid());
        let status = Command::new("kill").args(["-s", signal, "--", &group]).status();
        assert!(status.unwrap().success());
    }

    pub fn wait(mut self) -> Output {
        let mut child = self.child.take().unwrap();
        let start = Instant::now();
        while child.try_wait().unwrap().is_none() {
            if start.elapsed() > WATCHDOG {
                child.kill().unwrap();
                let output = child.wait_with_output().unwrap();
                panic!("the process does not end; it said: {}", stderr(&output));
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        child.wait_with_output().unwrap()
    }

    /// The child process that plays `role`.
    pub fn child(&self, role: &str) -> u32 {
        let pid = self.pid();
        eventually(role, || {
            let tasks = format!("/proc/{pid}/task/{pid}/children");
            let children = std::fs::read_to_string(tasks).ok()?;
            children.split_whitespace().filter_map(|pid| pid.parse().ok()).find(|child| {
                let line = std::fs::read(format!("/proc/{child}/cmdline")).unwrap_or_default();
                line.split(|byte| *byte == 0).nth(1) == Some(role.as_bytes())
            })
        })
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

pub fn kill(pid: u32, signal: &str) {
    let status = Command::new("kill").args([&format!("-{signal}"), &pid.to_string()]).status();
    assert!(status.unwrap().success());
}

/// The process runs this executable, no longer a copy of the test.
pub fn is_skillet(pid: u32) -> bool {
    std::fs::read_link(format!("/proc/{pid}/exe")).is_ok_and(|exe| exe.ends_with("skillet"))
}

pub fn is_alive(pid: u32) -> bool {
    // A zombie has no command line.
    std::fs::read(format!("/proc/{pid}/cmdline")).is_ok_and(|line| !line.is_empty())
}

pub fn bits(trials: &[TrialRecord]) -> Vec<Vec<u64>> {
    trials.iter().map(TrialRecord::bits).collect()
}

pub fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Springs that rock the pan by `amplitude` m about its start.
pub fn rocking(amplitude: f64) -> PolicyMsg {
    let mut policy = PolicyMsg { n_components: 4, task_dim: 3, ..PolicyMsg::EMPTY };
    policy.damping = 30.0;
    (policy.orientation_stiffness, policy.orientation_damping) = (400.0, 40.0);
    for (i, component) in policy.components[..4].iter_mut().enumerate() {
        let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
        (component.center, component.width) = (0.3 * i as f64, 0.15);
        component.attractor[..3].copy_from_slice(&[0.78, 0.0, 0.72 + sign * amplitude]);
        (0..3).for_each(|row| component.stiffness[packed_index(row, row)] = 225.0);
    }
    policy.sealed()
}
