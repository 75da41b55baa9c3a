//! Statistics of the loop, kept by the exchange thread from what the rt thread reports.

use hdrhistogram::Histogram;
use shm_types::telemetry::TelemetryTick;

use crate::config::Pace;
use crate::disk::timing_file::{Bins, LoopTiming};

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

    /// Everything, to a hundredth, for the record.
    pub fn timing(&self, pace: Pace) -> LoopTiming {
        LoopTiming {
            pace,
            ticks: self.ticks,
            missed_deadlines: self.missed,
            wakeup: if pace == Pace::Realtime { bins(&self.wakeup) } else { Bins::new() },
            tick: bins(&self.tick),
        }
    }
}

fn percentiles(histogram: &Histogram<u64>) -> Percentiles {
    Percentiles {
        p50: histogram.value_at_quantile(0.5),
        p99: histogram.value_at_quantile(0.99),
        max: histogram.max(),
    }
}

fn bins(histogram: &Histogram<u64>) -> Bins {
    let mut coarse = Histogram::new_with_bounds(1, MAX_NS, 2).expect("bounds are valid");
    coarse.add(histogram).expect("the bounds are the same");
    coarse.iter_recorded().map(|bin| (bin.value_iterated_to(), bin.count_at_value())).collect()
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

        let timing = stats.timing(Pace::Realtime);
        let within = |limit: u64| {
            let below = timing.wakeup.iter().filter(|(upper, _)| *upper <= limit);
            below.map(|(_, count)| count).sum::<u64>()
        };
        assert_eq!(within(u64::MAX), 1000);
        assert!((490..=500).contains(&within(500_000)), "{}", within(500_000));
        assert_eq!(timing.tick.len(), 1);
        assert!(stats.timing(Pace::Max).wakeup.is_empty(), "nothing is waited for");
    }
}
