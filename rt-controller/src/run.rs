//! Runs the controller of an arm: the rt thread is in here.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use physics::arm::{ArmModel, JointVector};
use physics::outcome::OutcomeConfig;
use physics::plant::Plant;
use rtrb::{Consumer, Producer, PushError};
use shm_types::cell::{Cell, CellError};
use shm_types::channel::{ChannelError, EpisodeLoan};
use shm_types::episode::TickRecord;
use shm_types::policy::PolicyMsg;
use shm_types::telemetry::TelemetryTick;
use thiserror::Error;

use crate::admission::{admit, records_needed};
use crate::config::{ControllerConfig, ControllerConfigError, Pace};
use crate::exchange::Setup;
use crate::outcome_message::outcome_message;
use crate::policy::Policy;
use crate::rollout::Phase;
use crate::rt::{self, Clock, Wake};
use crate::serve::{Done, Job, serve};
use crate::tick::Controller;
use crate::timing::Percentiles;

/// How long an unpaced loop sleeps while there is nothing to do.
const IDLE_SLEEP: Duration = Duration::from_micros(100);

/// Why a controller ended with an error.
#[derive(Debug, Error)]
pub enum RunError {
    #[error(transparent)]
    Config(#[from] ControllerConfigError),
    #[error(transparent)]
    Cell(#[from] CellError),
    #[error(transparent)]
    Channel(#[from] ChannelError),
    #[error("the rt thread panicked: {0}; this is a bug, please report it")]
    Panic(String),
}

/// What a controller did until it was stopped.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunSummary {
    pub rollouts: u64,
    pub policies_refused: u64,
    pub ticks: u64,
    pub deadline_misses: u64,
    /// Only meaningful when paced by the wall clock.
    pub wakeup: Percentiles,
    pub tick: Percentiles,
}

/// What a controller drives, and how.
pub struct Controlled<'a, P: Plant> {
    pub model: &'a ArmModel,
    pub plant: &'a mut P,
    /// Start posture, rad.
    pub q0: JointVector,
    pub outcome: OutcomeConfig,
}

/// Runs until `stop` is set, by a signal or by a stop command. Holds the cell's controller lock.
pub fn run<P: Plant>(
    cell: &Cell,
    config: &ControllerConfig,
    pace: Pace,
    controlled: Controlled<P>,
    stop: &AtomicBool,
) -> Result<RunSummary, RunError> {
    config.validate()?;
    let privileged = AtomicBool::new(false);
    let Controlled { model, plant, q0, outcome } = controlled;
    let admit = |message: &PolicyMsg| {
        let policy = admit(message, model, config)?;
        Ok((policy, records_needed(message.duration_s, config)))
    };
    let period_ns = u64::from(config.period_us) * 1000;
    let setup = Setup { admit: &admit, period_ns, pace, privileged: &privileged };
    serve(cell, setup, stop, |ends| {
        let rt_loop = RtLoop {
            controller: Controller::new(model, &q0, config, &outcome),
            plant,
            jobs: ends.jobs,
            done: ends.done,
            telemetry: ends.telemetry,
            running: None,
            undelivered: None,
            scratch: TickRecord::ZERO,
        };
        match pace {
            Pace::Realtime => {
                let granted = rt::acquire(config.priority, config.cpu);
                for missing in &granted.missing {
                    tracing::warn!("real time is degraded: {missing}");
                }
                privileged.store(granted.fifo, Ordering::Relaxed);
                rt_loop.run_paced(period_ns, stop);
            }
            Pace::Max => rt_loop.run_unpaced(stop),
        }
    })
}

/// A rollout in progress.
struct Running {
    episode: EpisodeLoan,
    n_records: usize,
    applied_tick: u64,
}

/// The rt thread: measure, tick, apply, advance, record.
struct RtLoop<'a, P: Plant> {
    controller: Controller<'a>,
    plant: &'a mut P,
    jobs: Consumer<Job<Policy>>,
    done: Producer<Done>,
    telemetry: Producer<TelemetryTick>,
    running: Option<Running>,
    undelivered: Option<Done>,
    /// Takes the ticks outside Execute and Settle.
    scratch: TickRecord,
}

impl<P: Plant> RtLoop<'_, P> {
    fn run_paced(mut self, period_ns: u64, stop: &AtomicBool) {
        let mut clock = Clock::new(period_ns);
        while !stop.load(Ordering::Relaxed) {
            let wake = clock.wait();
            self.begin_if_asked();
            self.cycle(wake);
        }
    }

    fn run_unpaced(mut self, stop: &AtomicBool) {
        while !stop.load(Ordering::Relaxed) {
            self.begin_if_asked();
            if self.running.is_none() {
                std::thread::sleep(IDLE_SLEEP);
                continue;
            }
            self.cycle(Wake { late_ns: 0, missed: 0 });
        }
    }

    fn begin_if_asked(&mut self) {
        if self.running.is_some() {
            return;
        }
        if let Some(done) = self.undelivered.take() {
            self.deliver(done);
        }
        if let Ok(job) = self.jobs.pop() {
            // A simulator builds a fresh world here; a robot does nothing.
            self.plant.reset();
            self.controller.start(&job.policy, &self.plant.measure().q);
            self.running = Some(Running { episode: job.episode, n_records: 0, applied_tick: 0 });
        }
    }

    fn cycle(&mut self, wake: Wake) {
        let measured = self.plant.measure();
        let executing = matches!(self.controller.phase(), Phase::Execute | Phase::Settle);
        let record = match &mut self.running {
            Some(running) if executing => {
                if running.n_records == 0 {
                    running.applied_tick = self.controller.tick_number();
                }
                let record = running.episode.payload_mut().get_mut(running.n_records);
                running.n_records += usize::from(record.is_some());
                record.unwrap_or(&mut self.scratch)
            }
            _ => &mut self.scratch,
        };

        let start = Instant::now();
        let tau = self.controller.tick(&measured, record);
        let tick_ns = start.elapsed().as_nanos() as u64;
        // Full ring: the observer loses a tick, the loop nothing.
        let _ = self.telemetry.push(TelemetryTick {
            tick: record.tick,
            phase: record.phase,
            fault: record.fault,
            wakeup_ns: wake.late_ns,
            tick_ns,
            missed: wake.missed,
            q: record.q,
            tau: record.tau,
        });

        self.plant.apply(&tau);
        self.plant.advance();
        if self.controller.phase() == Phase::Idle
            && let Some(running) = self.running.take()
        {
            self.deliver(Done {
                episode: running.episode,
                n_records: running.n_records,
                applied_tick: running.applied_tick,
                fault: self.controller.fault() as u32,
                outcome: outcome_message(&self.controller.outcome()),
            });
        }
    }

    /// Hands an episode over. The ring has a place for every loan, so it is never full; should it
    /// be, the episode waits: dropping it here would call the transport.
    fn deliver(&mut self, done: Done) {
        if let Err(PushError::Full(done)) = self.done.push(done) {
            self.undelivered = Some(done);
        }
    }
}
