//! An observer of a running cell that does not lose sight of it: it follows restarted controllers
//! and counts what it missed. What a bridge leaves out is not missed.

use std::collections::VecDeque;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::Result;
use shm_types::SCHEMA;
use shm_types::cell::{Cell, Role};
use shm_types::channel::ChannelError;
use shm_types::episode::EpisodeHeader;
use shm_types::news::{MeasuresNews, TrialNews};
use shm_types::policy::PolicyMsg;
use shm_types::ports::ObserverPorts;
use shm_types::telemetry::{Telemetry, TelemetryTick};

use super::bridged::Bridged;

/// How long a lost controller is looked for before the caller gets another turn.
const SOON: Duration = Duration::from_millis(20);
/// Between two looks whether the controller lives.
const LOOK: Duration = Duration::from_millis(100);
/// Ticks that lie further apart in time than in number are not of one run of the loop.
const CLOCK_TOLERANCE: Duration = Duration::from_millis(250);

/// What was seen, in the order in which it is best told.
pub enum Seen {
    Policy(Box<PolicyMsg>),
    Outcome(Box<EpisodeHeader>),
    /// A tick, and its time since the epoch, ns.
    Tick(Box<TelemetryTick>, u64),
    Trial(Box<TrialNews>),
    Measures(Box<MeasuresNews>),
    /// The following ticks come through a bridge.
    Bridged(Bridged),
    /// So many ticks are missing before the next one.
    Lost(u64),
    /// The controller has gone; another one is looked for.
    ControllerGone,
    ControllerBack,
}

pub struct Watcher {
    cell: Cell,
    ports: Option<ObserverPorts>,
    /// The controller of these ports lives.
    is_there: bool,
    looked: Instant,
    period: Duration,
    /// Time of tick 0, ns since the epoch.
    origin_ns: Option<u64>,
    next_tick: Option<u64>,
    seen: VecDeque<Seen>,
    /// Ticks come through a bridge.
    pub bridged: Option<Bridged>,
    pub ticks: u64,
    pub lost: u64,
}

impl Watcher {
    /// Waits up to `timeout` for a controller, whose ticks lie `period` apart.
    pub fn open(cell: &Cell, period: Duration, timeout: Duration) -> Result<Watcher> {
        let ports = Some(ObserverPorts::open(cell, timeout)?);
        let (cell, seen) = (cell.clone(), VecDeque::new());
        Ok(Watcher {
            cell,
            ports,
            is_there: true,
            looked: Instant::now(),
            period,
            origin_ns: None,
            next_tick: None,
            seen,
            bridged: None,
            ticks: 0,
            lost: 0,
        })
    }

    /// The next thing seen; `None` when there is nothing new.
    pub fn next(&mut self) -> Result<Option<Seen>> {
        if self.seen.is_empty() {
            self.look()?;
        }
        Ok(self.seen.pop_front())
    }

    fn look(&mut self) -> Result<()> {
        let Some(ports) = &self.ports else { return self.look_for_controller() };
        let mut bridged = None;
        while let Some(policy) = ports.in_loop.receive()? {
            self.seen.push_back(Seen::Policy(Box::new(*policy)));
        }
        while let Some(header) = ports.outcomes.receive()? {
            if header.schema == SCHEMA {
                self.seen.push_back(Seen::Outcome(Box::new(*header)));
            }
        }
        let mut ticks = Vec::new();
        while let Some(sample) = ports.telemetry.receive()? {
            bridged = bridged_by(&sample).or(bridged);
            ticks.extend_from_slice(sample.ticks());
        }
        while let Some(news) = ports.trials.receive()? {
            if news.validate().is_ok() {
                self.seen.push_back(Seen::Trial(Box::new(*news)));
            }
        }
        while let Some(news) = ports.measures.receive()? {
            if news.validate().is_ok() {
                self.seen.push_back(Seen::Measures(Box::new(*news)));
            }
        }
        let is_current = ports.is_current();
        let was_there = self.is_there;
        if self.looked.elapsed() >= LOOK {
            self.looked = Instant::now();
            // A dead one leaves its services behind, and its learner goes on to tell of itself there.
            self.is_there &= self.cell.has(Role::Controller);
        }
        if let Some(bridged) = bridged.filter(|new| self.bridged.as_ref() != Some(new)) {
            self.bridged = Some(bridged.clone());
            self.seen.push_back(Seen::Bridged(bridged));
        }
        if let Some(last) = ticks.last() {
            self.keep_time(last.record.tick);
        }
        for tick in ticks {
            self.take(tick);
        }
        self.is_there &= is_current;
        if was_there && !self.is_there {
            self.seen.push_back(Seen::ControllerGone);
        }
        if !is_current {
            self.ports = None;
        }
        Ok(())
    }

    fn look_for_controller(&mut self) -> Result<()> {
        match ObserverPorts::open(&self.cell, SOON) {
            Ok(ports) => {
                (self.ports, self.is_there) = (Some(ports), true);
                // Another loop, another count and another clock.
                (self.next_tick, self.origin_ns, self.bridged) = (None, None, None);
                self.seen.push_back(Seen::ControllerBack);
                Ok(())
            }
            Err(ChannelError::NoController { .. }) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }

    fn take(&mut self, tick: TelemetryTick) {
        let number = tick.record.tick;
        let next = self.next_tick.filter(|_| self.bridged.is_none());
        let missing = next.map_or(0, |next| number.saturating_sub(next));
        if missing > 0 {
            self.lost += missing;
            self.seen.push_back(Seen::Lost(missing));
        }
        self.next_tick = Some(number + 1);
        self.ticks += 1;
        let at_ns = self.origin_ns.unwrap_or(0) + self.since_start(number);
        self.seen.push_back(Seen::Tick(Box::new(tick), at_ns));
    }

    fn since_start(&self, tick: u64) -> u64 {
        tick * self.period.as_nanos() as u64
    }

    /// Ticks have numbers, not times. They count from an origin that is set once, so that neighbours
    /// lie one period apart, and again when the loop has stood still or runs without the wall clock.
    fn keep_time(&mut self, newest: u64) {
        let now_ns = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos();
        let found = (now_ns as u64).saturating_sub(self.since_start(newest));
        // Never back: time in a file only grows.
        let is_ahead = |origin: u64| found > origin + CLOCK_TOLERANCE.as_nanos() as u64;
        if self.origin_ns.is_none_or(is_ahead) {
            self.origin_ns = Some(found);
        }
    }
}

fn bridged_by(sample: &Telemetry) -> Option<Bridged> {
    sample.via().map(|host| Bridged { host, hz: sample.via_hz })
}

/// Waits between two looks: short enough to lose nothing, long enough to disturb no other process. A controller at full speed fills the channel in 50 ms.
pub fn pause(since: Instant) {
    const PAUSE: Duration = Duration::from_millis(10);
    std::thread::sleep(PAUSE.saturating_sub(since.elapsed()));
}
