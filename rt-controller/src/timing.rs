//! Statistics of the loop, kept by the exchange thread from what the rt thread reports.

use hdrhistogram::Histogram;
use shm_types::telemetry::TelemetryTick;

/// Percentiles of wake-up and tick time since the start, ns.
pub struct LoopStats {
    wakeup: Histogram<u64>,
    tick: Histogram<u64>,
    pub ticks: u64,
    pub missed: u64,
}

/// p50, p99 and maximum, ns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Percentiles {
    pub p50: u64,
    pub p99: u64,
    pub max: u64,
}

impl LoopStats {
    pub fn new() -> LoopStats {
        // Auto-resizing, 3 digits: memory grows with the largest value, on this thread only.
        let histogram = || Histogram::new(3).expect("3 digits are valid");
        LoopStats { wakeup: histogram(), tick: histogram(), ticks: 0, missed: 0 }
    }

    pub fn add(&mut self, tick: &TelemetryTick) {
        self.wakeup.saturating_record(tick.wakeup_ns);
        self.tick.saturating_record(tick.tick_ns);
        self.ticks += 1;
        self.missed = tick.missed;
    }

    pub fn wakeup(&self) -> Percentiles {
        percentiles(&self.wakeup)
    }

    pub fn tick(&self) -> Percentiles {
        percentiles(&self.tick)
    }
}

fn percentiles(histogram: &Histogram<u64>) -> Percentiles {
    Percentiles {
        p50: histogram.value_at_quantile(0.5),
        p99: histogram.value_at_quantile(0.99),
        max: histogram.max(),
    }
}
