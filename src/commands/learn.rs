//! `skillet learn`: both services in a private cell, progress, summary, report.

use std::ffi::{OsStr, OsString};
use std::path::Path;
use std::process::{ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use learner::Demonstration;
use learner::compliance::ComplianceConfig;
use learner::learner::judged_by as judged_by_so_far;
use learner::parameters::PolicyIds;
use learner::problem::Problem;
use learner::store::Store;
use learner::summary::Summary as Achievement;
use rt_controller::fault::Fault;
use serde_json::json;
use shm_types::cell::{Cell, CellError, runtime_dir};
use shm_types::command::Status;
use shm_types::plant::socket::PLANT_VARIABLE;
use shm_types::ports::ToolPorts;

use crate::Verdict;
use crate::cell::PRIVATE;
use crate::children::Service;
use crate::cli::LearnArgs;
use crate::config::Config;
use crate::config::judge::absolute;
use crate::config::plant::PlantKind;
use crate::judging::command;
use crate::output::{json_line, print, print_json};
use crate::progress::{Progress, TrialLine};
use crate::robots::Robot;
use crate::session_folder::SessionFolder;
use crate::signals::{Who, stop_flag};
use crate::stderr::say;
use crate::summary::Summary;
use crate::{commands, external, health, judging, provenance, setup};

const WATCH: Duration = Duration::from_millis(50);
/// Between two looks at an arm from which no trial comes.
const LOOK: Duration = Duration::from_secs(2);

pub fn run(args: &LearnArgs) -> Result<Verdict> {
    let (folder, config) = prepare(args)?;
    let here = provenance::Run::here(stored_trials(&folder.database()));
    if let Err(error) = provenance::add(&folder.provenance(), here) {
        say(&format!("warning: {error:#}"));
    }
    let stop = stop_flag(Who::Tool)?;
    // A cell of its own: sessions on one machine do not meet. One that was killed left its own.
    Cell::remove_idle(&runtime_dir(), PRIVATE);
    let name = format!("{PRIVATE}{}", std::process::id());
    let cells = (0..args.cells.into()).map(|k| Cell::new(&numbered(&name, k)));
    let cells = cells.collect::<Result<Vec<Cell>, CellError>>()?;
    let start = Instant::now();
    let result = run_services(args, &folder, &config, &cells, &stop);
    cells.iter().for_each(Cell::remove_if_idle);
    let run = result?;
    if run.interrupted && !folder.database().exists() {
        let dir = folder.dir();
        if args.json {
            print_json(&json!({ "session": dir, "interrupted": true, "trials": 0 }))?;
        }
        say(&format!("stopped before the first rollout; resume with --out {}", dir.display()));
        return Ok(Verdict::Negative);
    }

    let summary = summary(&folder, &config, &run, start.elapsed())?;
    let report = commands::report::write(&folder, &summary.notes())?;
    if args.json {
        print(&json_line(&summary.json(&report))?)?;
    } else {
        print(&summary.text(&report))?;
    }
    Ok(if run.interrupted { Verdict::Negative } else { Verdict::Done })
}

/// Loads or resumes the session and checks everything that can be checked before a process starts.
fn prepare(args: &LearnArgs) -> Result<(SessionFolder, Config)> {
    let folder = match &args.out {
        Some(dir) => SessionFolder::at(dir),
        None => SessionFolder::next_free(&args.task),
    };
    let stored = folder.config_path();
    let source = match (&args.config, folder.has_session()) {
        (Some(path), _) => Some(path.as_path()),
        (None, true) => Some(stored.as_path()),
        (None, false) => None,
    };
    let mut config = match (source, &args.arm) {
        (Some(path), None) => Config::load(Some(path))?,
        (Some(_), Some(_)) => bail!(
            "{}: this session already has an arm: omit --arm, or choose another folder",
            folder.dir().display()
        ),
        (None, Some(arm)) => Robot::find(arm)?.settle(&args.task, folder.dir())?,
        (None, None) => Config::of_task(&args.task),
    };
    if config.task.name != args.task {
        bail!(
            "{}: this session belongs to the task '{}', not '{}': choose another folder with --out",
            folder.dir().display(),
            config.task.name,
            args.task
        );
    }
    config.learner.seed = args.seed.unwrap_or(config.learner.seed);
    config.learner.rollouts = args.rollouts.unwrap_or(config.learner.rollouts);
    config.learner.prefer = args.prefer.map_or(config.learner.prefer, Into::into);
    config.learner.wish = args.wish.clone().unwrap_or(config.learner.wish);
    config.plant.kind = args.plant.map_or(config.plant.kind, Into::into);
    if let Some(command) = &args.plant_program {
        (config.plant.kind, config.plant.program) =
            (PlantKind::External, external::words(command)?);
    }
    if let Some(command) = &args.judge {
        judged_by(&mut config, command)?;
    }
    if let Some(target) = args.target {
        if !config.task()?.has_target {
            bail!("the task {} has no target to choose; leave --target out", args.task);
        }
        config.task.target_m = target;
    }
    config.validate()?;
    if args.cells > 1 && config.plant.socket.is_some() {
        bail!("--cells {}: every cell has a plant of its own; omit plant.socket", args.cells);
    }

    if folder.has_session() {
        folder.expect_same_world(&config)?;
    }
    // Said first: it may be why a check fails.
    warn(setup::arm_notes(&config)?);
    let demonstrations = setup::check(&config)?;
    judging::judge(&config)?;
    config.task.judge.as_ref().map_or(Ok(()), command::check)?;
    if config.has_arm() && !Store::exists(&folder.database()) {
        // What demonstrations do not allow is said before a process starts.
        check_start(&config, &demonstrations)?;
    }
    if Store::exists(&folder.database()) {
        let session = || format!("session {}", folder.dir().display());
        let _lock = folder.lock()?;
        let store = Store::resume(&folder.database()).with_context(session)?;
        store.expect_task(&args.task).with_context(session)?;
        config.learner.check_resumes(&store.meta().learner).with_context(session)?;
        note_other_judge(&store, &config).with_context(session)?;
    }
    folder.write(&config)?;
    Ok((folder, Config::load(Some(&stored))?))
}

/// What a session with an arm begins with: which demonstrations are too fast, and how many components the policy has.
fn check_start(config: &Config, demonstrations: &[Demonstration]) -> Result<()> {
    warn(setup::too_fast(config, demonstrations)?);
    let problem = Problem::new(&config.learner, demonstrations)?;
    if config.learner.n_components.number().is_none() {
        let initial = problem.decode(&problem.spaces[0].theta_0, PolicyIds::default());
        let n = initial.n_systems;
        say(&format!("learner.n_components = \"bic\": the criterion chose {n} components"));
    }
    Ok(())
}

fn warn(notes: Vec<String>) {
    notes.iter().for_each(|note| say(&format!("warning: {note}")));
}

/// Has the program of `command` judge.
fn judged_by(config: &mut Config, command: &str) -> Result<()> {
    let words = command::words(command)?;
    let usual = Config::of_options(&config.task.name, config.task.options.clone());
    let judge = config.task.judge.get_or_insert_default();
    if !judge.has_program() && config.learner.compliance == usual.learner.compliance {
        // As with every reward of one's own.
        config.learner.compliance = ComplianceConfig::off();
    }
    judge.run(words, absolute(Path::new("")));
    Ok(())
}

/// Says that a session goes on with another judge than before. Its diary will say so, too.
fn note_other_judge(store: &Store, config: &Config) -> Result<()> {
    let Some(judge) = config.task.judge.as_ref().filter(|judge| judge.has_program()) else {
        return Ok(());
    };
    let now = command::identity(&judge.program, &command::folder(judge));
    if let Some(before) = judged_by_so_far(store)?.filter(|before| *before != now) {
        let n = store.trial_count()?;
        say(&format!(
            "warning: the judge has changed after rollout {n}: it was {before}, from now on it is {now}"
        ));
    }
    Ok(())
}

/// What the services did.
struct Run {
    trials: u64,
    wall: Duration,
    interrupted: bool,
    status: Option<Status>,
}

fn run_services(
    args: &LearnArgs,
    folder: &SessionFolder,
    config: &Config,
    cells: &[Cell],
    stop: &AtomicBool,
) -> Result<Run> {
    let (rollouts, done) = (config.learner.rollouts, stored_trials(&folder.database()));
    let progress = Progress::new(rollouts, done, config.success()?.is_some());
    let mut services = Services::start(args, folder, config, cells)?;
    let lines = services.learner.lines().context("reading the learner's progress")?;
    let outcome = watch(&mut services, cells, &lines, &progress, stop);
    progress.finish();

    let status = ToolPorts::open(&cells[0], Duration::from_millis(500))
        .ok()
        .and_then(|ports| ports.status(Duration::from_millis(500)));
    let Services { mut controllers, mut learner, plants } = services;
    let ended = learner.stop()?;
    let statuses: Vec<ExitStatus> =
        controllers.iter_mut().map(Service::stop).collect::<Result<_>>()?;
    drop(plants);
    let (trials, wall, interrupted) = outcome?;
    // A terminal interrupts the whole group, a child perhaps before it could listen.
    if !interrupted {
        expect_success(&learner, ended)?;
        for (controller, status) in controllers.iter().zip(statuses) {
            expect_success(controller, status)?;
        }
    }
    Ok(Run { trials, wall, interrupted, status })
}

/// The processes of a session: one controller for each cell, and a plant where it is a program.
struct Services {
    controllers: Vec<Service>,
    learner: Service,
    plants: Vec<Service>,
}

impl Services {
    fn start(
        args: &LearnArgs,
        folder: &SessionFolder,
        config: &Config,
        cells: &[Cell],
    ) -> Result<Services> {
        let parent = std::process::id().to_string();
        let (config_path, pace) = (folder.config_path(), OsStr::new(args.pace.name()));
        let child = ["--child", &parent].map(OsStr::new);
        let of_cell = |cell: &'_ Cell| [OsString::from("--cell"), cell.name().into()];
        let mut controllers = Vec::new();
        for (k, cell) in cells.iter().enumerate() {
            let (timing, of_cell) = (folder.timing(k), of_cell(cell));
            let arguments = [
                &[OsStr::new("controller"), OsStr::new("--config"), config_path.as_os_str()][..],
                &[OsStr::new("--private"), OsStr::new("--pace"), pace],
                &[OsStr::new("--timing"), timing.as_os_str()],
                &child,
                &of_cell.each_ref().map(OsString::as_os_str),
            ]
            .concat();
            let log = folder.log(&numbered("controller", k));
            controllers.push(Service::start("controller", &arguments, log, Stdio::null())?);
        }
        let of_cells: Vec<OsString> = cells.iter().flat_map(of_cell).collect();
        let of_cells: Vec<&OsStr> = of_cells.iter().map(OsString::as_os_str).collect();
        let record = [OsStr::new("--record")];
        let arguments = [
            &[OsStr::new("learner"), OsStr::new("--json")][..],
            &[OsStr::new("--session"), folder.dir().as_os_str(), OsStr::new("--pace"), pace],
            if args.record { &record[..] } else { &[] },
            &child,
            &of_cells,
        ]
        .concat();
        let learner = Service::start("learner", &arguments, folder.log("learner"), Stdio::piped())?;
        let plant = |(k, cell)| start_plant(folder, config, cell, k).transpose();
        let plants = cells.iter().enumerate().filter_map(plant).collect::<Result<_>>()?;
        Ok(Services { controllers, learner, plants })
    }
}

/// What belongs to cell `k`, from 0: the first one's has no number.
fn numbered(name: &str, k: usize) -> String {
    if k == 0 { name.into() } else { format!("{name}-{}", k + 1) }
}

/// The program of an external plant, where the configuration names one.
fn start_plant(
    folder: &SessionFolder,
    config: &Config,
    cell: &Cell,
    k: usize,
) -> Result<Option<Service>> {
    if !config.plant.is_external() {
        return Ok(None);
    }
    let socket = external::socket_of(config, cell);
    let program = &config.plant.program;
    if program.is_empty() {
        say(&format!("waiting for a plant: start it with {}={}", PLANT_VARIABLE, socket.display()));
        return Ok(None);
    }
    let environment = external::environment(config, &socket)?;
    let log = folder.log(&numbered("plant", k));
    Service::start_program("plant", program, log, &environment).map(Some)
}

fn expect_success(service: &Service, status: ExitStatus) -> Result<()> {
    if status.success() { Ok(()) } else { bail!(service.obituary(status)) }
}

/// Shows progress until the learner ends, a signal comes or a child dies. Returns the trials of
/// this run, the time from the first to the last, and whether it was interrupted.
fn watch(
    Services { controllers, learner, plants }: &mut Services,
    cells: &[Cell],
    lines: &Receiver<String>,
    progress: &Progress,
    stop: &AtomicBool,
) -> Result<(u64, Duration, bool)> {
    let start = Instant::now();
    let mut trials = 0;
    let mut held: Vec<Held> = cells.iter().map(Held::new).collect();
    loop {
        match lines.recv_timeout(WATCH) {
            Ok(line) => {
                trials += show(&line, progress)?;
                for held in &mut held {
                    (held.looked, held.asked) = (Instant::now(), None);
                }
                continue;
            }
            Err(RecvTimeoutError::Timeout) => held.iter_mut().for_each(|held| held.look(progress)),
            // Its end is near, but a process ends a little after its output.
            Err(RecvTimeoutError::Disconnected) => std::thread::sleep(Duration::from_millis(1)),
        }
        if stop.load(Ordering::Relaxed) {
            progress.note("stopping; the session is saved");
            return Ok((trials, start.elapsed(), true));
        }
        if let Some(status) = learner.exited()? {
            for line in lines.iter() {
                trials += show(&line, progress)?;
            }
            if !status.success() {
                bail!(
                    "{}\nThe controller was ended cleanly; the session up to the last trial is \
                     saved and resumes with the same command.",
                    learner.obituary(status)
                );
            }
            return Ok((trials, start.elapsed(), false));
        }
        bury(controllers, progress)?;
        let plants = plants.iter_mut().map(|plant| (plant, "others were"));
        let controllers = controllers.iter_mut().map(|controller| (controller, "learner was"));
        for (service, survivors) in plants.chain(controllers) {
            if let Some(status) = service.exited()? {
                bail!(
                    "{}\nThe {survivors} ended cleanly; the session up to the last trial is saved and resumes \
                     with the same command.",
                    service.obituary(status)
                );
            }
        }
    }
}

/// Goes on without a controller that has ended, as long as there are others.
fn bury(controllers: &mut Vec<Service>, progress: &Progress) -> Result<()> {
    let mut k = 0;
    while k < controllers.len() && controllers.len() > 1 {
        match controllers[k].exited()? {
            Some(status) => {
                let obituary = controllers.remove(k).obituary(status);
                let left = controllers.len();
                progress.note(&format!("{obituary}\ncontinuing with {left} of the cells"));
            }
            None => k += 1,
        }
    }
    Ok(())
}

/// Looks now and then, while no trial comes, whether the arm is held or somebody is asked, and says so once.
struct Held<'a> {
    cell: &'a Cell,
    /// Or since when there was no reason to.
    looked: Instant,
    told: u64,
    /// What the learner asks of people.
    asked: Option<String>,
}

impl Held<'_> {
    fn new(cell: &Cell) -> Held<'_> {
        Held { cell, looked: Instant::now(), told: 0, asked: None }
    }

    fn look(&mut self, progress: &Progress) {
        if self.looked.elapsed() < LOOK {
            return;
        }
        self.looked = Instant::now();
        let status = ToolPorts::open(self.cell, WATCH).ok().and_then(|ports| ports.status(WATCH));
        let Some(status) = status else { return };
        if status.latched_fault != self.told && status.latched_fault != 0 {
            progress.note(&format!(
                "the arm is held: {}; once the cause is fixed, run `skillet rearm --cell {}` to \
                 continue",
                Fault::describe(status.latched_fault as u32),
                self.cell.name()
            ));
        }
        self.told = status.latched_fault;
        let asks = health::people(status.learner_waits, self.cell.name());
        if let Some(asks) = asks.as_ref().filter(|_| asks != self.asked) {
            progress.note(asks);
        }
        self.asked = asks;
    }
}

/// Shows what the learner says: how many trials it told of.
fn show(line: &str, progress: &Progress) -> Result<u64> {
    // Its log says the same, and is what the user is shown.
    if line.starts_with(r#"{"error":"#) {
        return Ok(0);
    }
    let trial = serde_json::from_str::<TrialLine>(line)
        .with_context(|| format!("unexpected output of the learner: {line}"))?;
    progress.trial(&trial);
    Ok(1)
}

fn stored_trials(database: &Path) -> u64 {
    Store::open(database).and_then(|store| store.trial_count()).unwrap_or(0)
}

fn summary(folder: &SessionFolder, config: &Config, run: &Run, wall: Duration) -> Result<Summary> {
    let store = Store::open(&folder.database())?;
    let result = Achievement::of(&store.trials()?);
    Ok(Summary {
        modes: commands::modes::summary(&store, config.learner.prefer)?,
        task: config.task.name.clone(),
        success: config.success()?,
        seed: config.learner.seed,
        rollouts: config.learner.rollouts,
        result,
        folder: folder.clone(),
        wall,
        rollouts_per_s: run.trials as f64 / run.wall.as_secs_f64().max(1e-9),
        interrupted: run.interrupted,
        status: run.status,
    })
}
