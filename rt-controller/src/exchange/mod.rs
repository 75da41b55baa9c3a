//! The exchange thread: everything iceoryx2, beside the loop and never in its way.

pub(crate) mod commands;
pub(crate) mod hand_over;
pub(crate) mod learner_link;
pub(crate) mod loop_report;
pub(crate) mod posture;
pub(crate) mod rearm;
pub(crate) mod serving;
pub(crate) mod setup;
pub(crate) mod stalls;
pub(crate) mod status;
pub(crate) mod swap;
pub(crate) mod timing;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use shm_types::SCHEMA;
use shm_types::policy::{PolicyMsg, PolicyName};
use shm_types::ports::ControllerPorts;
use shm_types::service_manager::{Notice, notify};
use shm_types::telemetry::Heartbeat;

use crate::disk::catalogue::Catalogue;
use crate::disk::flight_files::FlightFiles;
use crate::disk::spool::Spool;
use crate::disk::state_file::{State, StateError};
use crate::exchange::commands::Commands;
use crate::exchange::learner_link::LearnerLink;
use crate::exchange::loop_report::LoopReport;
use crate::exchange::serving::Serving;
use crate::exchange::setup::Setup;
use crate::exchange::stalls::Stalls;
use crate::exchange::swap::Served;
use crate::executor::latch::Latched;
use crate::fault::Fault;
use crate::hot::posture::PostureMove;
use crate::rings::{ExchangeEnds, Swap};
use crate::summary::RunSummary;

const POLL: Duration = Duration::from_micros(200);
/// How long after work the thread does not sleep: what comes in bursts is answered at once.
const EAGER: Duration = Duration::from_micros(300);
/// The longest sleep while a rollout runs at full speed.
const NAP: Duration = Duration::from_millis(1);
const BEAT: Duration = Duration::from_millis(100);
const HOUSEKEEPING: Duration = Duration::from_secs(1);
/// Dead processes that the transport may fail to clear away; a service has 20 places.
const MAX_LEAKED: usize = 4;
/// Policies that need no second dry run.
pub(crate) const KNOWN: usize = 16;

/// The rollout that the loop executes.
pub(crate) struct InFlight<P> {
    pub served: Arc<Served<P>>,
    pub is_proposal: bool,
    /// Another policy was swapped into it.
    pub swapped: bool,
}

pub(crate) struct Exchange<'a, P> {
    pub(crate) ports: ControllerPorts,
    pub(crate) setup: Setup<'a, P>,
    pub(crate) ends: ExchangeEnds<P>,
    pub(crate) report: LoopReport,
    pub(crate) stalls: Stalls,
    pub(crate) serving: Serving<P>,
    pub(crate) catalogue: Catalogue,
    /// Where there is a state folder.
    pub(crate) spool: Option<Spool>,
    pub(crate) flights: Option<FlightFiles>,
    /// The hardware fault that holds the arm, and whether a re-arm was requested.
    pub(crate) latched: Option<Latched>,
    pub(crate) is_rearming: bool,
    /// Where the null space is drawn to in served rollouts, and the number of the order. Not remembered over a
    /// restart.
    pub(crate) posture: PostureMove,
    pub(crate) posture_seq: u64,
    /// Digest of the policy that it was checked with.
    pub(crate) posture_of: Option<u64>,
    pub(crate) commands: Commands,
    pub(crate) link: LearnerLink,
    /// Newest first.
    pub(crate) known: Vec<Arc<Served<P>>>,
    /// The newest proposal that ran to its end, until it is judged.
    pub(crate) to_judge: Option<PolicyMsg>,
    /// The newest one that succeeded, until its dry run: only then it may be served.
    pub(crate) to_prove: Option<PolicyMsg>,
    pub(crate) boot_id: u64,
    pub(crate) in_flight: Option<InFlight<P>>,
    /// Policy in the loop, or the last one, and since when.
    pub(crate) in_loop: PolicyName,
    pub(crate) applied_tick: u64,
    pub(crate) rollouts: u64,
    pub(crate) served: u64,
    pub(crate) refused: u64,
    /// Something was done in this round.
    pub(crate) active: bool,
    beat_counter: u64,
    /// The services are to be made anew as soon as nothing is on its way through them.
    must_renew: bool,
    /// Said once, not with every attempt.
    pub(crate) loan_failed: bool,
}

impl<'a, P: Clone + PartialEq> Exchange<'a, P> {
    /// # Errors
    /// [`StateError`] when the state of an earlier run is there and cannot be read.
    pub fn new(
        ports: ControllerPorts,
        setup: Setup<'a, P>,
        ends: ExchangeEnds<P>,
        report: LoopReport,
    ) -> Result<Exchange<'a, P>, StateError> {
        let catalogue = Catalogue::open(setup.state)?;
        let serving = restore(&setup, catalogue.left());
        let stalls = Stalls::new(setup.is_realtime());
        let (flights, latched) = (setup.state.map(FlightFiles::open), catalogue.left().latched);
        if let Some(Latched { fault, .. }) = latched {
            setup.latch.restore(fault);
            let why = Fault::describe(fault as u32);
            tracing::error!("the arm is held since an earlier run: {why}");
        }
        let spool = setup.state.map(|dir| open_spool(&dir.join("spool"))).transpose()?;
        Ok(Exchange {
            ports,
            boot_id: setup.boot_id,
            setup,
            ends,
            report,
            stalls,
            serving,
            catalogue,
            spool,
            flights,
            latched,
            is_rearming: false,
            posture: PostureMove::NONE,
            posture_seq: 0,
            posture_of: None,
            commands: Commands::new(),
            link: LearnerLink::new(),
            known: Vec::new(),
            to_judge: None,
            to_prove: None,
            in_flight: None,
            in_loop: PolicyName::NONE,
            applied_tick: 0,
            rollouts: 0,
            served: 0,
            refused: 0,
            active: false,
            beat_counter: 0,
            must_renew: false,
            loan_failed: false,
        })
    }

    /// Serves the channels until `stop` is set or the rt thread has ended.
    pub fn run(&mut self, stop: &AtomicBool, rt_ended: impl Fn() -> bool) -> RunSummary {
        let mut next_beat = Instant::now();
        let mut next_housekeeping = Instant::now() + HOUSEKEEPING;
        let mut worked = Instant::now();
        while !stop.load(Ordering::Relaxed) && !rt_ended() {
            self.active = false;
            self.report.drain(&self.ports);
            self.stalls.see(&self.report, self.setup.latch.is_absent());
            self.serving.passed(self.report.last.record.tick, self.in_flight.is_some());
            self.watch_latch();
            self.take_flights();
            self.take_applied();
            self.take_posture();
            self.take_done();
            self.take_spooled();
            self.link.receive(&self.ports, self.in_flight.as_ref().map(|f| f.served.name()));
            for ack in self.link.news() {
                self.take_acknowledged(&ack);
            }
            if self.serve_commands() {
                stop.store(true, Ordering::Relaxed);
            }
            self.swap_now();
            self.renew();
            self.hand_over();
            if !self.active {
                self.prove();
            }
            let now = Instant::now();
            if now >= next_beat {
                next_beat = now + BEAT;
                self.beat();
            }
            if now >= next_housekeeping {
                next_housekeeping = now + HOUSEKEEPING;
                self.must_renew |= self.ports.clean_up() > MAX_LEAKED;
                // A loop that has stopped ticking is worth a restart; what is owed is told all the same.
                notify(if self.stalls.is_ticking() { &[Notice::Watchdog] } else { &[] });
                self.link.look(&self.ports);
            }
            worked = if self.active { now } else { worked };
            let idle = now - worked;
            match idle < EAGER {
                true => std::thread::yield_now(),
                false => std::thread::sleep(self.nap(idle)),
            }
        }
        self.report.drain(&self.ports);
        self.report.flush(&self.ports);
        self.summary()
    }

    /// A wake-up costs more than what there is to see. At full speed a rollout has no deadlines, and the core is
    /// better spent on another cell's: its end is seen late by at most an eighth of the time it took.
    fn nap(&self, idle: Duration) -> Duration {
        match !self.setup.is_realtime() && self.in_flight.is_some() {
            true => (idle / 8).clamp(POLL, NAP),
            false => POLL,
        }
    }

    fn summary(&self) -> RunSummary {
        RunSummary {
            rollouts: self.rollouts,
            policies_refused: self.refused,
            swaps: self.serving.applied,
            ticks: self.report.stats.ticks,
            deadline_misses: self.report.stats.missed,
            wakeup: self.report.stats.wakeup(),
            tick: self.report.stats.tick(),
            timing: self.report.stats.timing(self.setup.pace),
        }
    }

    fn beat(&mut self) {
        self.beat_counter += 1;
        let (boot_id, counter) = (self.boot_id, self.beat_counter);
        let pinned = u64::from(self.serving.is_pinned());
        let latched = self.setup.latch.fault().unwrap_or(Fault::None) as u64;
        let beat = Heartbeat {
            schema: SCHEMA,
            boot_id,
            counter,
            pinned,
            latched,
            equipment: self.setup.equipment(),
            ..Heartbeat::NONE
        };
        let _ = self.ports.beat.send_copy(beat);
        self.report.flush(&self.ports);
        self.ports.meet_newcomers();
    }

    /// Makes the services anew between two rollouts, when too much is stuck in the old ones: the next
    /// learner would not get in. What was sent and not taken is asked for again.
    fn renew(&mut self) {
        let is_writing = self.spool.as_ref().is_some_and(Spool::is_busy);
        let is_free = self.in_flight.is_none() && !is_writing && self.commands.is_empty();
        if !self.must_renew || !is_free {
            return;
        }
        self.must_renew = false;
        match self.ports.renewed() {
            Ok(ports) => {
                self.ports = ports;
                tracing::warn!("services recreated: dead processes had exhausted the old ones");
            }
            Err(error) => tracing::error!("services cannot be recreated: {error}"),
        }
    }

    /// Hands a swap into the rollout in progress.
    fn swap_now(&mut self) {
        if !self.setup.can_swap {
            return; // it becomes the next rollout
        }
        if let Some((seq, to)) = self.serving.swap_now().map(|(seq, to)| (seq, to.clone())) {
            self.fit_posture(&to);
            let _ = self.ports.in_loop.send_copy(to.message);
            let policy_digest = to.message.digest;
            let swap = Swap { seq, policy: to.policy.clone(), policy_digest };
            // Never full: one swap is under way at a time.
            let _ = self.ends.swaps.push(swap);
        }
    }
}

fn open_spool(dir: &Path) -> Result<Spool, StateError> {
    let spool =
        Spool::open(dir).map_err(|cause| StateError::Io { path: dir.to_path_buf(), cause })?;
    if spool.len() > 0 {
        tracing::info!(episodes = spool.len(), "spooled episodes are waiting for their learner");
    }
    Ok(spool)
}

/// What an earlier run served, if it is still admitted.
fn restore<P: PartialEq>(setup: &Setup<P>, left: &State) -> Serving<P> {
    let again = |message: Option<PolicyMsg>| {
        let message = message?;
        match (setup.admit_to_serve)(&message) {
            Ok((policy, n_records)) => Some(Arc::new(Served { message, policy, n_records })),
            Err(error) => {
                let policy = message.name().describe();
                tracing::warn!("policy {policy} of the last run is no longer admitted: {error}");
                None
            }
        }
    };
    let mut serving = Serving::new(setup.blend_ticks);
    serving.restore(again(left.active), again(left.last_good), left.pinned);
    if let Some(served) = serving.served() {
        let policy = served.name().describe();
        match serving.is_pinned() {
            true => tracing::warn!(
                "policy {policy} was pinned by an earlier run and is served from now on, without a \
                 command: `skillet policy unpin` or `skillet hold` ends that"
            ),
            false => tracing::info!("policy {policy} of the last run is restored"),
        }
    }
    serving
}

/// Tells one start of a controller from another. Names a process, decides nothing.
pub fn boot_id() -> u64 {
    let clock = rustix::time::clock_gettime(rustix::time::ClockId::Realtime);
    (clock.tv_sec as u64).wrapping_mul(1_000_000_000).wrapping_add(clock.tv_nsec as u64)
}
