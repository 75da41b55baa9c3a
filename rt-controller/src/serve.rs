//! One thread that executes, the exchange thread beside it, rings between them.

use std::sync::atomic::{AtomicBool, Ordering};

use rtrb::{Consumer, Producer, RingBuffer};
use shm_types::cell::{Cell, Role};
use shm_types::channel::{EPISODE_LOANS, EpisodeLoan};
use shm_types::measures::Measures;
use shm_types::ports::ControllerPorts;
use shm_types::service_manager::{Notice, notify};
use shm_types::telemetry::TelemetryTick;

use crate::exchange::loop_report::LoopReport;
use crate::exchange::swap::Applied;
use crate::exchange::{Exchange, Setup};
use crate::executor::flight::FlightRecord;
use crate::executor::recording::Recording;
use crate::fault::Fault;
use crate::rt::Raised;
use crate::run::{RunError, RunSummary};

/// Ticks the telemetry ring holds: 4 s at 1 kHz, 0.2 s at the pace of the simulation.
const TELEMETRY_RING: usize = 4096;
/// One swap and one rollout are under way at a time; the rings have room to spare.
const SWAP_RING: usize = 4;
/// Boxes for flight records: one in the loop, one on its way.
const FLIGHT_RING: usize = 2;

/// SCHED_FIFO priority of the exchange thread beside a loop in real time.
const EXCHANGE_PRIORITY: u8 = 1;

/// A rollout to execute: travels exchange → executing thread with the memory its records go to.
pub(crate) struct Job<P> {
    pub policy: P,
    pub policy_digest: u64,
    pub episode: EpisodeLoan,
    /// The swap that it fulfils, to be acknowledged when the policy acts.
    pub swap: Option<u64>,
    /// A learner's proposal: a fault in it is its episode's matter.
    pub is_experiment: bool,
}

/// A policy for the rollout in progress.
pub(crate) struct Swap<P> {
    pub seq: u64,
    pub policy: P,
    pub policy_digest: u64,
}

/// An executed rollout: travels back.
pub(crate) struct Done {
    pub episode: EpisodeLoan,
    pub recording: Recording,
    pub fault: Fault,
    /// What only the plant could measure.
    pub measures: Measures,
}

/// The executing thread's ends of the rings.
pub(crate) struct Ends<P> {
    pub jobs: Consumer<Job<P>>,
    pub swaps: Consumer<Swap<P>>,
    pub applied: Producer<Applied<P>>,
    pub done: Producer<Done>,
    pub telemetry: Producer<TelemetryTick>,
    pub flights: Producer<Box<FlightRecord>>,
    pub spare_flights: Consumer<Box<FlightRecord>>,
}

/// The exchange thread's ends.
pub(crate) struct ExchangeEnds<P> {
    pub jobs: Producer<Job<P>>,
    pub swaps: Producer<Swap<P>>,
    pub applied: Consumer<Applied<P>>,
    pub done: Consumer<Done>,
    pub flights: Consumer<Box<FlightRecord>>,
    pub spare_flights: Producer<Box<FlightRecord>>,
}

/// Serves the cell until `stop` is set; `execute` runs on its own thread and returns when `stop`
/// is set. Holds the cell's controller lock.
pub(crate) fn serve<P: Send + Clone + PartialEq>(
    cell: &Cell,
    setup: Setup<'_, P>,
    stop: &AtomicBool,
    execute: impl FnOnce(Ends<P>) + Send,
) -> Result<RunSummary, RunError> {
    let _lock = cell.lock(Role::Controller)?;
    let ports = ControllerPorts::create(cell)?;
    let (job_tx, jobs) = RingBuffer::new(EPISODE_LOANS);
    let (swap_tx, swaps) = RingBuffer::new(SWAP_RING);
    let (applied, applied_rx) = RingBuffer::new(SWAP_RING);
    let (done, done_rx) = RingBuffer::new(EPISODE_LOANS);
    let (telemetry, telemetry_rx) = RingBuffer::new(TELEMETRY_RING);
    let (flights, flight_rx) = RingBuffer::new(FLIGHT_RING);
    let (mut spare_tx, spare_flights) = RingBuffer::new(FLIGHT_RING);
    if setup.state.is_some() {
        // Without a folder none is written: the loop keeps its own.
        let _ = spare_tx.push(Box::new(FlightRecord::new()));
    }
    let ends = Ends { jobs, swaps, applied, done, telemetry, flights, spare_flights };
    let exchange_ends = ExchangeEnds {
        jobs: job_tx,
        swaps: swap_tx,
        applied: applied_rx,
        done: done_rx,
        flights: flight_rx,
        spare_flights: spare_tx,
    };
    let (pace, is_realtime) = (setup.pace, setup.is_realtime());
    let mut exchange = Exchange::new(ports, setup, exchange_ends, LoopReport::new(telemetry_rx))?;
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new()
            .name("skillet-rt".into())
            .spawn_scoped(scope, move || execute(ends))
            .map_err(|error| RunError::Panic(format!("it could not be started: {error}")))?;

        tracing::info!(cell = cell.name(), ?pace, "controller ready");
        notify(&[Notice::Ready]);
        // Commands and swaps must not wait behind a busy learner; the loop stays above.
        let _raised = is_realtime.then(|| Raised::to(EXCHANGE_PRIORITY)).flatten();
        let summary = exchange.run(stop, || thread.is_finished());
        notify(&[Notice::Stopping]);
        // The thread may be waiting for its next deadline; it sees `stop` right after.
        stop.store(true, Ordering::Relaxed);
        match thread.join() {
            Ok(()) => {
                // The last episode may have come back meanwhile.
                exchange.take_done();
                Ok(summary)
            }
            Err(panic) => Err(RunError::Panic(panic_text(&*panic))),
        }
    })
}

fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|s| s.to_string());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".into())
}
