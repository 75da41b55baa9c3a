//! The rt thread: wait, measure, tick, apply, advance, record.
//!
//! It shares rings with the exchange thread and nothing else. What it holds of the transport is the
//! memory of one episode, which it fills and gives back.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use physics::plant::{Plant, Presence};
use rtrb::PushError;
use shm_types::channel::EpisodeLoan;
use shm_types::episode::TickRecord;
use shm_types::measures::Measures;
use shm_types::telemetry::TelemetryTick;

use crate::config::ControllerConfig;
use crate::executor::flight::{FlightRecord, FlightTick};
use crate::executor::latch::Latch;
use crate::executor::recording::Recording;
use crate::fault::Fault;
use crate::hot::policy::Policy;
use crate::hot::posture::PostureMove;
use crate::hot::rollout::Phase;
use crate::hot::tick::Controller;
use crate::rings::{Applied, Done, Ends, Job, PostureOrder, PostureTaken};
use crate::rt::{Clock, Wake, now_ns};

/// How long an unpaced loop sleeps while there is nothing to do.
const IDLE_SLEEP: Duration = Duration::from_micros(100);
/// A plant that is the clock is waited for so many periods; then the loop ticks without a new sample.
const PATIENCE_PERIODS: u32 = 2;
/// Ticks in time after which an overrun is over.
const PROBATION_TICKS: u32 = 500;

/// A rollout in progress.
struct Running {
    episode: EpisodeLoan,
    recording: Recording,
    /// The swap that it fulfils, until acknowledged.
    swap: Option<u64>,
    is_experiment: bool,
}

pub(crate) struct RtLoop<'a, P: Plant> {
    controller: Controller<'a>,
    plant: &'a mut P,
    ends: Ends<Policy>,
    /// The next rollout, while the plant is put back to its start.
    preparing: Option<Job<Policy>>,
    /// The plant was asked to be put back for it.
    is_reset: bool,
    running: Option<Running>,
    undelivered: Option<Done>,
    /// Digest of the policy in the controller, for observers.
    policy_digest: u64,
    /// The newest one, for rollouts that are no experiments.
    posture: PostureOrder,
    latch: &'a Latch,
    flight: Box<FlightRecord>,
    /// Takes the ticks outside Execute and Settle.
    scratch: TickRecord,
    record_stride: usize,
    overruns_max: u32,
    /// Ticks in time before the next rollout may begin.
    n_probation: u32,
    period: Duration,
    /// What the plant itself measured of a rollout that has ended.
    outcome: fn(&mut P) -> Measures,
}

impl<'a, P: Plant> RtLoop<'a, P> {
    pub fn new(
        mut controller: Controller<'a>,
        plant: &'a mut P,
        ends: Ends<Policy>,
        latch: &'a Latch,
        config: &ControllerConfig,
        outcome: fn(&mut P) -> Measures,
    ) -> RtLoop<'a, P> {
        // A restart does not re-arm.
        if let Some(fault) = latch.fault() {
            controller.trip(fault);
        }
        RtLoop {
            controller,
            plant,
            ends,
            preparing: None,
            is_reset: false,
            running: None,
            undelivered: None,
            policy_digest: 0,
            posture: PostureOrder { seq: 0, to: PostureMove::NONE },
            latch,
            flight: Box::new(FlightRecord::new()),
            scratch: TickRecord::ZERO,
            record_stride: config.record_stride(),
            overruns_max: config.overruns_max,
            n_probation: 0,
            period: Duration::from_nanos(config.period_ns()),
            outcome,
        }
    }

    pub fn run_paced(mut self, mut clock: Clock, stop: &AtomicBool) {
        while !stop.load(Ordering::Relaxed) {
            let wake = clock.wait();
            self.watch_deadlines(wake.overruns);
            self.step(wake);
        }
    }

    /// By a plant that is the clock. One that is late is held as one whose samples do not come.
    pub fn run_by_plant(mut self, stop: &AtomicBool) {
        while !stop.load(Ordering::Relaxed) {
            self.plant.wait(self.period * PATIENCE_PERIODS);
            self.step(Wake::UNPACED);
        }
    }

    /// A tick, if there is a sample to answer, or one is missing that should be there.
    fn step(&mut self, wake: Wake) {
        if matches!(self.take_orders(), Presence::There | Presence::Lost) {
            self.cycle(wake);
        }
    }

    /// Rollouts and policies that were asked for. A simulator may take its time to make another world; then
    /// there is no tick before the rollout begins in it.
    fn take_orders(&mut self) -> Presence {
        self.move_posture_if_asked();
        if self.look() == Presence::There {
            self.begin_if_asked();
            self.swap_if_asked();
        }
        let presence = self.look();
        if presence == Presence::There && self.preparing.is_some() {
            self.begin_if_asked();
        }
        presence
    }

    fn look(&mut self) -> Presence {
        let presence = self.plant.presence();
        self.latch.set_absent(presence == Presence::Absent);
        if presence == Presence::Lost {
            self.controller.lose_plant();
        }
        if matches!(presence, Presence::Busy | Presence::Absent) {
            // Nothing ticks; a hold or a re-arm that is asked for is answered all the same.
            self.latch.follow(&mut self.controller);
        }
        presence
    }

    /// Too many deadlines missed in a row hold the arm, and no rollout begins before the loop has
    /// kept its time again for a while: a host that overruns and overruns executes nothing.
    fn watch_deadlines(&mut self, overruns: u32) {
        if overruns >= self.overruns_max {
            self.controller.trip(Fault::Overrun);
            self.n_probation = PROBATION_TICKS;
        } else if overruns == 0 {
            self.n_probation = self.n_probation.saturating_sub(1);
        }
    }

    pub fn run_unpaced(mut self, stop: &AtomicBool) {
        while !stop.load(Ordering::Relaxed) {
            let presence = self.take_orders();
            match (&self.running, self.controller.latched()) {
                _ if presence == Presence::Busy => continue,
                _ if presence == Presence::Absent => {
                    std::thread::sleep(self.period);
                    continue;
                }
                _ if presence == Presence::Lost => std::thread::sleep(self.period),
                (Some(_), _) => {}
                (None, None) if self.preparing.is_some() => std::thread::sleep(self.period),
                (None, None) if !self.latch.is_hold_asked() => {
                    std::thread::sleep(IDLE_SLEEP);
                    continue;
                }
                // A held arm is watched: whether it may be re-armed is seen in its ticks.
                (None, _) => std::thread::sleep(self.period),
            }
            self.cycle(Wake::UNPACED);
        }
    }

    fn begin_if_asked(&mut self) {
        if self.running.is_some() {
            return;
        }
        if let Some(done) = self.undelivered.take() {
            self.deliver(done);
        }
        if self.controller.latched().is_some() || self.n_probation > 0 {
            // What was put back to its start may be another plant by now, or have been moved since.
            self.is_reset = false;
            return;
        }
        if self.preparing.is_none() {
            self.preparing = self.ends.jobs.pop().ok();
        }
        if let Some(job) = self.preparing.as_ref().filter(|_| !self.is_reset) {
            self.is_reset = true;
            self.plant.announce(job.rollout);
            self.plant.begin_reset();
            if self.plant.is_simulated() {
                self.controller.enter_fresh_world();
            }
        }
        if let Some(job) = self.preparing.take_if(|_| self.plant.is_ready()) {
            self.is_reset = false;
            // An order may have come after this job, and a full ring may have taken none before it.
            if job.posture.seq > self.posture.seq {
                self.posture = job.posture;
            }
            self.controller.move_posture(match job.is_experiment {
                true => &PostureMove::NONE,
                false => &self.posture.to,
            });
            self.controller.start(&job.policy);
            self.policy_digest = job.policy_digest;
            let recording = Recording::new(self.record_stride);
            self.running = Some(Running {
                episode: job.episode,
                recording,
                swap: job.swap,
                is_experiment: job.is_experiment,
            });
        }
    }

    fn swap_if_asked(&mut self) {
        if let Ok(swap) = self.ends.swaps.pop() {
            self.controller.swap(&swap.policy);
            self.policy_digest = swap.policy_digest;
            self.acknowledge(swap.seq, self.controller.tick_number(), now_ns());
        }
    }

    /// A learner's rollout is what its session says, whatever a person does to the arm's posture.
    fn move_posture_if_asked(&mut self) {
        while let Ok(order) = self.ends.postures.pop() {
            if order.seq > self.posture.seq {
                self.posture = order;
                if self.running.as_ref().is_some_and(|running| !running.is_experiment) {
                    self.controller.move_posture(&order.to);
                }
            }
            let (seq, tick, at_ns) = (order.seq, self.controller.tick_number(), now_ns());
            // Never full: as many places as orders.
            let _ = self.ends.postures_taken.push(PostureTaken { seq, tick, at_ns });
        }
    }

    /// Says that from `tick` on the policy acts that the controller now holds.
    fn acknowledge(&mut self, seq: u64, tick: u64, at_ns: u64) {
        let applied = Applied {
            seq,
            tick,
            at_ns,
            in_rollout: self.running.is_some(),
            policy: *self.controller.policy(),
        };
        // Never full: one swap is under way at a time.
        let _ = self.ends.applied.push(applied);
    }

    fn cycle(&mut self, wake: Wake) {
        let measured = self.plant.measure();
        let mut fulfilled = None;
        let record = self.running.as_mut().and_then(|running| {
            let begins = running.recording.begins(&self.controller);
            let record = running.recording.next(&self.controller, running.episode.payload_mut());
            if begins && let Some(seq) = running.swap.take() {
                fulfilled =
                    Some((seq, running.recording.applied_tick, running.recording.applied_ns));
            }
            record
        });
        let record = record.unwrap_or(&mut self.scratch);

        let fault_before = self.controller.fault();
        let start = Instant::now();
        let tau = self.controller.tick(&measured, record);
        let tick_ns = start.elapsed().as_nanos() as u64;
        // Full ring: the observer loses a tick, the loop nothing.
        let _ = self.ends.telemetry.push(TelemetryTick {
            record: *record,
            policy_digest: self.policy_digest,
            wakeup_ns: wake.late_ns,
            tick_ns,
            missed: wake.missed,
        });
        let force = self.controller.unexplained_force();
        self.flight.push(FlightTick::new(record, &measured, force, &tau, wake.late_ns));
        if record.fault != fault_before as u32 {
            self.hand_over_flight();
        }

        self.plant.apply(&tau);
        self.latch.follow(&mut self.controller);
        if let Some((seq, tick, at_ns)) = fulfilled {
            self.acknowledge(seq, tick, at_ns);
        }
        if self.plant.is_simulated() {
            self.plant.advance();
        }
        if self.controller.phase() == Phase::Idle
            && let Some(running) = self.running.take()
        {
            let measures = (self.outcome)(self.plant);
            self.deliver(Done {
                episode: running.episode,
                recording: running.recording,
                fault: self.controller.fault(),
                measures,
            });
        }
    }

    /// Hands the flight record over after a fault. That of an experiment's own fault is not worth
    /// one: its episode holds these ticks. Where no spare box is, the ticks go on into this one.
    fn hand_over_flight(&mut self) {
        let fault = self.controller.fault();
        let is_experiment = self.running.as_ref().is_some_and(|running| running.is_experiment);
        if !fault.latches() && (is_experiment || !fault.blames_policy()) {
            return;
        }
        if let Ok(spare) = self.ends.spare_flights.pop() {
            let full = std::mem::replace(&mut self.flight, spare);
            // Never full: there are two boxes.
            let _ = self.ends.flights.push(full);
        }
    }

    /// Hands an episode over. The ring has a place for every loan, so it is never full; should it
    /// be, the episode waits: dropping it here would call the transport.
    fn deliver(&mut self, done: Done) {
        if let Err(PushError::Full(done)) = self.ends.done.push(done) {
            self.undelivered = Some(done);
        }
    }
}
