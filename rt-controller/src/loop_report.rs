//! What the loop reports, for statistics and for observers.

use rtrb::Consumer;
use shm_types::SCHEMA;
use shm_types::ports::ControllerPorts;
use shm_types::telemetry::{TELEMETRY_TICKS, Telemetry, TelemetryTick};

use crate::timing::LoopStats;

/// The exchange thread's end of the telemetry ring.
pub(crate) struct LoopReport {
    ring: Consumer<TelemetryTick>,
    batch: Telemetry,
    batched: usize,
    pub stats: LoopStats,
    pub last: TelemetryTick,
}

impl LoopReport {
    pub fn new(ring: Consumer<TelemetryTick>) -> LoopReport {
        let last = TelemetryTick::ZERO;
        let batch = Telemetry { schema: SCHEMA, lost: 0, ticks: [last; TELEMETRY_TICKS] };
        LoopReport { ring, batch, batched: 0, stats: LoopStats::new(), last }
    }

    /// Takes in all ticks since the last call and sends them on in batches.
    pub fn drain(&mut self, ports: &ControllerPorts) {
        while let Ok(tick) = self.ring.pop() {
            self.stats.add(&tick);
            self.batch.lost += tick.tick.saturating_sub(self.last.tick + 1);
            self.last = tick;
            self.batch.ticks[self.batched] = tick;
            self.batched += 1;
            if self.batched == TELEMETRY_TICKS {
                // Nobody listening is no failure.
                let _ = ports.telemetry.send_copy(self.batch);
                self.batched = 0;
                self.batch.lost = 0;
            }
        }
    }
}
