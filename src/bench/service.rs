//! A real controller service under measurement, in a private cell with a folder of its own.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use rt_controller::rt::now_ns;
use shm_types::cell::{Cell, runtime_dir};
use shm_types::command::{
    AT_NOW, COMMAND_ACTIVATE, COMMAND_IMPORT, COMMAND_PIN, Command, Reply, Status,
};
use shm_types::ports::ToolPorts;

use super::arm::message;
use crate::children::Service;
use crate::cli::PaceArg;
use crate::config::{Config, LogConfig};
use crate::signals::end_after;

const CELL_PREFIX: &str = "bench-";
const SOON: Duration = Duration::from_secs(10);

/// Everything the services of one bench share; gone with it.
pub struct BenchCell {
    pub cell: Cell,
    dir: PathBuf,
}

impl BenchCell {
    /// `config` is what the controllers run with.
    pub fn create(config: &Config) -> Result<BenchCell> {
        // Only a bench that was killed leaves a cell.
        Cell::remove_idle(&runtime_dir(), CELL_PREFIX);
        let name = format!("{CELL_PREFIX}{}", std::process::id());
        let cell = Cell::new(&name)?;
        let dir = std::env::temp_dir().join(format!("skillet-{name}"));
        std::fs::create_dir_all(&dir)
            .with_context(|| format!("{}: cannot create the folder", dir.display()))?;
        // A line a swap would be what is measured.
        let log = LogConfig { level: "error".into(), ..config.log.clone() };
        let config = Config { log, ..config.clone() };
        std::fs::write(dir.join("bench.toml"), config.to_toml()?)
            .with_context(|| format!("{}: cannot write", dir.display()))?;
        // Its services end with this process, and clear their cell away.
        let scratch = dir.clone();
        end_after(move || drop(std::fs::remove_dir_all(&scratch)))?;
        Ok(BenchCell { cell, dir })
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.dir.join(name)
    }

    /// Starts `skillet <verb> --cell … --config … <arguments>` as a child of this process.
    pub fn start(&self, verb: &'static str, arguments: &[&str]) -> Result<Service> {
        let parent = std::process::id().to_string();
        let config = self.path("bench.toml");
        let mut all =
            [verb, "--child", &parent, "--cell", self.cell.name()].map(OsStr::new).to_vec();
        all.extend([OsStr::new("--config"), config.as_os_str()]);
        all.extend(arguments.iter().map(OsStr::new));
        Service::start(verb, &all, self.log(verb), Stdio::null())
    }

    pub fn log(&self, verb: &str) -> PathBuf {
        self.path(&format!("{verb}.log"))
    }

    /// A study that keeps every core busy with searches.
    pub fn study(&self) -> Result<Service> {
        let out = self.path("study");
        let parent = std::process::id().to_string();
        let arguments = ["study", "landscape", "--seeds", "1000000", "--child", &parent, "--out"]
            .map(OsStr::new);
        let arguments = [&arguments[..], &[out.as_os_str()]].concat();
        Service::start("study", &arguments, self.log("study"), Stdio::null())
    }

    /// Learners of this cell, all of one session, beside a loop that keeps the clock.
    pub fn learners(&self) -> Learners {
        Learners {
            cells: vec![self.cell.name().into()],
            pace: PaceArg::Realtime,
            config: self.path("bench.toml"),
            session: self.path("session"),
            log: self.log("learner"),
        }
    }

    /// Starts a controller and waits until it answers.
    pub fn controller(&self, pace: &str) -> Result<Service> {
        let mut controller = self.start("controller", &["--private", "--pace", pace])?;
        for _ in 0..100 {
            let answers = ToolPorts::open(&self.cell, Duration::from_millis(100))
                .is_ok_and(|tool| tool.status(SOON).is_some());
            if answers {
                return Ok(controller);
            }
            if let Some(status) = controller.exited()? {
                bail!(controller.obituary(status));
            }
        }
        bail!("the controller does not answer; its log is {}", self.log("controller").display())
    }
}

/// What it takes to start a learner.
pub struct Learners {
    pub cells: Vec<String>,
    pub pace: PaceArg,
    pub config: PathBuf,
    pub session: PathBuf,
    pub log: PathBuf,
}

impl Learners {
    pub fn start(&self) -> Result<Service> {
        let parent = std::process::id().to_string();
        let mut arguments =
            ["learner", "--child", &parent, "--pace", self.pace.name()].map(OsStr::new).to_vec();
        arguments.extend(self.cells.iter().flat_map(|cell| ["--cell", cell].map(OsStr::new)));
        arguments.extend([OsStr::new("--session"), self.session.as_os_str()]);
        // A session brings its own configuration.
        if !self.session.join("session.toml").exists() {
            arguments.extend([OsStr::new("--config"), self.config.as_os_str()]);
        }
        Service::start("learner", &arguments, self.log.clone(), Stdio::null())
    }
}

impl Drop for BenchCell {
    fn drop(&mut self) {
        self.cell.remove_if_idle();
        // A log that stays behind harms nobody.
        let _ = std::fs::remove_dir_all(&self.dir);
    }
}

/// Commands to the controller of a bench.
pub struct Commander {
    tool: ToolPorts,
    next_id: u64,
}

impl Commander {
    pub fn open(cell: &Cell) -> Result<Commander> {
        Ok(Commander { tool: ToolPorts::open(cell, SOON)?, next_id: now_ns() })
    }

    pub fn ask(&mut self, command: Command) -> Result<Reply> {
        self.next_id += 1;
        let command = Command { id: self.next_id, ..command };
        self.tool.request(&command, SOON).context("the controller does not answer")
    }

    pub fn status(&self) -> Result<Status> {
        self.tool.status(SOON).context("the controller does not answer")
    }

    fn expect(&mut self, command: Command) -> Result<Reply> {
        let reply = self.ask(command)?;
        match reply.accepted {
            1 => Ok(reply),
            _ => bail!("refused by the controller: {}", reply.reason_text()),
        }
    }

    /// Imports two very different policies.
    pub fn import_two(&mut self) -> Result<[Target; 2]> {
        let policies = [message(8, 4, 0.02), message(4, 3, -0.04)];
        let mut import = |policy| -> Result<Target> {
            let reply = self.expect(Command { policy, ..Command::new(COMMAND_IMPORT, 0) })?;
            Ok(Target { id: reply.policy.policy_id, digest: policy.digest })
        };
        Ok([import(policies[0])?, import(policies[1])?])
    }

    /// Serves the first of them; returns both.
    pub fn two_policies(&mut self) -> Result<[Target; 2]> {
        let targets = self.import_two()?;
        self.expect(targets[0].activate())?;
        self.expect(Command::new(COMMAND_PIN, 0))?;
        Ok(targets)
    }
}

/// A policy to swap to.
#[derive(Clone, Copy)]
pub struct Target {
    id: u64,
    pub digest: u64,
}

impl Target {
    /// Now.
    pub fn activate(&self) -> Command {
        Command { policy_id: self.id, at: AT_NOW, ..Command::new(COMMAND_ACTIVATE, 0) }
    }
}

/// Resident memory of a process, MiB.
pub fn resident_mib(pid: u32) -> Result<f64> {
    let path = format!("/proc/{pid}/status");
    let text = std::fs::read_to_string(Path::new(&path)).with_context(|| path.clone())?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:")).context("no VmRSS")?;
    let kib: f64 = line.trim().trim_end_matches(" kB").trim().parse().context("VmRSS")?;
    Ok(kib / 1024.0)
}
