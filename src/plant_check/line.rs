//! The controller's end of the protocol, one message at a time.

use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use physics::arm::JointVector;
use shm_types::plant::line::Line as PlantLine;
use shm_types::plant::socket::{Buffer, Message};
use shm_types::plant::{MODE_HOLD, MODE_RESET, MODE_TRACK, PlantCommand, PlantOutcome, PlantState};

/// What a plant may take for a sample, or to make another world.
const PATIENCE: Duration = Duration::from_secs(5);

pub struct Line {
    line: PlantLine<PlantCommand, PlantState>,
    buffer: Buffer,
    pub state: PlantState,
    episode: u64,
    /// Times from a command to its sample.
    pub round_trips: Vec<Duration>,
}

impl Line {
    /// With the first sample.
    pub fn begin(line: PlantLine<PlantCommand, PlantState>) -> Result<Line> {
        let (buffer, state) = (Buffer::new(), PlantState::EMPTY);
        let mut line = Line { line, buffer, state, episode: 0, round_trips: Vec::new() };
        line.state = line.first()?;
        line.episode = line.state.episode;
        Ok(line)
    }

    /// The one that ends the introduction comes over the socket.
    fn first(&mut self) -> Result<PlantState> {
        match self.line.socket().receive(&mut self.buffer, PATIENCE)? {
            Some(Message::State(state)) => Ok(*state),
            Some(other) => bail!("expected its first sample, got {other:?}"),
            None => bail!("no sample within {} s", PATIENCE.as_secs()),
        }
    }

    /// The next sample, whatever its number.
    pub fn sample(&mut self) -> Result<PlantState> {
        match self.within(PATIENCE)? {
            Some(state) => Ok(state),
            None => bail!("no sample within {} s", PATIENCE.as_secs()),
        }
    }

    /// A sample that comes within `patience`.
    pub fn within(&mut self, patience: Duration) -> Result<Option<PlantState>> {
        let start = Instant::now();
        loop {
            let left = patience.saturating_sub(start.elapsed());
            let message = self.line.receive_answer(&mut self.buffer, left);
            match message.context("receiving a sample")? {
                Some(Message::State(state)) => return Ok(Some(*state)),
                Some(Message::Outcome(PlantOutcome { .. })) => {}
                Some(other) => bail!("expected a sample, got {other:?}"),
                None if left.is_zero() => return Ok(None),
                None => {}
            }
        }
    }

    /// Answers the last sample with `tau`.
    pub fn answer(&self, tau: &JointVector) -> Result<()> {
        self.command(self.state.seq, MODE_TRACK, tau)
    }

    /// An answer to another sample than the last one.
    pub fn answer_to(&self, seq: u64, tau: &JointVector) -> Result<()> {
        self.command(seq, MODE_TRACK, tau)
    }

    pub fn sign_of_life(&self) -> Result<()> {
        self.command(0, MODE_HOLD, &JointVector::zeros())
    }

    fn command(&self, answers_seq: u64, mode: u64, tau: &JointVector) -> Result<()> {
        let expires_ns = self.state.t_ns.saturating_add(3_000_000);
        let episode = self.episode;
        let tau: [f64; 7] = (*tau).into();
        let command =
            PlantCommand { answers_seq, episode, mode, expires_ns, tau, ..PlantCommand::HOLD };
        self.line.send(&command).context("sending a command")?;
        Ok(())
    }

    /// One step in lockstep.
    pub fn step(&mut self, tau: &JointVector) -> Result<PlantState> {
        let start = Instant::now();
        self.answer(tau)?;
        self.state = self.sample()?;
        self.round_trips.push(start.elapsed());
        Ok(self.state)
    }

    /// Another episode, in lockstep.
    pub fn reset(&mut self) -> Result<PlantState> {
        self.episode += 1;
        self.command(self.state.seq, MODE_RESET, &JointVector::zeros())?;
        self.state = self.sample()?;
        if self.state.episode != self.episode {
            bail!("it replied with episode {} instead of {}", self.state.episode, self.episode);
        }
        Ok(self.state)
    }
}

pub fn q(state: &PlantState) -> JointVector {
    JointVector::from(state.q)
}

pub fn qd(state: &PlantState) -> JointVector {
    JointVector::from(state.qd)
}
