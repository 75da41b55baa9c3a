//! `skillet learn`: both services in a private cell, progress, summary, report.

use std::ffi::OsStr;
use std::path::Path;
use std::process::{ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use learner::store::Store;
use learner::summary::Summary as Achievement;
use serde_json::json;
use shm_types::cell::{Cell, runtime_dir};
use shm_types::command::{COMMAND_STATUS, Reply};
use shm_types::ports::ToolPorts;

use crate::Verdict;
use crate::children::Service;
use crate::cli::LearnArgs;
use crate::config::Config;
use crate::progress::{Progress, TrialLine};
use crate::session_folder::SessionFolder;
use crate::{commands, setup};

const PRIVATE_CELL: &str = "learn-";
const WATCH: Duration = Duration::from_millis(50);

pub fn run(args: &LearnArgs) -> Result<Verdict> {
    let (folder, config) = prepare(args)?;
    let stop = setup::stop_flag()?;
    // A cell of its own: sessions on one machine do not meet. One that was killed left its own.
    Cell::remove_idle(&runtime_dir(), PRIVATE_CELL);
    let cell = Cell::new(&format!("{PRIVATE_CELL}{}", std::process::id()))?;
    let start = Instant::now();
    let result = run_services(args, &folder, &config, &cell, &stop);
    cell.remove_if_idle();
    let run = result?;

    let summary = summary(&folder, &config, &run, start.elapsed())?;
    let report = commands::report::write(&folder, &summary.notes())?;
    if args.json {
        println!("{}", serde_json::to_string(&summary.json(&report))?);
    } else {
        print!("{}", summary.text(&report));
    }
    Ok(if run.interrupted { Verdict::Negative } else { Verdict::Done })
}

/// Loads or resumes the session and checks everything that can be checked before a process starts.
fn prepare(args: &LearnArgs) -> Result<(SessionFolder, Config)> {
    let folder = match &args.out {
        Some(dir) => SessionFolder::at(dir),
        None => SessionFolder::next_free(args.task.name()),
    };
    let stored = folder.config_path();
    let source = match (&args.config, folder.has_session()) {
        (Some(path), _) => Some(path.as_path()),
        (None, true) => Some(stored.as_path()),
        (None, false) => None,
    };
    let mut config = Config::load(source)?;
    if config.task.name != args.task.name() {
        bail!(
            "{}: this session belongs to the task '{}', not '{}': choose another folder with --out",
            folder.dir().display(),
            config.task.name,
            args.task.name()
        );
    }
    config.learner.seed = args.seed.unwrap_or(config.learner.seed);
    config.learner.rollouts = args.rollouts.unwrap_or(config.learner.rollouts);
    config.validate()?;

    let model = setup::arm(&config)?;
    let demonstration = setup::demonstration(&config)?;
    setup::check_duration(&config, &demonstration)?;
    setup::check_reach(&model, &config.plant.start_posture(), &demonstration)?;
    if folder.database().exists() {
        let session = || format!("session {}", folder.dir().display());
        let store = Store::open(&folder.database()).with_context(session)?;
        store.expect_task(args.task.name()).with_context(session)?;
        config.learner.check_resumes(&store.meta().learner).with_context(session)?;
    }
    folder.write(&config)?;
    Ok((folder, Config::load(Some(&stored))?))
}

/// What the services did.
struct Run {
    trials: u64,
    wall: Duration,
    interrupted: bool,
    status: Option<Reply>,
}

fn run_services(
    args: &LearnArgs,
    folder: &SessionFolder,
    config: &Config,
    cell: &Cell,
    stop: &AtomicBool,
) -> Result<Run> {
    let config_path = folder.config_path();
    let common = [OsStr::new("--child"), OsStr::new("--cell"), OsStr::new(cell.name())];
    let pace = OsStr::new(args.pace.name());
    let controller_args = [
        &[OsStr::new("controller"), OsStr::new("--config"), config_path.as_os_str()][..],
        &[OsStr::new("--pace"), pace],
        &common,
    ]
    .concat();
    let learner_args = [
        &[OsStr::new("learner"), OsStr::new("--json")][..],
        &[OsStr::new("--session"), folder.dir().as_os_str()],
        &common,
    ]
    .concat();

    let progress = Progress::new(config.learner.rollouts, stored_trials(&folder.database()));
    let mut controller =
        Service::start("controller", &controller_args, folder.log("controller"), Stdio::null())?;
    let mut learner =
        Service::start("learner", &learner_args, folder.log("learner"), Stdio::piped())?;
    let lines = learner.lines().context("reading the learner's progress")?;
    let outcome = watch(&mut controller, &mut learner, &lines, &progress, stop);
    progress.finish();

    let status = ToolPorts::open(cell, Duration::from_millis(500))
        .ok()
        .and_then(|ports| ports.request(COMMAND_STATUS, 1, Duration::from_millis(500)));
    let ended = (learner.stop()?, controller.stop()?);
    let (trials, wall, interrupted) = outcome?;
    if !interrupted {
        expect_success(&learner, ended.0)?;
    }
    expect_success(&controller, ended.1)?;
    Ok(Run { trials, wall, interrupted, status })
}

fn expect_success(service: &Service, status: ExitStatus) -> Result<()> {
    if status.success() { Ok(()) } else { bail!(service.obituary(status)) }
}

/// Shows progress until the learner ends, a signal comes or a child dies. Returns the trials of
/// this run, the time from the first to the last, and whether it was interrupted.
fn watch(
    controller: &mut Service,
    learner: &mut Service,
    lines: &Receiver<String>,
    progress: &Progress,
    stop: &AtomicBool,
) -> Result<(u64, Duration, bool)> {
    let start = Instant::now();
    let mut trials = 0;
    loop {
        match lines.recv_timeout(WATCH) {
            Ok(line) => {
                let trial: TrialLine = serde_json::from_str(&line)
                    .with_context(|| format!("the learner said something else: {line}"))?;
                trials += 1;
                progress.trial(&trial);
                continue;
            }
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {}
        }
        if stop.load(Ordering::Relaxed) {
            progress.note("stopping; the session is saved");
            return Ok((trials, start.elapsed(), true));
        }
        if let Some(status) = learner.exited()? {
            if !status.success() {
                bail!(
                    "{}\nThe controller was ended in order; the session up to the last trial is \
                     saved and resumes with the same command.",
                    learner.obituary(status)
                );
            }
            return Ok((trials, start.elapsed(), false));
        }
        if let Some(status) = controller.exited()? {
            bail!(
                "{}\nThe learner was ended in order; the session up to the last trial is saved and \
                 resumes with the same command.",
                controller.obituary(status)
            );
        }
    }
}

fn stored_trials(database: &Path) -> u64 {
    Store::open(database).and_then(|store| store.trial_count()).unwrap_or(0)
}

/// The result of a session, for people and for machines.
struct Summary {
    task: String,
    seed: u64,
    result: Achievement,
    folder: SessionFolder,
    wall: Duration,
    rollouts_per_s: f64,
    interrupted: bool,
    status: Option<Reply>,
}

fn summary(folder: &SessionFolder, config: &Config, run: &Run, wall: Duration) -> Result<Summary> {
    let trials = Store::open(&folder.database())?.trials()?;
    let result = Achievement::of(&trials);
    Ok(Summary {
        task: config.task.name.clone(),
        seed: config.learner.seed,
        result,
        folder: folder.clone(),
        wall,
        rollouts_per_s: run.trials as f64 / run.wall.as_secs_f64().max(1e-9),
        interrupted: run.interrupted,
        status: run.status,
    })
}

impl Summary {
    fn json(&self, report: &Path) -> serde_json::Value {
        let us = |ns: u64| ns as f64 * 1e-3;
        let timing = self.status.map(|status| {
            json!({
                "realtime": status.realtime == 1,
                "realtime_priority": status.privileged == 1,
                "deadline_misses": status.deadline_misses,
                "wakeup_p50_us": us(status.wakeup_p50_ns),
                "wakeup_p99_us": us(status.wakeup_p99_ns),
                "wakeup_max_us": us(status.wakeup_max_ns),
                "tick_p50_us": us(status.tick_p50_ns),
                "tick_p99_us": us(status.tick_p99_ns),
                "tick_max_us": us(status.tick_max_ns),
            })
        });
        json!({
            "task": self.task,
            "seed": self.seed,
            "rollouts": self.result.trials,
            "first_success": self.result.first_success,
            "successes": self.result.successes,
            "success_last20": self.result.success_last20,
            "best_reward": self.result.best_reward,
            "best_rollout": self.result.best_rollout,
            "session": self.folder.dir(),
            "report": report,
            "wall_s": self.wall.as_secs_f64(),
            "rollouts_per_s": self.rollouts_per_s,
            "interrupted": self.interrupted,
            "timing": timing,
        })
    }

    fn text(&self, report: &Path) -> String {
        let result = &self.result;
        let first = match result.first_success {
            Some(rollout) => format!("first caught flip at rollout {rollout}"),
            None => "no caught flip yet".into(),
        };
        let mut text = format!(
            "{}, seed {}: {} rollouts, {first}, {:.0} % of the last 20 succeed\n\
             best reward {:.3} at rollout {}; {:.1} rollouts/s\n",
            self.task,
            self.seed,
            result.trials,
            100.0 * result.success_last20,
            result.best_reward,
            result.best_rollout.unwrap_or(0),
            self.rollouts_per_s,
        );
        for (name, value) in self.notes().iter().skip(1) {
            text += &format!("{name}: {value}\n");
        }
        text +=
            &format!("session  {}\nreport   {}\n", self.folder.dir().display(), report.display());
        if self.interrupted {
            let dir = self.folder.dir().display();
            text +=
                &format!("stopped early; go on with: skillet learn {} --out {dir}\n", self.task);
        }
        text
    }

    /// What the report shows beside the figures.
    fn notes(&self) -> Vec<(String, String)> {
        let us = |ns: u64| ns as f64 * 1e-3;
        let mut notes =
            vec![("rollouts per second".to_string(), format!("{:.1}", self.rollouts_per_s))];
        if let Some(status) = self.status.filter(|status| status.realtime == 1) {
            notes.push((
                "wake-up p50 / p99 / max".into(),
                format!(
                    "{:.1} / {:.1} / {:.1} µs",
                    us(status.wakeup_p50_ns),
                    us(status.wakeup_p99_ns),
                    us(status.wakeup_max_ns)
                ),
            ));
            notes.push(("deadlines missed".into(), status.deadline_misses.to_string()));
        }
        notes
    }
}
