//! The plant's end of the line to a controller: a robot's driver or a simulator, in Rust or, by
//! `include/skillet_plant.h`, in C.
//!
//! Every wait in here has a limit, and every error says what to do.
//!
//! ```no_run
//! use skillet_plant::{Answer, Description, Plant, Sample, socket};
//!
//! let mut plant = Plant::connect(
//!     &socket(Some("kitchen"))?,
//!     &Description { name: "point masses", n_joints: 7, ..Description::simulated(0.001) },
//! )?;
//! let (mut q, mut qd) = ([0.0; 7], [0.0; 7]);
//! loop {
//!     match plant.exchange(&Sample { q, qd, ..Sample::default() })? {
//!         Answer::Torque(tau) => {
//!             for i in 0..7 {
//!                 qd[i] += tau[i] * 0.001;
//!                 q[i] += qd[i] * 0.001;
//!             }
//!         }
//!         Answer::Reset(_) => {
//!             (q, qd) = ([0.0; 7], [0.0; 7]);
//!             plant.has_reset();
//!         }
//!         Answer::Hold => {}
//!         Answer::Stop => break,
//!     }
//! }
//! # Ok::<(), skillet_plant::PlantError>(())
//! ```

mod c;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use shm_types::cell::{Cell, CellError};
use shm_types::channel::ChannelError;
use shm_types::measures::Measures;
use shm_types::plant::line::Line;
use shm_types::plant::shared::follow;
use shm_types::plant::socket::{self, Buffer, Connection, LinkError, Message, SocketError};
use shm_types::plant::{
    MODE_HOLD, MODE_RESET, MODE_STOP, MODE_TRACK, PLANT_CAN_RESET, PLANT_DETERMINISTIC,
    PLANT_HAS_OBJECT, PLANT_POLLS, PLANT_SIMULATED, PlantCommand, PlantHello, PlantOutcome,
    PlantState, STATE_IN_CONTACT, STATE_OBJECT_SEEN, STATE_TOLD,
};
use shm_types::text;
use thiserror::Error;

pub use shm_types::MAX_JOINTS;

/// How long a plant looks for its controller.
const LOOK_FOR: Duration = Duration::from_secs(30);
/// A controller sends at least two messages a second; one that is silent for this long is stuck.
const SILENCE: Duration = Duration::from_secs(5);
/// Between two looks whether the process is to end.
const SLICE: Duration = Duration::from_millis(50);
/// A torque that no answer renewed acts for so many samples.
const REPEATS: u32 = 2;
/// The default name of the cell.
const CELL: &str = "skillet";

/// Why a plant cannot continue.
#[derive(Debug, Error)]
pub enum PlantError {
    #[error(transparent)]
    Cell(#[from] CellError),
    #[error(transparent)]
    Socket(#[from] SocketError),
    #[error("the controller refuses this plant: {0}")]
    Refused(String),
    #[error("the controller has ended or died: start it again, then this plant")]
    Gone,
    #[error(
        "the controller has been silent for {0:.0} s: it is stopped or stuck; continue or restart it"
    )]
    Silent(f64),
    /// Shared memory cannot be used; without `polls` the socket does.
    #[error(transparent)]
    Shared(#[from] ChannelError),
    #[error("the connection to the controller failed ({0}): start this plant again")]
    Link(LinkError),
}

impl From<LinkError> for PlantError {
    fn from(error: LinkError) -> Self {
        if error == LinkError::Gone { PlantError::Gone } else { PlantError::Link(error) }
    }
}

/// Where the controller of a cell waits: `$SKILLET_PLANT` where it is set, as by `skillet learn`, else the
/// socket of `cell`, or of the default one.
pub fn socket(cell: Option<&str>) -> Result<PathBuf, PlantError> {
    match std::env::var_os(socket::PLANT_VARIABLE) {
        Some(path) => Ok(path.into()),
        None => Ok(socket::path(&Cell::new(cell.unwrap_or(CELL))?)),
    }
}

/// What a plant is. What is left out is not compared with the controller's configuration.
#[derive(Clone, Copy, Debug)]
pub struct Description<'a> {
    pub name: &'a str,
    pub n_joints: usize,
    pub period_s: f64,
    /// Stepped in lockstep; a real one samples by its own clock.
    pub is_simulated: bool,
    /// It begins an episode by itself when asked.
    pub can_reset: bool,
    pub has_object: bool,
    /// Equal torques lead to equal samples, bit for bit.
    pub is_deterministic: bool,
    /// Whether a simulator with its own core polls shared memory for replies instead of sleeping.
    pub polls: bool,
    pub joint_names: &'a [&'a str],
    /// N·m.
    pub torque_limits: &'a [f64],
    /// SHA-256 of the URDF file the plant was made from.
    pub urdf_sha256: Option<[u8; 32]>,
    /// Where it rests, rad.
    pub q: [f64; MAX_JOINTS],
}

impl Description<'static> {
    pub const fn simulated(period_s: f64) -> Description<'static> {
        Description { is_simulated: true, can_reset: true, ..Description::real(period_s) }
    }

    pub const fn real(period_s: f64) -> Description<'static> {
        Description {
            name: "plant",
            n_joints: MAX_JOINTS,
            period_s,
            is_simulated: false,
            can_reset: false,
            has_object: false,
            is_deterministic: false,
            polls: false,
            joint_names: &[],
            torque_limits: &[],
            urdf_sha256: None,
            q: [0.0; MAX_JOINTS],
        }
    }
}

impl Description<'_> {
    fn hello(&self) -> PlantHello {
        let flags = [
            (self.is_simulated, PLANT_SIMULATED),
            (self.can_reset, PLANT_CAN_RESET),
            (self.has_object, PLANT_HAS_OBJECT),
            (self.is_deterministic, PLANT_DETERMINISTIC),
            (self.polls, PLANT_POLLS),
        ];
        let mut hello = PlantHello {
            name: text::pack(self.name),
            n_joints: self.n_joints as u64,
            flags: flags.iter().filter(|(is, _)| *is).map(|(_, flag)| flag).sum(),
            period_ns: (self.period_s * 1e9).round() as u64,
            urdf_sha256: self.urdf_sha256.unwrap_or_default(),
            q: self.q,
            ..PlantHello::EMPTY
        };
        for (field, name) in hello.joint_names.iter_mut().zip(self.joint_names) {
            *field = text::pack(name);
        }
        for (field, limit) in hello.tau_max.iter_mut().zip(self.torque_limits) {
            *field = *limit;
        }
        hello
    }
}

/// What was measured at one instant.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// The plant's time, ns; it grows from sample to sample. By default one period passes.
    pub t_ns: Option<u64>,
    /// Positions, rad, speeds, rad/s, and torques, N·m.
    pub q: [f64; MAX_JOINTS],
    pub qd: [f64; MAX_JOINTS],
    pub tau: [f64; MAX_JOINTS],
    pub object: Option<Object>,
}

/// The tracked object in the world.
#[derive(Clone, Copy, Debug)]
pub struct Object {
    /// Its centre, m.
    pub position: [f64; 3],
    /// Its orientation, a unit quaternion w, x, y, z.
    pub quaternion: [f64; 4],
    /// It touches the tip.
    pub in_contact: bool,
}

impl Default for Sample {
    fn default() -> Self {
        let still = [0.0; MAX_JOINTS];
        Sample { t_ns: None, q: still, qd: still, tau: still, object: None }
    }
}

/// What the controller wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// Apply these torques, N·m.
    Torque([f64; MAX_JOINTS]),
    /// Begin another episode, then say so by [`Plant::has_reset`]. A real arm is held by these torques
    /// meanwhile.
    Reset([f64; MAX_JOINTS]),
    /// There is no torque: a real arm holds itself, damped.
    Hold,
    /// The controller ends cleanly.
    Stop,
}

/// A plant that its controller has let in.
pub struct Plant {
    line: Line<PlantState, PlantCommand>,
    buffer: Buffer,
    period_ns: u64,
    state: PlantState,
    /// Asked for; begun is `state.episode`.
    wanted: u64,
    rollout: u64,
    /// The newest answer, and how many samples it has served.
    command: Option<PlantCommand>,
    n_repeats: u32,
    /// Flags of the next sample by what was told before it.
    told: u64,
}

impl Plant {
    /// Waits for the controller at `path`, see [`socket()`], and introduces the plant.
    pub fn connect(path: &Path, description: &Description) -> Result<Plant, PlantError> {
        let hello = description.hello();
        let link = Connection::connect(path, LOOK_FOR)?;
        // A controller that hangs up at once has said why.
        let sent = link.send(&hello);
        let mut buffer = Buffer::new();
        let invitation = match link.receive(&mut buffer, SILENCE)? {
            Some(Message::Welcome(welcome)) if welcome.accepted == 1 => {
                text::unpack(&welcome.reason)
            }
            Some(Message::Welcome(welcome)) => {
                return Err(PlantError::Refused(text::unpack(&welcome.reason)));
            }
            Some(_) => return Err(PlantError::Refused("it did not reply with a Welcome".into())),
            None => return Err(PlantError::Silent(SILENCE.as_secs_f64())),
        };
        sent?;
        // A controller may know nothing of shared memory, or have none.
        let is_invited = description.polls && !invitation.is_empty();
        let shared = is_invited.then(|| follow(&invitation)).transpose()?;
        let line = Line::new(Arc::new(link), shared);
        let state = PlantState { q: hello.q, ..PlantState::EMPTY };
        let period_ns = hello.period_ns;
        Ok(Plant {
            line,
            buffer,
            period_ns,
            state,
            wanted: 0,
            rollout: 0,
            command: None,
            n_repeats: 0,
            told: 0,
        })
    }

    /// Sends a simulator's sample and waits for the reply. Time stands still meanwhile.
    pub fn exchange(&mut self, sample: &Sample) -> Result<Answer, PlantError> {
        self.exchange_unless(sample, &AtomicBool::new(false))
    }

    /// The same of a process that may be told to end while time stands still: [`Answer::Stop`] once `is_over`.
    pub fn exchange_unless(
        &mut self,
        sample: &Sample,
        is_over: &AtomicBool,
    ) -> Result<Answer, PlantError> {
        self.send(sample)?;
        let mut heard = Instant::now();
        while heard.elapsed() < SILENCE {
            if is_over.load(Ordering::Relaxed) {
                return Ok(Answer::Stop);
            }
            let received = self.line.receive_answer(&mut self.buffer, SLICE)?;
            let Some(command) = command_of(received)? else { continue };
            heard = Instant::now();
            // A sign of life in between answers nothing.
            let is_answer = command.answers_seq == self.state.seq && command.mode != MODE_HOLD;
            if is_answer || command.mode == MODE_STOP {
                return Ok(self.answer_of(&command));
            }
        }
        Err(PlantError::Silent(SILENCE.as_secs_f64()))
    }

    /// Sends a real arm's sample without waiting.
    pub fn send(&mut self, sample: &Sample) -> Result<(), PlantError> {
        let state = &mut self.state;
        state.seq += 1;
        state.t_ns = sample.t_ns.unwrap_or(state.t_ns + self.period_ns);
        (state.q, state.qd, state.tau) = (sample.q, sample.qd, sample.tau);
        state.flags = std::mem::take(&mut self.told);
        if let Some(object) = &sample.object {
            state.flags |= STATE_OBJECT_SEEN;
            state.flags |= if object.in_contact { STATE_IN_CONTACT } else { 0 };
            (state.object_position, state.object_quaternion) = (object.position, object.quaternion);
        }
        // The first one ends the introduction.
        match self.state.seq {
            1 => self.line.socket().send(&self.state)?,
            _ => self.line.send(&self.state)?,
        };
        Ok(())
    }

    /// The next action of a real arm: the reply to the last sample if it arrives within `patience`. Without
    /// a reply the last torque acts for two samples at most; then it is up to the arm to hold itself.
    pub fn answer(&mut self, patience: Duration) -> Result<Answer, PlantError> {
        let start = Instant::now();
        loop {
            let left = patience.saturating_sub(start.elapsed());
            match self.receive(left)? {
                Some(command) if command.mode == MODE_STOP => return Ok(Answer::Stop),
                Some(command) if command.answers_seq == self.state.seq => {
                    (self.command, self.n_repeats) = (Some(command), 0);
                    return Ok(self.answer_of(&command));
                }
                // Late: worth as much as none.
                Some(_) => {}
                None if left.is_zero() => break,
                None => {}
            }
        }
        self.state.n_unanswered += 1;
        self.n_repeats += 1;
        let is_worth = |command: &PlantCommand| {
            self.n_repeats <= REPEATS && self.state.t_ns <= command.expires_ns
        };
        Ok(match self.command.filter(is_worth) {
            Some(command) => self.answer_of(&command),
            None => Answer::Hold,
        })
    }

    /// The episode that was asked for has begun; the next sample is its first.
    pub fn has_reset(&mut self) {
        self.state.episode = self.wanted;
    }

    /// The session's rollout that was asked for last; a world that varies draws by it.
    pub fn rollout(&self) -> u64 {
        self.rollout
    }

    /// Samples that were not answered in time.
    pub fn unanswered(&self) -> u64 {
        self.state.n_unanswered
    }

    /// What only the plant can measure of the episode in progress; before its last sample.
    pub fn tell(&mut self, measures: &Measures) -> Result<(), PlantError> {
        self.line.socket().send(&PlantOutcome::new(self.state.episode, measures))?;
        self.told = STATE_TOLD;
        Ok(())
    }

    fn receive(&mut self, patience: Duration) -> Result<Option<PlantCommand>, PlantError> {
        command_of(self.line.socket().receive(&mut self.buffer, patience)?)
    }

    fn answer_of(&mut self, command: &PlantCommand) -> Answer {
        (self.wanted, self.rollout) = (command.episode, command.rollout);
        match command.mode {
            MODE_TRACK => Answer::Torque(command.tau),
            MODE_RESET => Answer::Reset(command.tau),
            MODE_STOP => Answer::Stop,
            _ => Answer::Hold,
        }
    }
}

fn command_of(message: Option<Message>) -> Result<Option<PlantCommand>, PlantError> {
    match message {
        Some(Message::Command(command)) => Ok(Some(*command)),
        Some(Message::Welcome(welcome)) => Err(PlantError::Refused(text::unpack(&welcome.reason))),
        Some(_) | None => Ok(None),
    }
}
