//! Statistics of the loop, kept by the exchange thread from what the rt thread reports.

use hdrhistogram::Histogram;
use shm_types::telemetry::TelemetryTick;

/// What takes longer is counted as this long.
const MAX_NS: u64 = 10_000_000_000;

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
        let histogram = || Histogram::new_with_bounds(1, MAX_NS, 3).expect("bounds are valid");
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_those_of_what_was_added() {
        let mut stats = LoopStats::new();
        for tick in 1..=1000 {
            let (wakeup_ns, tick_ns) = (tick * 1000, 5000);
            stats.add(&TelemetryTick { wakeup_ns, tick_ns, missed: 3, ..TelemetryTick::ZERO });
        }
        let near = |found: u64, expected: f64| (found as f64 / expected - 1.0).abs() < 2e-3;
        let wakeup = stats.wakeup();
        assert!(near(wakeup.p50, 5e5) && near(wakeup.p99, 9.9e5) && near(wakeup.max, 1e6));
        assert!(near(stats.tick().max, 5000.0));
        assert_eq!((stats.ticks, stats.missed), (1000, 3));
    }
}
