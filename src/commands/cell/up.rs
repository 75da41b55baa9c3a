//! `skillet cell up`: starts what does not run yet, and waits until it is ready.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use anyhow::{Context, Result, bail};
use learner::store::Store;
use serde_json::json;
use shm_types::cell::{Cell, Role, runtime_dir};
use shm_types::plant::socket::PLANT_VARIABLE;

use super::ready::{Manager, Start};
use super::short;
use crate::Verdict;
use crate::cell::state_dir;
use crate::children::Service;
use crate::cli::cell::UpArgs;
use crate::config::Config;
use crate::config::judge::absolute;
use crate::external;
use crate::output::{print, print_json};
use crate::resume::open_or_create;
use crate::session_folder::SessionFolder;
use crate::signals::{Who, stop_flag};
use crate::stderr::say;

/// Sessions of cells, by name.
const SESSIONS: &str = "sessions";

pub fn run(args: &UpArgs) -> Result<Verdict> {
    let plan = Plan::of(args)?;
    let stop = stop_flag(Who::Tool)?;
    let Some((controller, learner)) = plan.start(&stop)? else {
        say("interrupted; what was started has been stopped again");
        return Ok(Verdict::Negative);
    };
    if args.json {
        print_json(&plan.json(&controller, &learner))?;
    } else {
        print(&plan.text(&controller, &learner))?;
    }
    Ok(Verdict::Done)
}

/// What is to run.
struct Plan<'a> {
    args: &'a UpArgs,
    cell: Cell,
    config: Config,
    /// The file with it; the built-in configuration has none.
    config_path: Option<PathBuf>,
    session: Option<SessionFolder>,
    state_dir: PathBuf,
}

/// What has become of a role.
enum Outcome {
    Started {
        pid: u32,
        log: PathBuf,
    },
    AlreadyRunning {
        pid: Option<u32>,
    },
    /// The session has all its rollouts.
    Complete,
    NotWanted,
}

impl Plan<'_> {
    fn of(args: &UpArgs) -> Result<Plan<'_>> {
        let cell = super::named(&args.name)?;
        let by_default = || Path::new(SESSIONS).join(cell.name());
        let folder = absolute(&args.session.clone().unwrap_or_else(by_default));
        if let Some(other) = cell.session().filter(|other| *other != folder)
            && cell.has(Role::Learner)
            && args.session.is_some()
        {
            bail!(
                "cell '{}' already works on the session {}: run `skillet cell down {0}` first, or choose \
                 another cell",
                cell.name(),
                other.display()
            );
        }
        let folder = SessionFolder::at(&folder);
        let given = match (&args.config, &args.task) {
            (Some(path), _) => Some(Config::load(Some(path))?),
            (None, Some(task)) if !folder.has_session() || args.no_learner => {
                Some(Config::of_task(task))
            }
            (None, _) => None,
        };
        let own_path = folder.has_session().then(|| folder.config_path());
        let config = match (&given, args.no_learner) {
            (_, false) if !cell.has(Role::Learner) => open_or_create(&folder, given.as_ref())?,
            (Some(config), _) => config.clone(),
            (None, _) => Config::load(own_path.as_deref())?,
        };
        if let Some(task) = args.task.as_ref().filter(|task| **task != config.task.name) {
            bail!(
                "{}: this session belongs to the task '{}', not '{task}': choose another folder with --session",
                folder.dir().display(),
                config.task.name,
            );
        }
        let state_dir = absolute(&state_dir(&config, &cell));
        let config_path = match &args.config {
            Some(path) => Some(absolute(path)),
            None if folder.has_session() && (given.is_none() || !args.no_learner) => {
                Some(folder.config_path())
            }
            None => given.map(|config| write_config(&state_dir, &config)).transpose()?,
        };
        let session = (!args.no_learner).then_some(folder);
        Ok(Plan { args, cell, config, config_path, session, state_dir })
    }

    /// Starts both, or none: what has started is stopped again when the other one fails. `None` if interrupted.
    fn start(&self, stop: &AtomicBool) -> Result<Option<(Outcome, Outcome)>> {
        let (mut controller, mut learner) = (None, None);
        if !self.cell.has(Role::Controller) {
            let Some(started) = self.start_one("controller", self.of_controller(), stop)? else {
                return Ok(None);
            };
            controller = Some(started);
        }
        if let Some(folder) = &self.session
            && !self.cell.has(Role::Learner)
            && !self.is_complete(folder)
        {
            let Some(started) = self.start_one("learner", self.of_learner(folder), stop)? else {
                return Ok(None);
            };
            learner = Some(started);
        }
        let outcome = |started: Option<Service>, role| match started {
            Some(service) => {
                let pid = service.id();
                service.release();
                Outcome::Started { pid, log: self.log(role) }
            }
            None if self.cell.has(role) => {
                Outcome::AlreadyRunning { pid: self.cell.holder(role).map(|holder| holder.pid()) }
            }
            None if self.session.is_some() => Outcome::Complete,
            None => Outcome::NotWanted,
        };
        Ok(Some((outcome(controller, Role::Controller), outcome(learner, Role::Learner))))
    }

    fn start_one(
        &self,
        name: &'static str,
        arguments: Vec<&OsStr>,
        stop: &AtomicBool,
    ) -> Result<Option<Service>> {
        let role = if name == "learner" { Role::Learner } else { Role::Controller };
        let log = self.log(role);
        let dir = log.parent().unwrap_or(&self.state_dir);
        std::fs::create_dir_all(dir)
            .with_context(|| format!("{}: cannot create the folder of the logs", dir.display()))?;
        let manager = Manager::new(&runtime_dir(), name)?;
        let arguments = [
            &arguments[..],
            &["--cell", self.cell.name(), "--pace", self.args.pace.name()].map(OsStr::new),
        ]
        .concat();
        let mut service = Service::start_in_background(name, &arguments, log, manager.path())?;
        match manager.wait_for(&mut service, stop)? {
            Start::Ready => Ok(Some(service)),
            Start::Interrupted => Ok(None),
        }
    }

    fn of_controller(&self) -> Vec<&OsStr> {
        let mut arguments = vec![OsStr::new("controller")];
        if let Some(path) = &self.config_path {
            arguments.extend([OsStr::new("--config"), path.as_os_str()]);
        }
        arguments
    }

    fn of_learner<'a>(&self, folder: &'a SessionFolder) -> Vec<&'a OsStr> {
        let mut arguments =
            vec![OsStr::new("learner"), OsStr::new("--session"), folder.dir().as_os_str()];
        if self.args.record {
            arguments.push(OsStr::new("--record"));
        }
        arguments
    }

    /// A learner would end at once.
    fn is_complete(&self, folder: &SessionFolder) -> bool {
        Store::exists(&folder.database())
            && Store::open(&folder.database())
                .and_then(|store| store.trial_count())
                .is_ok_and(|trials| trials >= self.config.learner.rollouts)
    }

    fn log(&self, role: Role) -> PathBuf {
        self.state_dir.join("log").join(format!("{}.log", role.name()))
    }

    /// The session that the learner works on.
    fn session(&self) -> Option<PathBuf> {
        let of_learner = self.cell.has(Role::Learner).then(|| self.cell.session()).flatten();
        of_learner.or_else(|| Some(self.session.as_ref()?.dir().to_path_buf()))
    }

    fn json(&self, controller: &Outcome, learner: &Outcome) -> serde_json::Value {
        json!({
            "cell": self.cell.name(),
            "controller_pid": controller.pid(),
            "controller_started": controller.is_started(),
            "controller_log": controller.log(),
            "learner_pid": learner.pid(),
            "learner_started": learner.is_started(),
            "learner_log": learner.log(),
            "session": self.session(),
        })
    }

    fn text(&self, controller: &Outcome, learner: &Outcome) -> String {
        let name = self.cell.name();
        let mut text = format!("controller  {}\n", controller.text(self));
        text += &format!("learner     {}\n", learner.text(self));
        if let Some(session) = self.session() {
            text += &format!("session     {}\n", short(&session).display());
        }
        let plant = &self.config.plant;
        if plant.is_external() && controller.is_started() {
            let socket = external::socket_of(&self.config, &self.cell);
            text += &format!(
                "plant       waiting for it: start it with {PLANT_VARIABLE}={}\n",
                socket.display()
            );
        }
        text + &format!(
            "next        skillet watch --cell {name}\n            skillet cell down {name}\n"
        )
    }
}

impl Outcome {
    fn pid(&self) -> Option<u32> {
        match self {
            Outcome::Started { pid, .. } => Some(*pid),
            Outcome::AlreadyRunning { pid } => *pid,
            _ => None,
        }
    }

    fn is_started(&self) -> bool {
        matches!(self, Outcome::Started { .. })
    }

    fn log(&self) -> Option<&Path> {
        match self {
            Outcome::Started { log, .. } => Some(log),
            _ => None,
        }
    }

    fn text(&self, plan: &Plan<'_>) -> String {
        match self {
            Outcome::Started { pid, log } => {
                format!("started, process {pid}, log {}", log.display())
            }
            Outcome::AlreadyRunning { pid: Some(pid) } => {
                format!("already running, process {pid}; its settings are unchanged")
            }
            Outcome::AlreadyRunning { pid: None } => {
                "already running; its settings are unchanged".into()
            }
            Outcome::Complete => format!(
                "not started: the session has all its {} rollouts; choose another with --session",
                plan.config.learner.rollouts
            ),
            Outcome::NotWanted => "none".into(),
        }
    }
}

/// The configuration of a cell without a session.
fn write_config(state_dir: &Path, config: &Config) -> Result<PathBuf> {
    let path = state_dir.join("cell.toml");
    std::fs::create_dir_all(state_dir)
        .and_then(|()| std::fs::write(&path, config.to_toml().unwrap_or_default()))
        .with_context(|| format!("{}: cannot write the configuration", path.display()))?;
    Ok(path)
}
