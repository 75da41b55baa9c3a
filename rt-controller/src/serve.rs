//! One thread that executes, the exchange thread beside it, rings between them.

use std::sync::atomic::{AtomicBool, Ordering};

use rtrb::RingBuffer;
use shm_types::cell::CellLock;
use shm_types::channel::EPISODE_LOANS;
use shm_types::ports::ControllerPorts;
use shm_types::service_manager::{Notice, notify};

use crate::exchange::Exchange;
use crate::exchange::loop_report::LoopReport;
use crate::exchange::setup::Setup;
use crate::executor::flight::FlightRecord;
use crate::rings::{Ends, ExchangeEnds};
use crate::rt::Raised;
use crate::summary::{RunError, RunSummary};

/// Ticks the telemetry ring holds: 4 s at 1 kHz, 0.2 s at the pace of the simulation.
const TELEMETRY_RING: usize = 4096;
/// One swap and one rollout are under way at a time; the rings have room to spare.
const SWAP_RING: usize = 4;
/// Postures that may wait for the loop's next tick.
const POSTURE_RING: usize = 4;
/// Boxes for flight records: one in the loop, one on its way.
const FLIGHT_RING: usize = 2;

/// SCHED_FIFO priority of the exchange thread beside a loop in real time.
const EXCHANGE_PRIORITY: u8 = 1;

/// Serves the cell until `stop` is set; `execute` runs on its own thread and returns when `stop`
/// is set. `lock` is the controller's, of the cell to serve.
pub(crate) fn serve<P: Send + Clone + PartialEq>(
    lock: &CellLock,
    setup: Setup<'_, P>,
    stop: &AtomicBool,
    execute: impl FnOnce(Ends<P>) + Send,
) -> Result<RunSummary, RunError> {
    let cell = lock.cell();
    let ports = ControllerPorts::create(cell)?;
    let (job_tx, jobs) = RingBuffer::new(EPISODE_LOANS);
    let (swap_tx, swaps) = RingBuffer::new(SWAP_RING);
    let (applied, applied_rx) = RingBuffer::new(SWAP_RING);
    let (posture_tx, postures) = RingBuffer::new(POSTURE_RING);
    let (postures_taken, taken_rx) = RingBuffer::new(POSTURE_RING);
    let (done, done_rx) = RingBuffer::new(EPISODE_LOANS);
    let (telemetry, telemetry_rx) = RingBuffer::new(TELEMETRY_RING);
    let (flights, flight_rx) = RingBuffer::new(FLIGHT_RING);
    let (mut spare_tx, spare_flights) = RingBuffer::new(FLIGHT_RING);
    if setup.state.is_some() {
        // Without a folder none is written: the loop keeps its own.
        let _ = spare_tx.push(Box::new(FlightRecord::new()));
    }
    let ends = Ends {
        jobs,
        swaps,
        applied,
        postures,
        postures_taken,
        done,
        telemetry,
        flights,
        spare_flights,
    };
    let exchange_ends = ExchangeEnds {
        jobs: job_tx,
        swaps: swap_tx,
        applied: applied_rx,
        postures: posture_tx,
        postures_taken: taken_rx,
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
