//! Child processes, as controller and learner: how they are named, started, watched and ended cleanly.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use rustix::process::{Pid, Signal, kill_process};

/// How long a child may take to end after SIGTERM, before it is killed.
const PATIENCE: Duration = Duration::from_secs(5);
/// Lines of a dead child's log that its parent repeats.
const LOG_TAIL: usize = 5;

pub struct Service {
    name: &'static str,
    child: Child,
    log: PathBuf,
}

impl Service {
    /// Starts `skillet <arguments>`; its standard error goes to `log`.
    pub fn start(
        name: &'static str,
        arguments: &[&OsStr],
        log: PathBuf,
        stdout: Stdio,
    ) -> Result<Service> {
        Service::start_as(name, &this_program()?, arguments, log, stdout, |_| {})
    }

    /// With further variables in its environment, and in a process group of its own: what a terminal or
    /// `timeout` sends to the group of its parent is the parent's matter.
    pub fn start_apart(
        name: &'static str,
        arguments: &[&OsStr],
        log: PathBuf,
        environment: &[(&str, &OsStr)],
    ) -> Result<Service> {
        let apart = |command: &mut Command| {
            command.envs(environment.iter().copied()).process_group(0);
        };
        Service::start_as(name, &this_program()?, arguments, log, Stdio::null(), apart)
    }

    /// A service that outlives this process: it leaves the terminal, and `log` stays bounded. `manager` is the
    /// socket on which it says that it is ready.
    pub fn start_in_background(
        name: &'static str,
        arguments: &[&OsStr],
        log: PathBuf,
        manager: &Path,
    ) -> Result<Service> {
        let background = [OsStr::new("--background"), log.as_os_str()];
        let arguments = [arguments, &background].concat();
        let set = |command: &mut Command| {
            command.env("NOTIFY_SOCKET", manager);
        };
        Service::start_as(name, &this_program()?, &arguments, log.clone(), Stdio::null(), set)
    }

    /// Leaves the process running when this one ends.
    pub fn release(self) {
        std::mem::forget(self);
    }

    /// Another program, in a process group of its own and with further variables in its environment.
    pub fn start_program(
        name: &'static str,
        program: &[impl AsRef<OsStr>],
        log: PathBuf,
        environment: &[(&str, impl AsRef<OsStr>)],
    ) -> Result<Service> {
        let (program, arguments) = program.split_first().context("a program has a name")?;
        let arguments: Vec<&OsStr> = arguments.iter().map(AsRef::as_ref).collect();
        let set = |command: &mut Command| {
            command.envs(environment.iter().map(|(name, value)| (name, value))).process_group(0);
        };
        Service::start_as(name, Path::new(program), &arguments, log, Stdio::null(), set)
    }

    fn start_as(
        name: &'static str,
        program: &Path,
        arguments: &[&OsStr],
        log: PathBuf,
        stdout: Stdio,
        set: impl FnOnce(&mut Command),
    ) -> Result<Service> {
        // A resumed session keeps what its earlier processes said.
        let file = std::fs::OpenOptions::new()
            .create(true)
            .append(true)
            .open(&log)
            .with_context(|| format!("{}: cannot write the log", log.display()))?;
        let mut command = Command::new(program);
        command.args(arguments).stdin(Stdio::null()).stdout(stdout).stderr(file);
        set(&mut command);
        let child = command
            .spawn()
            .with_context(|| format!("starting the {name} ({})", program.display()))?;
        Ok(Service { name, child, log })
    }

    /// Lines of its standard output, read by a thread that ends with the child.
    pub fn lines(&mut self) -> Option<Receiver<String>> {
        let stdout = self.child.stdout.take()?;
        let (lines, receiver) = channel();
        std::thread::spawn(move || {
            for line in BufReader::new(stdout).lines().map_while(Result::ok) {
                if lines.send(line).is_err() {
                    break;
                }
            }
        });
        Some(receiver)
    }

    /// `Some` once the child has ended.
    pub fn exited(&mut self) -> Result<Option<ExitStatus>> {
        self.child.try_wait().with_context(|| format!("watching the {}", self.name))
    }

    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Ends the child at once, without a chance to do anything about it.
    pub fn kill(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    /// The child is stuck, for example swapped out or held in a debugger.
    pub fn stall(&self) -> Result<()> {
        let pid = Pid::from_raw(self.child.id() as i32).context("a process has a number")?;
        kill_process(pid, Signal::STOP).with_context(|| format!("stalling the {}", self.name))
    }

    /// Ends the child cleanly, or by force if it does not respond.
    pub fn stop(&mut self) -> Result<ExitStatus> {
        if let Some(status) = self.exited()? {
            return Ok(status);
        }
        if let Some(pid) = Pid::from_raw(self.child.id() as i32) {
            // It may have ended since; then there is nobody to signal.
            let _ = kill_process(pid, Signal::TERM);
        }
        let deadline = Instant::now() + PATIENCE;
        while Instant::now() < deadline {
            if let Some(status) = self.exited()? {
                return Ok(status);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        let _ = self.child.kill();
        self.child.wait().with_context(|| format!("ending the {}", self.name))
    }

    /// Who died, how, and what it said last.
    pub fn obituary(&self, status: ExitStatus) -> String {
        let how = how_it_ended(status.code(), status.signal());
        format!("the {} {how}; {}", self.name, self.last_words())
    }

    /// What it said last.
    pub fn last_words(&self) -> String {
        let log = self.log.display();
        match tail(&self.log, LOG_TAIL) {
            tail if tail.is_empty() => format!("its log {log} is empty"),
            tail => format!("the end of {log}:\n{tail}"),
        }
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        // Whatever path led here, no child is left behind.
        let _ = self.stop();
    }
}

/// By exit code or signal, in words.
pub fn how_it_ended(code: Option<i32>, signal: Option<i32>) -> String {
    match (code, signal) {
        (Some(code), _) => format!("ended with exit code {code}"),
        (None, Some(signal)) => format!("was killed by signal {signal}"),
        (None, None) => "ended".into(),
    }
}

/// Program and arguments of `command`, words apart by spaces; `empty` says what to do where there are none.
pub fn words(command: &str, empty: &str) -> Result<Vec<String>> {
    let words: Vec<String> = command.split_whitespace().map(str::to_string).collect();
    if words.is_empty() {
        bail!("{empty}");
    }
    Ok(words)
}

/// The interpreter of programs in Python: what `SKILLET_PYTHON` names, else `python3`.
pub fn python() -> String {
    let named = std::env::var("SKILLET_PYTHON").ok().filter(|python| !python.is_empty());
    named.unwrap_or_else(|| "python3".into())
}

fn this_program() -> Result<PathBuf> {
    std::env::current_exe().context("finding this executable")
}

fn tail(path: &Path, lines: usize) -> String {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let all: Vec<&str> = text.lines().collect();
    all[all.len().saturating_sub(lines)..].join("\n")
}
