//! A running cell, watched: what is known of it, shown in a terminal, in a browser, as JSON, or to 3-D viewers.

mod action;
mod keys;
pub mod lines;
pub mod serve;
pub mod session;
pub mod terminal;
mod view;
pub mod vitals;
pub mod web;
mod words;

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use anyhow::Result;
use hdrhistogram::Histogram;
use shm_types::cell::Cell;
use shm_types::telemetry::TelemetryTick;

use crate::cell::NamedCell;
use crate::fields;
use crate::record::bridged::Bridged;
use crate::record::watcher::{Seen, Watcher};
use session::WatchedSession;
use vitals::Vitals;

/// How long a controller is waited for.
const OPEN: Duration = Duration::from_secs(2);
/// Percentiles are of the last windows of this length.
const WINDOW: Duration = Duration::from_secs(5);
/// Notes shown.
const NOTES: usize = 4;
const MAX_NS: u64 = 1_000_000_000;

/// Wake-up and tick times of a window.
struct Times {
    wakeup: Histogram<u64>,
    tick: Histogram<u64>,
}

/// p50, p99 and maximum, µs.
#[derive(Clone, Copy, Default)]
pub struct Percentiles {
    pub p50: f64,
    pub p99: f64,
    pub max: f64,
}

/// What a watcher knows.
pub struct Model {
    pub cell: String,
    pub vitals: Vitals,
    pub last: TelemetryTick,
    /// Ticks come through a bridge.
    pub bridged: Option<Bridged>,
    pub session: WatchedSession,
    /// Newest last.
    pub notes: VecDeque<String>,
    current: Times,
    shown: Option<(Percentiles, Percentiles)>,
    window_began: Instant,
}

impl Times {
    fn new() -> Times {
        Times { wakeup: histogram(), tick: histogram() }
    }
}

/// For times of up to a second, ns.
fn histogram() -> Histogram<u64> {
    Histogram::new_with_bounds(1, MAX_NS, 3).expect("bounds are valid")
}

impl Model {
    pub fn new(cell: &Cell) -> Model {
        Model {
            cell: cell.name().into(),
            vitals: Vitals::of(cell),
            last: TelemetryTick::ZERO,
            bridged: None,
            session: WatchedSession::default(),
            notes: VecDeque::new(),
            current: Times::new(),
            shown: None,
            window_began: Instant::now(),
        }
    }

    fn take(&mut self, seen: &Seen) {
        match seen {
            Seen::Tick(tick, _) => self.take_tick(tick),
            Seen::Trial(news) => self.session.take(news),
            Seen::Measures(news) => self.session.measured(news),
            Seen::ControllerBack => {
                // Another loop, with times of its own.
                (self.last, self.shown, self.current) = (TelemetryTick::ZERO, None, Times::new());
                self.bridged = None;
            }
            Seen::Bridged(bridged) => self.bridged = Some(bridged.clone()),
            Seen::ControllerGone => {}
            Seen::Policy(_) | Seen::Outcome(_) | Seen::Lost(_) => {}
        }
    }

    /// Takes what there is, and notes who came and who went. Returns those notes.
    pub fn look(&mut self, watcher: &mut Watcher) -> Result<Vec<String>> {
        self.look_and(watcher, &mut |_| {})
    }

    /// The same; `also` is shown everything.
    pub fn look_and(
        &mut self,
        watcher: &mut Watcher,
        also: &mut dyn FnMut(&Seen),
    ) -> Result<Vec<String>> {
        while let Some(seen) = watcher.next()? {
            self.take(&seen);
            also(&seen);
        }
        self.vitals.look();
        let changes = self.vitals.changes();
        changes.iter().for_each(|change| self.note(change.clone()));
        Ok(changes)
    }

    pub fn note(&mut self, text: String) {
        self.notes.push_back(text);
        if self.notes.len() > NOTES {
            self.notes.pop_front();
        }
    }

    fn take_tick(&mut self, tick: &TelemetryTick) {
        self.last = *tick;
        self.vitals.ticked();
        self.current.wakeup.saturating_record(tick.wakeup_ns);
        self.current.tick.saturating_record(tick.tick_ns);
        if self.window_began.elapsed() >= WINDOW {
            self.shown = Some(self.percentiles_of_window());
            self.current = Times::new();
            self.window_began = Instant::now();
        }
    }

    fn percentiles_of_window(&self) -> (Percentiles, Percentiles) {
        let of = |histogram: &Histogram<u64>| {
            let us = fields::us;
            Percentiles {
                p50: us(histogram.value_at_quantile(0.5)),
                p99: us(histogram.value_at_quantile(0.99)),
                max: us(histogram.max()),
            }
        };
        (of(&self.current.wakeup), of(&self.current.tick))
    }

    /// Wake-up and tick of the last complete window, or of the first one so far.
    pub fn times(&self) -> (Percentiles, Percentiles) {
        self.shown.unwrap_or_else(|| self.percentiles_of_window())
    }
}

/// A watcher of the named cell.
pub fn open(named: &NamedCell) -> Result<Watcher> {
    let period = Duration::from_nanos(named.config().controller.period_ns());
    Watcher::open(&named.cell, period, OPEN)
}
