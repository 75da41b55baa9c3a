//! The exchange thread: everything iceoryx2, beside the loop and never in its way.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rtrb::{Consumer, Producer};
use shm_types::SCHEMA;
use shm_types::channel::EpisodeLoan;
use shm_types::command::{COMMAND_STOP, Command, Reply};
use shm_types::episode::EpisodeHeader;
use shm_types::policy::PolicyMsg;
use shm_types::ports::ControllerPorts;
use shm_types::telemetry::{Heartbeat, TelemetryTick};

use crate::admission::AdmissionError;
use crate::config::Pace;
use crate::loop_report::LoopReport;
use crate::request::{Request, boot_id};
use crate::run::RunSummary;
use crate::serve::{Done, Job};
use crate::tick::Fault;

const POLL: Duration = Duration::from_micros(200);
const BEAT: Duration = Duration::from_millis(100);
const HOUSEKEEPING: Duration = Duration::from_secs(1);

/// Checks a message; the policy to execute and the records it can fill.
type Admit<'a, P> = &'a dyn Fn(&PolicyMsg) -> Result<(P, usize), AdmissionError>;

/// What the exchange needs to know of its controller.
pub(crate) struct Setup<'a, P> {
    pub admit: Admit<'a, P>,
    pub period_ns: u64,
    pub pace: Pace,
    pub privileged: &'a AtomicBool,
}

pub(crate) struct Exchange<'a, P> {
    ports: ControllerPorts,
    setup: Setup<'a, P>,
    jobs: Producer<Job<P>>,
    done: Consumer<Done>,
    report: LoopReport,
    boot_id: u64,
    /// Received, not yet handed to the loop.
    pending: Option<PolicyMsg>,
    /// Said once, not with every attempt.
    loan_failed: bool,
    in_flight: Option<Request>,
    last: Request,
    applied_tick: u64,
    rollouts: u64,
    refused: u64,
    durable: (u64, u64),
    beat_counter: u64,
    learner_seen: Option<(Heartbeat, Instant)>,
}

impl<'a, P> Exchange<'a, P> {
    pub fn new(
        ports: ControllerPorts,
        setup: Setup<'a, P>,
        jobs: Producer<Job<P>>,
        done: Consumer<Done>,
        telemetry: Consumer<TelemetryTick>,
    ) -> Exchange<'a, P> {
        Exchange {
            ports,
            setup,
            jobs,
            done,
            report: LoopReport::new(telemetry),
            boot_id: boot_id(),
            pending: None,
            loan_failed: false,
            in_flight: None,
            last: Request::default(),
            applied_tick: 0,
            rollouts: 0,
            refused: 0,
            durable: (0, 0),
            beat_counter: 0,
            learner_seen: None,
        }
    }

    /// Serves the channels until `stop` is set or the rt thread has ended.
    pub fn run(&mut self, stop: &AtomicBool, rt_ended: impl Fn() -> bool) -> RunSummary {
        let mut next_beat = Instant::now();
        let mut next_housekeeping = Instant::now() + HOUSEKEEPING;
        while !stop.load(Ordering::Relaxed) && !rt_ended() {
            self.report.drain(&self.ports);
            self.send_episodes();
            self.receive_policies();
            self.hand_over();
            self.receive_acks_and_beats();
            if self.serve_commands() {
                stop.store(true, Ordering::Relaxed);
            }
            let now = Instant::now();
            if now >= next_beat {
                next_beat = now + BEAT;
                self.beat_counter += 1;
                let (boot_id, counter) = (self.boot_id, self.beat_counter);
                let _ = self.ports.beat.send_copy(Heartbeat { schema: SCHEMA, boot_id, counter });
            }
            if now >= next_housekeeping {
                next_housekeeping = now + HOUSEKEEPING;
                self.ports.clean_up();
            }
            std::thread::sleep(POLL);
        }
        self.report.drain(&self.ports);
        self.summary()
    }

    fn summary(&self) -> RunSummary {
        RunSummary {
            rollouts: self.rollouts,
            policies_refused: self.refused,
            ticks: self.report.stats.ticks,
            deadline_misses: self.report.stats.missed,
            wakeup: self.report.stats.wakeup(),
            tick: self.report.stats.tick(),
        }
    }

    fn send_episodes(&mut self) {
        while let Ok(mut done) = self.done.pop() {
            let Some(request) = self.in_flight.take() else {
                tracing::error!("an episode came back that was not asked for; dropped");
                continue;
            };
            self.applied_tick = done.applied_tick;
            self.rollouts += 1;
            *done.episode.user_header_mut() = EpisodeHeader {
                applied_tick: done.applied_tick,
                n_records: done.n_records as u64,
                fault: u64::from(done.fault),
                outcome: done.outcome,
                ..self.header(&request)
            };
            if done.fault != 0 {
                let why = Fault::describe(done.fault);
                tracing::info!(rollout = request.rollout, "rollout ended early: {why}");
            }
            self.send(request, done.episode);
        }
    }

    fn header(&self, request: &Request) -> EpisodeHeader {
        EpisodeHeader {
            boot_id: self.boot_id,
            session: request.session,
            rollout: request.rollout,
            policy_id: request.policy_id,
            policy_digest: request.digest,
            period_ns: self.setup.period_ns,
            ..EpisodeHeader::default()
        }
    }

    fn send(&mut self, request: Request, episode: EpisodeLoan) {
        self.last = request;
        match episode.send() {
            Ok(0) => tracing::warn!(
                rollout = request.rollout,
                "no learner took the episode; it will ask for the rollout again"
            ),
            Ok(_) => {
                let _ = self.ports.episode_sent.notify();
            }
            Err(error) => tracing::warn!(
                rollout = request.rollout,
                "episode not delivered ({error:?}); the learner will ask for the rollout again"
            ),
        }
    }

    /// Keeps the newest request. One that is in flight already is not started twice; one that has
    /// ended is run again, because only a learner that missed its episode asks again.
    fn receive_policies(&mut self) {
        while let Ok(Some(sample)) = self.ports.policies.receive() {
            let message = *sample;
            if self.in_flight == Some(Request::of(&message)) {
                continue;
            }
            self.pending = Some(message);
        }
    }

    /// Admits the pending policy and hands it to the loop, with memory for its records.
    fn hand_over(&mut self) {
        if self.in_flight.is_some() {
            return;
        }
        let Some(message) = self.pending.take() else { return };
        let request = Request::of(&message);
        let admitted = (self.setup.admit)(&message);
        // A refusal travels as an episode without records, but an episode it is.
        let n_records = admitted.as_ref().map_or(1, |(_, n_records)| (*n_records).max(1));
        let mut episode = match self.ports.loan_episode(n_records) {
            Ok(episode) => episode,
            Err(error) => {
                if !self.loan_failed {
                    tracing::warn!("{error}; trying again");
                    self.loan_failed = true;
                }
                self.pending = Some(message);
                return;
            }
        };
        self.loan_failed = false;
        match admitted {
            Ok((policy, _)) => match self.jobs.push(Job { policy, episode }) {
                Ok(()) => self.in_flight = Some(request),
                Err(_) => self.pending = Some(message),
            },
            Err(error) => {
                tracing::warn!(rollout = request.rollout, "policy refused: {error}");
                self.refused += 1;
                *episode.user_header_mut() =
                    EpisodeHeader { fault: Fault::PolicyRefused as u64, ..self.header(&request) };
                self.send(request, episode);
            }
        }
    }

    fn receive_acks_and_beats(&mut self) {
        while let Ok(Some(ack)) = self.ports.acks.receive() {
            if ack.schema == SCHEMA {
                self.durable = (ack.session, ack.durable_rollout);
            }
        }
        while let Ok(Some(beat)) = self.ports.learner_beat.receive() {
            if beat.schema == SCHEMA && self.learner_seen.is_none_or(|(last, _)| last != *beat) {
                self.learner_seen = Some((*beat, Instant::now()));
            }
        }
    }

    /// Returns true when asked to stop.
    fn serve_commands(&mut self) -> bool {
        let mut stop = false;
        while let Ok(Some(request)) = self.ports.commands.receive() {
            let command: Command = *request;
            let accepted = match command.validate() {
                Ok(()) => true,
                Err(error) => {
                    tracing::warn!("command refused: {error}");
                    false
                }
            };
            let _ = request.send_copy(self.reply(&command, accepted));
            stop |= accepted && command.kind == COMMAND_STOP;
        }
        stop
    }

    fn reply(&self, command: &Command, accepted: bool) -> Reply {
        let (wakeup, tick) = (self.report.stats.wakeup(), self.report.stats.tick());
        let active = self.in_flight.unwrap_or(self.last);
        let confirmed = if self.durable.0 == self.last.session { self.durable.1 } else { 0 };
        Reply {
            schema: SCHEMA,
            id: command.id,
            accepted: u64::from(accepted),
            boot_id: self.boot_id,
            tick: self.report.last.tick,
            // Without the wall clock nothing ticks between rollouts: the last tick is no news.
            phase: if self.in_flight.is_some() { u64::from(self.report.last.phase) } else { 0 },
            fault: u64::from(self.report.last.fault),
            period_ns: self.setup.period_ns,
            realtime: u64::from(self.setup.pace == Pace::Realtime),
            privileged: u64::from(self.setup.privileged.load(Ordering::Relaxed)),
            session: active.session,
            rollout: active.rollout,
            policy_id: active.policy_id,
            applied_tick: self.applied_tick,
            rollouts_done: self.rollouts,
            policies_refused: self.refused,
            unacknowledged: self.last.rollout.saturating_sub(confirmed),
            learner_age_ns: self
                .learner_seen
                .map_or(u64::MAX, |(_, seen)| seen.elapsed().as_nanos() as u64),
            deadline_misses: self.report.stats.missed,
            wakeup_p50_ns: wakeup.p50,
            wakeup_p99_ns: wakeup.p99,
            wakeup_max_ns: wakeup.max,
            tick_p50_ns: tick.p50,
            tick_p99_ns: tick.p99,
            tick_max_ns: tick.max,
        }
    }
}
