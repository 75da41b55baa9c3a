//! Presence of a watched cell's controller and learner, and the age of their last messages.
//!
//! A dead process is known by its lock, which the kernel frees; one that stands still by its silence.

use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use shm_types::cell::{Cell, Role};
use shm_types::channel::ChannelError;
use shm_types::command::{Reply, Status};
use shm_types::ports::ToolPorts;

use crate::health::{self, Health, SILENT};

/// Between two questions to the controller.
const ASK: Duration = Duration::from_millis(500);
const TIMEOUT: Duration = Duration::from_millis(300);
/// Between two looks at the locks.
const LOOK: Duration = Duration::from_millis(100);

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Presence {
    Running,
    /// It lives, and does not answer.
    Silent,
    Absent,
}

impl Presence {
    pub fn name(self) -> &'static str {
        match self {
            Presence::Running => "running",
            Presence::Silent => "silent",
            Presence::Absent => "absent",
        }
    }
}

/// Signs of life of a cell.
pub struct Vitals {
    cell: Cell,
    answers: Receiver<Result<Reply, ChannelError>>,
    status: Option<(Status, Instant)>,
    /// The machine of the controller, where a bridge lies between.
    via: Option<String>,
    /// When the controller last replied or ticked; before that, when the watch began.
    heard: Instant,
    ticked: Option<Instant>,
    /// What keeps this process from asking it.
    trouble: Option<ChannelError>,
    looked: Option<Instant>,
    has_controller: bool,
    has_learner: bool,
    /// What the last call of `changes` said.
    said: Option<(Presence, Presence)>,
}

impl Vitals {
    pub fn of(cell: &Cell) -> Vitals {
        Vitals {
            cell: cell.clone(),
            answers: ask(cell.clone()),
            status: None,
            via: None,
            heard: Instant::now(),
            ticked: None,
            trouble: None,
            looked: None,
            has_controller: true,
            has_learner: false,
            said: None,
        }
    }

    /// Takes what has come in since the last time.
    pub fn look(&mut self) {
        for answer in self.answers.try_iter() {
            match answer {
                Ok(reply) => {
                    self.heard = Instant::now();
                    self.via = reply.via();
                    (self.status, self.trouble) = (Some((reply.status, self.heard)), None);
                }
                Err(error) => {
                    let is_cut = matches!(error, ChannelError::NotConnected { .. });
                    self.trouble = Some(error).filter(|error| is_cut || !error.is_absence());
                }
            }
        }
        if self.looked.is_none_or(|looked| looked.elapsed() >= LOOK) {
            self.looked = Some(Instant::now());
            let had_controller = self.has_controller;
            self.has_controller = self.cell.has(Role::Controller);
            self.has_learner = self.cell.has(Role::Learner);
            if self.has_controller && !had_controller {
                // Another one, of which nothing is known; it may take its time to start.
                (self.heard, self.status, self.ticked) = (Instant::now(), None, None);
            }
        }
    }

    pub fn ticked(&mut self) {
        self.heard = Instant::now();
        self.ticked = Some(self.heard);
    }

    pub fn controller(&self) -> Presence {
        match (self.has_controller, self.silence() < SILENT) {
            (true, true) => Presence::Running,
            (true, false) => Presence::Silent,
            (false, _) => Presence::Absent,
        }
    }

    pub fn learner(&self) -> Presence {
        let silent_ns = self.status().map_or(u64::MAX, |status| status.learner_age_ns);
        let is_silent = silent_ns != u64::MAX && Duration::from_nanos(silent_ns) >= SILENT;
        match self.has_learner {
            // What a controller that does not answer said of it holds no longer.
            true if is_silent && self.controller() == Presence::Running => Presence::Silent,
            true => Presence::Running,
            false => Presence::Absent,
        }
    }

    /// The machine of the controller, where a bridge lies between.
    pub fn via(&self) -> Option<&str> {
        self.via.as_deref()
    }

    /// Since the controller was last heard.
    pub fn silence(&self) -> Duration {
        self.heard.elapsed()
    }

    /// Since the newest tick came, if one did.
    pub fn tick_age(&self) -> Option<Duration> {
        self.ticked.map(|at| at.elapsed())
    }

    /// Since the controller last said that it heard its learner, if there is one to be heard.
    pub fn learner_age(&self) -> Option<Duration> {
        let (status, at) = self.status.filter(|_| self.has_controller)?;
        let age_ns = status.learner_age_ns;
        (age_ns != u64::MAX).then(|| Duration::from_nanos(age_ns) + at.elapsed())
    }

    /// The last answer, if it is of a controller that is there. The silence of its learner goes on
    /// until the next answer; when that does not come, it is the controller who is silent.
    pub fn status(&self) -> Option<Status> {
        let (status, at) = self.status.filter(|_| self.has_controller)?;
        let age_ns = at.elapsed().min(ASK + TIMEOUT).as_nanos() as u64;
        let learner_age_ns = status.learner_age_ns.saturating_add(age_ns);
        Some(Status { learner_age_ns, ..status })
    }

    /// Since that answer.
    pub fn status_age(&self) -> Option<Duration> {
        self.status.filter(|_| self.has_controller).map(|(_, at)| at.elapsed())
    }

    /// How the cell is, with reasons; unknown before the first answer.
    pub fn health(&self) -> Option<(Health, Vec<String>)> {
        match self.controller() {
            Presence::Running => self.status().map(|status| health::of(&status, self.cell.name())),
            gone => Some((Health::Bad, vec![self.missing(gone)])),
        }
    }

    #[cfg(test)]
    pub fn answered(&mut self, status: Status) {
        self.status = Some((status, Instant::now()));
    }

    /// Describes why the controller is not running.
    fn missing(&self, presence: Presence) -> String {
        let (seconds, name) = (self.silence().as_secs_f64(), self.cell.name());
        if let (Presence::Silent, Some(trouble)) = (presence, &self.trouble) {
            return trouble.to_string();
        }
        match presence {
            Presence::Silent if self.status.is_none() => {
                format!(
                    "the controller has not responded for {seconds:.1} s: it is starting, stopped or \
                     stuck"
                )
            }
            Presence::Silent => format!(
                "the controller has not responded for {seconds:.1} s: it is stopped or stuck; continue \
                 or restart it"
            ),
            _ => format!(
                "no controller for {seconds:.1} s; start the cell with `skillet cell up {name}`"
            ),
        }
    }

    /// What has changed since it was last asked, in words.
    pub fn changes(&mut self) -> Vec<String> {
        let (controller, learner) = (self.controller(), self.learner());
        let said = self.said.replace((controller, learner));
        let (was, had) = said.unwrap_or((Presence::Running, learner));
        let mut changes = Vec::new();
        match controller {
            same if same == was => {}
            Presence::Running => changes.push("the controller is back".to_string()),
            gone => changes.push(self.missing(gone)),
        }
        match learner {
            same if same == had => {}
            Presence::Running => changes.push("the learner is running".into()),
            Presence::Silent => changes.push("the learner is silent: stopped or stuck".into()),
            Presence::Absent => changes.push("the learner has stopped".into()),
        }
        changes
    }
}

/// Asks again and again on a thread of its own, which ends with the receiver: a controller that does
/// not answer must not stop the picture.
fn ask(cell: Cell) -> Receiver<Result<Reply, ChannelError>> {
    let (sender, statuses) = channel();
    std::thread::spawn(move || {
        let mut ports: Option<ToolPorts> = None;
        loop {
            let opened = ports.take().map_or_else(|| ToolPorts::open(&cell, TIMEOUT), Ok);
            let answer = opened.and_then(|opened| {
                let reply = opened.ask(TIMEOUT)?;
                ports = Some(opened);
                Ok(reply)
            });
            if sender.send(answer).is_err() {
                return;
            }
            std::thread::sleep(ASK);
        }
    });
    statuses
}
