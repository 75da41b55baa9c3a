//! `skillet learner`: the learner service of a cell.

use std::time::Duration;

use anyhow::{Context, Result, bail};
use learner::Learner;
use learner::cells::Odd;
use learner::modes::choose;
use learner::session::{self, Cells, End, Event};
use learner::store::{SessionMeta, Store};
use rt_controller::fault::Fault;
use rt_controller::rt::{leave_core, loop_core};
use shm_types::cell::{Cell, CellLock, Role};
use shm_types::random_id;
use shm_types::service_manager::{Notice, notify};

use crate::Verdict;
use crate::cell::named_twice;
use crate::cli::{LearnerArgs, PaceArg};
use crate::config::Config;
use crate::config::judge::absolute;
use crate::judging::command;
use crate::output::json_line;
use crate::progress::TrialLine;
use crate::record::file::recover_left;
use crate::record::recorder::Limits;
use crate::record::session::SessionRecorder;
use crate::resume::{open_or_create, resume};
use crate::session_folder::SessionFolder;
use crate::signals::{Who, stop_flag};
use crate::stderr::{self, Sink};
use crate::{background, judging, log, provenance, record, reload, setup};

/// A further recording begins when one has grown so large.
const RECORDING_BYTES: u64 = 512_000_000;
/// What a service manager is asked to wait beyond each sign of life of a long start.
const START_MORE: Duration = Duration::from_secs(60);

pub fn run(args: &LearnerArgs) -> Result<Verdict> {
    if let Some(parent) = args.child {
        setup::end_with_parent(parent)?;
    }
    if let Some(log) = &args.background {
        background::enter(log)?;
    }
    let folder = SessionFolder::at(&args.session);
    let given = args.config.as_deref().map(|path| Config::load(Some(path))).transpose()?;
    let config = open_or_create(&folder, given.as_ref())?;
    config.task.judge.as_ref().map_or(Ok(()), command::check)?;
    if args.pace != PaceArg::Max {
        leave_core(loop_core(config.controller.cpu)); // before a thread starts
    }
    let stop = stop_flag(Who::service(args.child))?;
    // The person at a `learn` sees a full disk at once, and repeats the command.
    let is_service = args.child.is_none();
    let set_level = log::start(&config.log);
    reload::on_hangup(Some(&folder.config_path()), &config, set_level)?;
    let _session = folder.lock()?;
    let cells = cells(args, &config)?;
    let _locks = join(&cells, &folder)?;
    let mut learner = open(&folder, &config)?;
    if is_service {
        note_run(&folder, &learner);
    }

    // A learner that waits for its controller is up.
    notify(&[Notice::Ready]);
    tell_manager("waiting for a controller");
    let names: Vec<&str> = cells.iter().map(|(_, cell)| cell.name()).collect();
    tracing::info!(cell = names.join(", "), session = %folder.dir().display(), "learner ready");
    let mut line = TrialLine::so_far(&learner.summary());
    let mut recording = args.record.then(|| start_recording(&folder, &config)).transpose()?;
    let out = args.json.then(stderr::stdout);
    let log = Log { has_several: cells.len() > 1 };
    let mut on_event = |event: Event<'_>| {
        write_down(&event, &mut recording);
        log.report(&event, &mut line, out.as_ref());
    };
    let cells = Cells { named: cells, wanted: setup::equipment(&config)? };
    let end = session::run(cells, &mut learner, is_service, &stop, &mut on_event)?;
    notify(&[Notice::Stopping]);
    if let Some(out) = out {
        out.finish();
    }
    if let Some(recording) = recording {
        for file in recording.finish()? {
            tracing::info!(file = %file.display(), "recorded");
        }
    }
    let modes = learner.modes()?;
    let answer = choose(modes.iter().map(|(report, _)| report), config.learner.prefer);
    tracing::info!(
        trials = learner.trials().len(),
        modes = modes.len(),
        answer = answer.map(|report| report.number),
        "learner ended cleanly"
    );
    Ok(if end == End::Done { Verdict::Done } else { Verdict::Negative })
}

/// What is not written down is not known later; learning goes on.
fn note_run(folder: &SessionFolder, learner: &Learner) {
    let run = provenance::Run::here(learner.trials().len() as u64);
    if let Err(error) = provenance::add(&folder.provenance(), run) {
        tracing::warn!("{error:#}");
    }
}

fn start_recording(folder: &SessionFolder, config: &Config) -> Result<SessionRecorder> {
    for recovered in recover_left(folder.dir())? {
        tracing::info!(file = %recovered.display(), "repaired a recording whose learner had died");
    }
    let path = folder.dir().join("recording.mcap");
    let limits = Limits { max_bytes: RECORDING_BYTES, by_rollout: false, object_always: true };
    SessionRecorder::new(record::scribe(config)?, &path, limits, record::attachments(config)?)
}

/// A recording that cannot be written ends; learning does not.
fn write_down(event: &Event<'_>, recording: &mut Option<SessionRecorder>) {
    let Some(recorder) = recording else { return };
    let result = match event {
        Event::Executed { policy, header, records } => recorder.executed(policy, header, records),
        Event::Trial { report, .. } => {
            recorder.trial(report);
            Ok(())
        }
        Event::Modes(reports) => {
            recorder.modes(reports);
            Ok(())
        }
        _ => Ok(()),
    };
    if let Err(error) = result {
        tracing::error!("{error:#}; recording stopped, learning continues");
        *recording = None;
    }
}

fn open(folder: &SessionFolder, config: &Config) -> Result<Learner> {
    if Store::exists(&folder.database()) {
        return resume(folder, config, judging::of_session(config, folder)?, |text| {
            tracing::info!("{text}");
            // However long it takes, it is no start that hangs.
            notify(&[Notice::ExtendTimeout(START_MORE), Notice::Status(text)]);
        });
    }
    let demonstrations = setup::check(config)?;
    let meta = SessionMeta {
        task: config.task.name.clone(),
        // Only a name: it decides nothing, so it may differ between equal sessions.
        session_id: random_id(),
        config_toml: config.to_toml()?,
        measures: Vec::new(), // the judge's
        learner: config.learner.clone(),
    };
    let judge = judging::of_session(config, folder)?;
    Learner::create(folder.dir(), meta, &demonstrations, judge)
        .with_context(|| format!("session {}", folder.dir().display()))
}

/// The cells of the session, each with what the session calls it: those that a `learn` made for itself by their
/// number, as their names mean nothing later.
fn cells(args: &LearnerArgs, config: &Config) -> Result<Vec<(String, Cell)>> {
    let names = match &args.cell[..] {
        [] => std::slice::from_ref(&config.cell.name),
        names => names,
    };
    if let Some(twice) = named_twice(names) {
        bail!("--cell {twice}: named twice; name each cell once");
    }
    let named = |(k, name): (usize, &String)| {
        let called = match args.child {
            Some(_) if names.len() == 1 => String::new(),
            Some(_) => (k + 1).to_string(),
            None => name.clone(),
        };
        Ok((called, Cell::new(name)?))
    };
    names.iter().enumerate().map(named).collect()
}

/// Takes the learner's place in every cell, and tells those who watch it where its session is.
fn join(cells: &[(String, Cell)], folder: &SessionFolder) -> Result<Vec<CellLock>> {
    let join = |(_, cell): &(String, Cell)| {
        let lock = cell.lock(Role::Learner)?;
        // For those who watch the cell and have something to say to its session.
        cell.tell_session(&absolute(folder.dir()))?;
        Ok(lock)
    };
    cells.iter().map(join).collect()
}

/// What a learner says of its session.
struct Log {
    /// Then it says of which cell.
    has_several: bool,
}

impl Log {
    fn of(&self, cell: &str) -> String {
        if self.has_several { format!("cell {cell}: ") } else { String::new() }
    }

    /// `out` takes one JSON line a trial, for the process that started this one; nobody waits for it to be read.
    fn report(&self, event: &Event<'_>, line: &mut TrialLine, out: Option<&Sink>) {
        match event {
            Event::Executed { .. } | Event::Modes(_) => {}
            Event::Trial { cell, report: trial } => {
                line.add(trial);
                if let Some(out) = out {
                    if let Ok(text) = json_line(line) {
                        out.push(text.into_bytes());
                    }
                    line.refused = None;
                } else {
                    let (rollout, reward, success) = (trial.rollout, trial.reward, trial.success);
                    let cell = self.has_several.then_some(*cell);
                    tracing::info!(rollout, cell, reward, success, "trial");
                }
            }
            Event::NotStored(reason) => {
                tell_manager("waiting: the disk is full or read-only");
                tracing::error!("not stored: {reason}; retrying every second");
            }
            Event::Stored => {
                tell_manager("learning");
                tracing::info!("stored; continuing");
            }
            Event::Refused { rollout, reason } => {
                line.refused = Some(reason.clone());
                tracing::warn!(
                    "rollout {rollout}: the controller refused its policy: {reason}; counted as a trial \
                     without reward"
                );
            }
            Event::SetAside { rollout, reason } => {
                tracing::warn!("rollout {rollout} set aside, not learnt: {reason}");
            }
            Event::AwaitsRating { .. } | Event::Said { .. } | Event::StandsStill(_) => {
                report_people(event, line);
            }
            _ => self.report_cell(event),
        }
    }

    /// What becomes of a cell.
    fn report_cell(&self, event: &Event<'_>) {
        match event {
            Event::Joined { cell } => {
                tell_manager("learning");
                tracing::info!("{}connected to the controller", self.of(cell));
            }
            Event::NoController { cell } => {
                tell_manager("waiting for a controller");
                tracing::warn!(
                    "{}no controller so far: start it with `skillet controller`; waiting",
                    self.of(cell)
                );
            }
            Event::ControllerSilent { cell, silence } => {
                tell_manager("waiting for the controller");
                tracing::warn!(
                    "{}controller silent for {:.1} s; waiting for it",
                    self.of(cell),
                    silence.as_secs_f64()
                );
            }
            Event::ControllerBack { cell } => {
                tell_manager("learning");
                tracing::info!("{}controller is back", self.of(cell));
            }
            Event::Pinned { cell, is_pinned: true } => {
                tell_manager("waiting: the controller serves a pinned policy");
                tracing::warn!("{}the controller serves a pinned policy; waiting", self.of(cell));
            }
            Event::Pinned { cell, is_pinned: false } => {
                tell_manager("learning");
                tracing::info!("{}the controller takes proposals again", self.of(cell));
            }
            Event::Held { cell, fault: 0 } => {
                tell_manager("learning");
                tracing::info!("{}the arm is re-armed", self.of(cell));
            }
            Event::Held { cell, fault } => {
                tell_manager("waiting: the arm is held; run `skillet rearm` to resume");
                tracing::warn!(
                    "{}the arm is held ({}); waiting for `skillet rearm`",
                    self.of(cell),
                    Fault::describe(*fault as u32)
                );
            }
            Event::OtherWorld { .. } | Event::SameWorld { .. } | Event::OtherPlant { .. } => {
                self.report_equipment(event);
            }
            Event::LeftToOthers { cell, rollout } => {
                tracing::warn!(
                    "{}rollout {rollout} did not come back; reassigned to another cell",
                    self.of(cell)
                );
            }
            Event::Odd(Odd { cell, trials, worse }) => {
                let (word, share) = if *worse > 0.5 {
                    ("lower", 100.0 * worse)
                } else {
                    ("higher", 100.0 - 100.0 * worse)
                };
                tracing::warn!(
                    "cell {cell} differs from the others: over {trials} rollouts its rewards are \
                     {word} than those of others at about the same time in {share:.0} % of all \
                     comparisons; check its arm and plant, and leave it out if they differ"
                );
            }
            Event::Retired { cell, reason } => {
                tracing::error!(
                    "{}{reason}; it gets no further rollouts until its controller is restarted",
                    self.of(cell)
                );
            }
            Event::AskedAgain { cell, rollout, reason } => {
                tracing::warn!("{}rollout {rollout} requested again: {reason}", self.of(cell));
            }
            _ => {}
        }
    }

    /// What the controller of a cell drives.
    fn report_equipment(&self, event: &Event<'_>) {
        match event {
            Event::OtherWorld { cell, found, wanted } => {
                tell_manager("waiting: a controller has another task or arm");
                tracing::error!(
                    "{}its controller has {found}, the session {wanted}: it gets no rollouts until it is \
                     restarted with the session's configuration",
                    self.of(cell)
                );
            }
            Event::SameWorld { cell } => {
                tell_manager("learning");
                tracing::info!("{}its controller has the session's task and arm", self.of(cell));
            }
            Event::OtherPlant { cell, plant, of, other } if cell == of => {
                tracing::warn!("{}its plant is now {plant}; it was {other}", self.of(cell));
            }
            Event::OtherPlant { cell, plant, of, other } => {
                tracing::warn!("cell {cell} has the plant {plant}, cell {of} {other}");
            }
            _ => {}
        }
    }
}

/// What people said, and what the learner asks of them.
fn report_people(event: &Event<'_>, line: &mut TrialLine) {
    match event {
        Event::AwaitsRating { rollout } => {
            tell_manager("waiting for a rating");
            tracing::info!("rollout {rollout} waits for a rating: `skillet rate SESSION 7`");
        }
        Event::Said { taken, summary, next } => {
            tell_manager("learning");
            for one in *taken {
                tracing::info!("{}, from rollout {next} on", one.text);
            }
            // Earlier trials may count for something else now.
            let last = line.clone();
            *line = TrialLine {
                reward: last.reward,
                success: last.success,
                ..TrialLine::so_far(summary)
            };
        }
        Event::StandsStill(true) => tracing::warn!(
            "the search is stuck: add a demonstration with `skillet demo add SESSION file.csv`"
        ),
        Event::StandsStill(false) => tracing::info!("the search is making progress again"),
        _ => {}
    }
}

/// What `systemctl status` shows; a manager that is not there misses nothing.
fn tell_manager(what: &str) {
    notify(&[Notice::Status(what)]);
}
