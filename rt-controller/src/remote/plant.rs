//! The rt thread's end: a plant that is stepped, or listened to, through a connection.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use physics::arm::JointVector;
use physics::plant::{Measurement, ObjectState, Plant, Presence};
use shm_types::MAX_JOINTS;
use shm_types::measures::Measures;
use shm_types::plant::socket::{Buffer, LinkError, Message, SocketError};
use shm_types::plant::{
    KIND_COMMAND, MODE_RESET, MODE_TRACK, PlantCommand, PlantOutcome, PlantState, STATE_IN_CONTACT,
    STATE_TOLD,
};

use crate::remote::door::{Door, DoorThread};
use crate::remote::expected::{Expected, External};
use crate::remote::{Arrival, ControllerLine, Departure, Ended, Ends, PlantName, rings};

/// How long the loop waits for a simulator before it looks at everything else.
const SLICE: Duration = Duration::from_millis(50);
/// Between two looks whether a plant has come.
const LOOK: Duration = Duration::from_millis(5);
/// Samples that are taken at once after a pause of the loop.
const MAX_WAITING: usize = 64;
/// A torque for a real arm is worth something for so many periods.
const WORTH_PERIODS: u64 = 3;
/// Between the last sample of one plant and the first of the next one, ns: long enough that the two are not
/// compared.
const CHANGE_NS: u64 = 1_000_000_000;

/// How far from the start posture an episode may begin, rad, and how fast, rad/s.
const START_TOLERANCE: f64 = 0.01;
/// By how much the square of a unit quaternion's norm may differ from 1.
const UNIT: f64 = 1e-6;

pub struct RemotePlant {
    ends: Ends,
    name: PlantName,
    /// Where it comes to; closed with this.
    _door: DoorThread,
    is_simulated: bool,
    period_ns: u64,
    /// Where a simulator's episodes begin, rad.
    q0: JointVector,
    n_joints: usize,
    line: Option<ControllerLine>,
    buffer: Buffer,
    /// The newest sample; none before the first plant has come.
    state: Option<PlantState>,
    /// It was not answered yet.
    is_new: bool,
    /// A command was sent whose sample is to come.
    is_stepping: bool,
    /// The loop knows that the last plant is gone; before that it gets no other.
    is_loss_known: bool,
    /// Episode that is to be, or is, in progress, and the session's rollout that it is.
    wanted: u64,
    rollout: u64,
    /// From the plant's clock to ours: plants may follow each other, time goes on.
    offset_ns: u64,
    n_samples: u64,
    n_lost: u64,
    tau: [f64; MAX_JOINTS],
    outcome: Measures,
}

impl RemotePlant {
    /// Opens the door to a plant that is in lockstep, its episodes beginning at `q0`, rad, or to a real one.
    /// `boot_id` is that of the controller. Call with the lock of the cell held whose socket it is.
    pub fn open(
        external: External,
        q0: &JointVector,
        boot_id: u64,
    ) -> Result<RemotePlant, SocketError> {
        let (ends, door_ends) = rings();
        let Expected { is_simulated, period_ns, ref joint_names, .. } = external.expected;
        let (n_joints, name) = (joint_names.len(), PlantName::none());
        Ok(RemotePlant {
            ends,
            name: name.clone(),
            _door: Door::open(external, boot_id, door_ends, name)?,
            is_simulated,
            period_ns,
            q0: *q0,
            n_joints,
            line: None,
            buffer: Buffer::new(),
            state: None,
            is_new: false,
            is_stepping: false,
            is_loss_known: true,
            wanted: 0,
            rollout: 0,
            offset_ns: 0,
            n_samples: 0,
            n_lost: 0,
            tau: [0.0; MAX_JOINTS],
            outcome: Measures::NONE,
        })
    }

    pub(crate) fn name(&self) -> PlantName {
        self.name.clone()
    }

    /// Whether it has come within `patience`; for those who have no loop to look.
    pub fn has_come(&mut self, patience: Duration) -> bool {
        let start = Instant::now();
        while start.elapsed() < patience {
            if self.presence() == Presence::There {
                return true;
            }
            std::thread::sleep(LOOK);
        }
        false
    }

    fn take(&mut self, arrival: Arrival) {
        let last_ns = self.state.map(|state| state.t_ns.wrapping_add(self.offset_ns));
        self.offset_ns =
            last_ns.map_or(0, |last| (last + CHANGE_NS).wrapping_sub(arrival.state.t_ns));
        self.line = Some(arrival.line);
        self.accept(arrival.state);
        self.wanted = arrival.state.episode;
    }

    fn accept(&mut self, state: PlantState) {
        self.n_samples += 1;
        self.state = Some(state);
        (self.is_new, self.is_stepping) = (true, false);
    }

    /// The connection is over, and the door told why.
    fn end(&mut self, why: Ended) {
        if let Some(line) = self.line.take() {
            // Never full: the next plant is let in once this one was seen off.
            let _ = self.ends.departures.push(Departure { why, _line: line });
            self.is_loss_known = false;
        }
        self.is_stepping = false;
    }

    fn send(&mut self, mode: u64) {
        let (Some(line), Some(state)) = (&self.line, &self.state) else { return };
        let command = PlantCommand {
            kind: KIND_COMMAND,
            answers_seq: state.seq,
            episode: self.wanted,
            rollout: self.rollout,
            mode,
            expires_ns: state.t_ns.saturating_add(WORTH_PERIODS * self.period_ns),
            n_lost: self.n_lost,
            tau: self.tau,
        };
        self.is_new = false;
        match line.send(&command) {
            Ok(is_taken) => self.is_stepping = is_taken && self.is_simulated,
            Err(error) => self.end(error.into()),
        }
    }

    /// Takes a message that comes within `patience`: whether there was one.
    fn receive(&mut self, patience: Duration) -> bool {
        let Some(line) = &mut self.line else { return false };
        let message = match self.is_simulated {
            true => line.receive_answer(&mut self.buffer, patience),
            false => line.socket().receive(&mut self.buffer, patience),
        };
        let received = match message {
            Ok(None) => return false,
            Ok(Some(Message::State(state))) => Ok(*state),
            Ok(Some(Message::Outcome(outcome))) => {
                self.outcome = told(outcome, self.wanted).unwrap_or(self.outcome);
                return true;
            }
            Ok(Some(_)) => Err(Ended::Message),
            Err(error) => Err(error.into()),
        };
        match received.and_then(|state| self.check(&state).map(|is_newer| (state, is_newer))) {
            Ok((state, true)) => {
                self.catch_up(&state);
                self.accept(state);
            }
            Ok((_, false)) => {}
            Err(why) => self.end(why),
        }
        true
    }

    /// Samples in shared memory overtake what the plant told over the socket before.
    fn catch_up(&mut self, state: &PlantState) {
        let has_told = state.flags & STATE_TOLD != 0;
        let Some(line) = self.line.as_ref().filter(|line| has_told && line.is_shared()) else {
            return;
        };
        // Whatever else is there, or its end, is found by the next look.
        if let Ok(Some(Message::Outcome(outcome))) =
            line.socket().receive(&mut self.buffer, Duration::ZERO)
        {
            self.outcome = told(outcome, self.wanted).unwrap_or(self.outcome);
        }
    }

    /// Whether it is newer than the last one. In lockstep there is no other; a real plant's may come twice
    /// or late.
    fn check(&mut self, new: &PlantState) -> Result<bool, Ended> {
        let Some(last) = &self.state else { return Ok(true) };
        if new.seq <= last.seq {
            if self.is_simulated {
                return Err(Ended::Sequence { found: new.seq, last: last.seq });
            }
            return Ok(false);
        }
        if new.t_ns <= last.t_ns {
            return Err(Ended::Time { found: new.t_ns, last: last.t_ns });
        }
        let was_asked_for =
            new.episode == self.wanted || (!self.is_simulated && new.episode == last.episode);
        if !was_asked_for {
            return Err(Ended::Episode { found: new.episode, wanted: self.wanted });
        }
        if !self.is_simulated {
            self.n_lost += new.seq - last.seq - 1;
        } else if new.episode != last.episode {
            self.check_start(new)?;
        }
        Ok(true)
    }

    /// The loop takes the arm to rest at its start posture in a fresh world.
    fn check_start(&self, new: &PlantState) -> Result<(), Ended> {
        for i in 0..self.n_joints {
            let (found, speed, wanted) = (new.q[i], new.qd[i], self.q0[i]);
            let is_there =
                (found - wanted).abs() < START_TOLERANCE && speed.abs() < START_TOLERANCE;
            if !is_there {
                return Err(Ended::Start { joint: i + 1, found, speed, wanted });
            }
        }
        Ok(())
    }

    /// Waits a moment for the sample that a step leads to, unless the plant is gone.
    fn finish_step(&mut self) {
        if self.ends.has_hung_up.load(Ordering::Acquire) && !self.is_stepping {
            self.end(LinkError::Gone.into());
        }
        if self.is_stepping {
            let start = Instant::now();
            while self.is_stepping && start.elapsed() < SLICE {
                self.receive(SLICE);
            }
        }
    }

    /// What the plant itself measured of the episode; once.
    pub fn take_outcome(&mut self) -> Measures {
        std::mem::replace(&mut self.outcome, Measures::NONE)
    }
}

/// What an Outcome of the episode that is `wanted` says; nothing, of another one.
fn told(outcome: &PlantOutcome, wanted: u64) -> Option<Measures> {
    (outcome.episode == wanted).then(|| outcome.measures())
}

impl Plant for RemotePlant {
    fn is_simulated(&self) -> bool {
        self.is_simulated
    }

    fn announce(&mut self, rollout: u64) {
        self.rollout = rollout;
    }

    fn begin_reset(&mut self) {
        self.wanted += 1;
        self.outcome = Measures::NONE;
        if self.is_simulated {
            self.send(MODE_RESET);
        }
    }

    fn is_ready(&self) -> bool {
        self.state.is_some_and(|state| state.episode == self.wanted)
    }

    fn measure(&self) -> Measurement {
        let state = self.state.unwrap_or(PlantState::EMPTY);
        let [w, i, j, k] = state.object_quaternion;
        // One that is no rotation counts as not a number: the loop holds the arm.
        let is_unit = (w * w + i * i + j * j + k * k - 1.0).abs() < UNIT;
        let w = if is_unit { w } else { f64::NAN };
        Measurement {
            q: JointVector::from_column_slice(&state.q),
            qd: JointVector::from_column_slice(&state.qd),
            object: ObjectState {
                p_WO: Vector3::from(state.object_position),
                R_WO: UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k)),
                in_contact: state.flags & STATE_IN_CONTACT != 0,
            },
            sample: self.n_samples,
            t_ns: state.t_ns.wrapping_add(self.offset_ns),
        }
    }

    /// A real arm gets it at once, a simulator with its next step.
    fn apply(&mut self, tau: &JointVector) {
        self.tau.copy_from_slice(tau.as_slice());
        if !self.is_simulated && self.is_new {
            self.send(if self.is_ready() { MODE_TRACK } else { MODE_RESET });
        }
    }

    fn advance(&mut self) {
        if !self.is_stepping {
            self.send(MODE_TRACK);
        }
        self.finish_step();
    }

    fn presence(&mut self) -> Presence {
        if !std::mem::replace(&mut self.is_loss_known, true) {
            return Presence::Lost;
        }
        if let Ok(arrival) = self.ends.arrivals.pop() {
            self.take(arrival);
        }
        self.finish_step();
        match (&self.line, &self.state) {
            (Some(_), Some(_)) if self.is_stepping => Presence::Busy,
            (Some(_), Some(_)) => Presence::There,
            (None, Some(_)) => Presence::Lost,
            (_, None) => Presence::Absent,
        }
    }

    fn wait(&mut self, longest: Duration) {
        let start = Instant::now();
        while self.line.is_some() && !self.is_new {
            match longest.checked_sub(start.elapsed()) {
                Some(left) => self.receive(left),
                None => break,
            };
        }
        if self.line.is_none() {
            std::thread::sleep(longest);
        }
        // Only the newest counts; one that floods the line holds nobody up.
        for _ in 0..MAX_WAITING {
            if !self.receive(Duration::ZERO) {
                break;
            }
        }
    }
}
