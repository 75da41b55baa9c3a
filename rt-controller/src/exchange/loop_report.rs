//! What the loop reports, for statistics and for observers.

use rtrb::Consumer;
use shm_types::ports::ControllerPorts;
use shm_types::telemetry::{TELEMETRY_TICKS, Telemetry, TelemetryTick};

use crate::exchange::timing::LoopStats;

/// The exchange thread's end of the telemetry ring.
pub(crate) struct LoopReport {
    ring: Consumer<TelemetryTick>,
    batch: Telemetry,
    pub stats: LoopStats,
    /// In the last drain: how many ticks came, and the latest wake-up among them.
    pub fresh: usize,
    pub latest_ns: u64,
    pub last: TelemetryTick,
}

impl LoopReport {
    pub fn new(ring: Consumer<TelemetryTick>) -> LoopReport {
        let (batch, last) = (Telemetry::EMPTY, TelemetryTick::ZERO);
        LoopReport { ring, batch, stats: LoopStats::new(), fresh: 0, latest_ns: 0, last }
    }

    /// Takes in all ticks since the last call and sends them on in batches.
    pub fn drain(&mut self, ports: &ControllerPorts) {
        (self.fresh, self.latest_ns) = (0, 0);
        while let Ok(tick) = self.ring.pop() {
            self.fresh += 1;
            self.latest_ns = self.latest_ns.max(tick.wakeup_ns);
            self.stats.add(&tick);
            self.batch.lost += tick.record.tick.saturating_sub(self.last.record.tick + 1);
            self.last = tick;
            self.batch.ticks[self.batch.n_ticks as usize] = tick;
            self.batch.n_ticks += 1;
            if self.batch.n_ticks as usize == TELEMETRY_TICKS {
                self.flush(ports);
            }
        }
    }

    /// Sends what a batch has so far: where nothing ticks between rollouts, the last one would wait.
    pub fn flush(&mut self, ports: &ControllerPorts) {
        if self.batch.n_ticks > 0 {
            // Nobody listening is no failure.
            let _ = ports.telemetry.send_copy(self.batch);
            (self.batch.n_ticks, self.batch.lost) = (0, 0);
        }
    }
}
