//! Loop timing over the last minutes, second by second.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use serde_json::{Value, json};
use shm_types::telemetry::TelemetryTick;

use crate::watch::histogram;

const WINDOW: Duration = Duration::from_secs(1);
/// Three minutes.
const WINDOWS: usize = 180;

pub struct Timing {
    began: Instant,
    window: Instant,
    wakeup: Histogram<u64>,
    tick: Histogram<u64>,
    /// Seconds since the start; then p50, p99 and maximum of the wake-up and p99 of the tick, µs.
    windows: VecDeque<[f64; 5]>,
}

impl Timing {
    pub fn new() -> Timing {
        let now = Instant::now();
        let windows = VecDeque::new();
        Timing { began: now, window: now, wakeup: histogram(), tick: histogram(), windows }
    }

    pub fn take(&mut self, tick: &TelemetryTick) {
        self.wakeup.saturating_record(tick.wakeup_ns);
        self.tick.saturating_record(tick.tick_ns);
    }

    /// Closes a window that is over.
    pub fn look(&mut self) {
        if self.window.elapsed() < WINDOW {
            return;
        }
        self.window = Instant::now();
        if self.tick.is_empty() {
            return;
        }
        let us = |ns: u64| (ns as f64 * 1e-2).round() / 10.0;
        let at_s = (self.began.elapsed().as_secs_f64() * 10.0).round() / 10.0;
        self.windows.push_back([
            at_s,
            us(self.wakeup.value_at_quantile(0.5)),
            us(self.wakeup.value_at_quantile(0.99)),
            us(self.wakeup.max()),
            us(self.tick.value_at_quantile(0.99)),
        ]);
        if self.windows.len() > WINDOWS {
            self.windows.pop_front();
        }
        self.wakeup.reset();
        self.tick.reset();
    }

    /// Column by column, as the plots take it.
    pub fn json(&self) -> Value {
        let column = |k: usize| self.windows.iter().map(|window| window[k]).collect::<Vec<_>>();
        json!({
            "at_s": column(0),
            "wakeup_p50_us": column(1),
            "wakeup_p99_us": column(2),
            "wakeup_max_us": column(3),
            "tick_p99_us": column(4),
        })
    }
}
