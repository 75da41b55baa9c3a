//! All processes of a soak across machines: learner and hub on the first host, the cells and their bridges on the
//! others.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};
use shm_types::cell::Cell;

use super::super::process::Process;
use super::NetPlan;
use super::host::Host;
use crate::config::Config;

const PORT: u16 = 7447;

/// A process; those of cells by the number of the cell. The order is that in which they are started.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    Controller(usize),
    Hub,
    Join(usize),
    Learner,
}

impl Part {
    pub fn name(self) -> &'static str {
        match self {
            Part::Controller(_) => "controller",
            Part::Hub => "hub",
            Part::Join(_) => "join",
            Part::Learner => "learner",
        }
    }
}

pub struct FleetCell {
    pub name: String,
    pub host: usize,
    /// Its folder, with configuration, logs and state.
    pub dir: PathBuf,
}

pub struct Fleet {
    pub hosts: Vec<Host>,
    pub cells: Vec<FleetCell>,
    keys: PathBuf,
    rollouts: u64,
    pace: &'static str,
    parent: String,
}

impl Fleet {
    /// Folders, configurations and keys; nothing is started.
    pub fn make(plan: &NetPlan, hosts: Vec<Host>) -> Result<Fleet> {
        let cell = |k: usize| {
            // Everywhere but on the learner's host, one after the other.
            let (name, host) = (format!("cell-{}", k + 1), 1 + k % (plan.hosts - 1));
            let dir = hosts[host].dir.join(&name);
            FleetCell { name, host, dir }
        };
        let fleet = Fleet {
            cells: (0..plan.cells).map(cell).collect(),
            hosts,
            keys: plan.dir.join("keys"),
            rollouts: plan.rollouts,
            pace: plan.pace.name(),
            parent: std::process::id().to_string(),
        };
        for cell in &fleet.cells {
            fleet.write_config(&cell.dir, Some(cell.dir.join("state")), 0)?;
        }
        fleet.make_keys()?;
        Ok(fleet)
    }

    pub fn parts(&self) -> Vec<Part> {
        let of_cells = (0..self.cells.len()).flat_map(|k| [Part::Controller(k), Part::Join(k)]);
        let mut parts: Vec<Part> = of_cells.chain([Part::Hub, Part::Learner]).collect();
        parts.sort_unstable();
        parts
    }

    /// Where the learner of session `number` keeps its log, and the session.
    pub fn learner_dir(&self, number: u64) -> PathBuf {
        self.hosts[0].dir.join(format!("learner-{number}"))
    }

    pub fn session(&self, number: u64) -> PathBuf {
        self.learner_dir(number).join("session")
    }

    /// The cell as its controller's machine has it.
    pub fn cell(&self, k: usize) -> Result<Cell> {
        self.hosts[self.cells[k].host].cell(&self.cells[k].name)
    }

    /// The cells behind this host's link: for the learner's, all.
    pub fn behind(&self, host: usize) -> Vec<usize> {
        let is_behind = |k: &usize| host == 0 || self.cells[*k].host == host;
        (0..self.cells.len()).filter(is_behind).collect()
    }

    /// Starts a process of session `number`; whether it is up it says itself.
    pub fn start(&self, part: Part, number: u64) -> Result<Process> {
        match part {
            Part::Controller(k) => {
                let verb = ["controller", "--pace", self.pace];
                self.start_of_cell(part, k, &verb.map(OsStr::new))
            }
            Part::Join(k) => {
                let keys = self.keys.join("cells").join(&self.cells[k].name);
                let hub = self.address();
                let verb = ["bridge", "join", "--connect", &hub, "--keys"].map(OsStr::new);
                self.start_of_cell(part, k, &[&verb[..], &[keys.as_os_str()]].concat())
            }
            Part::Hub => {
                let (dir, keys) = (&self.hosts[0].dir, self.keys.join("learner"));
                let config = self.cells[0].dir.join("config.toml");
                let (hub, cells) = (self.address(), self.names().join(","));
                let verb = ["bridge", "serve", "--listen", &hub, "--allow", &cells, "--child"];
                let arguments = [
                    &verb.map(OsStr::new)[..],
                    &[OsStr::new(&self.parent), OsStr::new("--keys"), keys.as_os_str()],
                    &[OsStr::new("--config"), config.as_os_str()],
                ];
                self.hosts[0].start(part.name(), &arguments.concat(), dir)
            }
            Part::Learner => self.start_learner(number),
        }
    }

    fn start_learner(&self, number: u64) -> Result<Process> {
        let (dir, session) = (self.learner_dir(number), self.session(number));
        let config = self.write_config(&dir, None, number)?;
        let mut arguments =
            ["learner", "--child", &self.parent, "--pace", self.pace].map(OsStr::new).to_vec();
        let names = self.names();
        arguments.extend(names.iter().flat_map(|name| ["--cell", name].map(OsStr::new)));
        arguments.extend([OsStr::new("--session"), session.as_os_str()]);
        arguments.extend([OsStr::new("--config"), config.as_os_str()]);
        self.hosts[0].start(Part::Learner.name(), &arguments, &dir)
    }

    fn start_of_cell(&self, part: Part, k: usize, verb: &[&OsStr]) -> Result<Process> {
        let FleetCell { name, host, dir } = &self.cells[k];
        let config = dir.join("config.toml");
        let common = ["--child", &self.parent, "--cell", name, "--config"].map(OsStr::new);
        let arguments = [verb, &common[..], &[config.as_os_str()]].concat();
        self.hosts[*host].start(part.name(), &arguments, dir)
    }

    fn names(&self) -> Vec<&str> {
        self.cells.iter().map(|cell| &*cell.name).collect()
    }

    fn address(&self) -> String {
        format!("{}:{PORT}", self.hosts[0].address)
    }

    /// Logs are for programs.
    fn write_config(&self, dir: &Path, state: Option<PathBuf>, seed: u64) -> Result<PathBuf> {
        let mut config = Config::default();
        config.cell.state_dir = state;
        config.log.format = "json".into();
        (config.learner.seed, config.learner.rollouts) = (seed, self.rollouts);
        std::fs::create_dir_all(dir)
            .with_context(|| format!("{}: cannot create the folder", dir.display()))?;
        let path = dir.join("config.toml");
        std::fs::write(&path, config.to_toml()?)
            .with_context(|| format!("{}: cannot write", path.display()))?;
        Ok(path)
    }

    fn make_keys(&self) -> Result<()> {
        let program = std::env::current_exe().context("finding this executable")?;
        let mut command = Command::new(program);
        command.args(["bridge", "keys", "--learner", &self.hosts[0].address, "--cells"]);
        command.arg(self.names().join(",")).arg("--out").arg(&self.keys);
        let output = command.output().context("starting `skillet bridge keys`")?;
        if !output.status.success() {
            bail!("`skillet bridge keys`: {}", String::from_utf8_lossy(&output.stderr).trim());
        }
        Ok(())
    }
}
