//! A private cell with everything its services keep, and references of its sessions.

use std::ffi::OsStr;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use shm_types::cell::Cell;

use super::Plan;
use super::ordeal::{Ordeal, Role};
use super::process::Process;
use crate::children::Service;
use crate::config::Config;

/// Sessions with as many seeds are compared with undisturbed ones.
const N_SEEDS: u64 = 4;

pub struct SoakCell {
    pub ordeal: Ordeal,
    pub cell: Cell,
    pub dir: PathBuf,
    pace: &'static str,
    parent: String,
}

impl SoakCell {
    pub fn create(plan: &Plan, ordeal: Ordeal) -> Result<SoakCell> {
        let (pid, name) = (std::process::id(), ordeal.name());
        let cell = Cell::new(&format!("soak-{pid}-{name}"))?;
        let dir = plan.dir.join(name);
        std::fs::create_dir_all(&dir)
            .with_context(|| format!("{}: cannot create the folder", dir.display()))?;
        let soak = SoakCell { ordeal, cell, dir, pace: plan.pace.name(), parent: pid.to_string() };
        for seed in 0..N_SEEDS {
            soak.write_config(seed, plan.rollouts)?;
        }
        Ok(soak)
    }

    /// Everything is on disk, logs are for programs.
    fn write_config(&self, seed: u64, rollouts: u64) -> Result<()> {
        let mut config = Config::default();
        config.cell.state_dir = Some(self.dir.join("state"));
        config.log.format = "json".into();
        (config.learner.seed, config.learner.rollouts) = (seed, rollouts);
        let path = self.config(seed);
        std::fs::write(&path, config.to_toml()?)
            .with_context(|| format!("{}: cannot write", path.display()))
    }

    fn config(&self, seed: u64) -> PathBuf {
        self.dir.join(format!("seed-{seed}.toml"))
    }

    /// Folder and seed of a session.
    pub fn session(&self, number: u64) -> (PathBuf, u64) {
        (self.dir.join(format!("session-{number}")), number % N_SEEDS)
    }

    /// A service of session `number`.
    pub fn start(&self, role: Role, number: u64) -> Result<Process> {
        let (folder, seed) = self.session(number);
        match role {
            Role::Controller if self.ordeal.has_plant() => {
                self.service(role, seed, &["--plant", "external"].map(OsStr::new))
            }
            Role::Controller => self.service(role, seed, &[]),
            Role::Plant => self.plant(seed),
            Role::Learner => {
                self.service(role, seed, &[OsStr::new("--session"), folder.as_os_str()])
            }
        }
    }

    /// The built-in world, served by another process: the same bits as those of the references.
    fn plant(&self, seed: u64) -> Result<Process> {
        let config = self.config(seed);
        let arguments = ["plant", "serve", "--cell", self.cell.name(), "--config"].map(OsStr::new);
        let arguments = [&arguments[..], &[config.as_os_str()]].concat();
        Process::start(Role::Plant.name(), &arguments, &self.dir)
    }

    /// `skillet watch`, which is told everything that a cell tells.
    pub fn observer(&self) -> Result<Service> {
        let arguments = ["watch", "--json", "--duration-s", "30", "--cell", self.cell.name()];
        let log = self.dir.join("watch.log");
        Service::start_apart("watcher", &arguments.map(OsStr::new), log, &[])
    }

    fn service(&self, role: Role, seed: u64, more: &[&OsStr]) -> Result<Process> {
        let config = self.config(seed);
        let (verb, cell, pace) = (role.name(), self.cell.name(), self.pace);
        let common = [verb, "--child", &self.parent, "--cell", cell, "--pace", pace, "--config"];
        let common = common.map(OsStr::new);
        Process::start(verb, &[&common[..], &[config.as_os_str()], more].concat(), &self.dir)
    }

    /// The undisturbed session of this seed; run when first needed.
    pub fn reference(&self, seed: u64) -> Result<PathBuf> {
        let folder = self.dir.join(format!("undisturbed-{seed}"));
        if !folder.join("report").exists() {
            let config = self.config(seed);
            let arguments = ["learn", "pancake", "--json", "--config"].map(OsStr::new);
            let arguments =
                [&arguments[..], &[config.as_os_str(), OsStr::new("--out"), folder.as_os_str()]]
                    .concat();
            let log = self.dir.join("learn.log");
            let mut learn = Service::start_apart("learn", &arguments, log, &[])?;
            let status = loop {
                if let Some(status) = learn.exited()? {
                    break status;
                }
                std::thread::sleep(Duration::from_millis(20));
            };
            if !status.success() {
                bail!(learn.obituary(status));
            }
        }
        Ok(folder)
    }

    /// When all services have ended: what is still there and should not be.
    pub fn left_over(&self) -> Vec<String> {
        self.cell.traces().iter().map(|path| path.display().to_string()).collect()
    }
}
