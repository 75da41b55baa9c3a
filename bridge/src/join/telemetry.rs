//! Shows the learner's machine the loop of this cell, while somebody looks at it from there.
//!
//! On a thread and a publication of its own, with the lowest priority: what the network cannot take at once is dropped.
//! To the controller it is one more observer, which it never waits for.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use shm_types::SCHEMA;
use shm_types::cell::Cell;
use shm_types::policy::PolicyMsg;
use shm_types::ports::ObserverPorts;
use shm_types::telemetry::TelemetryTick;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::{Session, Wait};

use crate::live::Live;

/// Between two looks while somebody watches, and while nobody does.
const LOOK: Duration = Duration::from_millis(4);
const IDLE: Duration = Duration::from_millis(50);
/// How long a controller is looked for.
const OPEN: Duration = Duration::from_millis(1);
/// A policy is as large as 40 ticks, and goes out as rarely.
const TICKS_PER_POLICY: u32 = 5;

/// Sends while it is watched, and ends with its handle.
pub(super) struct Telemetry {
    is_watched: Arc<AtomicBool>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Telemetry {
    /// `hz` ticks a second at most; none at 0. `bridge` names the bridge.
    pub fn start(session: &Session, key: &str, cell: &Cell, bridge: u64, hz: u64) -> Telemetry {
        let [is_watched, stop] = [(); 2].map(|()| Arc::new(AtomicBool::new(false)));
        let (watched, stopped) = (is_watched.clone(), stop.clone());
        let (session, key, cell) = (session.clone(), key.to_string(), cell.clone());
        let thread = (hz > 0).then(|| {
            std::thread::spawn(move || {
                let publisher = session
                    .declare_publisher(key)
                    .congestion_control(CongestionControl::Drop)
                    .priority(Priority::Background)
                    .wait();
                match publisher {
                    Ok(publisher) => {
                        Sender::new(publisher, bridge, hz).run(&cell, &watched, &stopped)
                    }
                    Err(error) => tracing::warn!("no live telemetry: {error}"),
                }
            })
        });
        Telemetry { is_watched, stop, thread }
    }

    pub fn set_watched(&self, is_watched: bool) {
        self.is_watched.store(is_watched, Ordering::Relaxed);
    }
}

impl Drop for Telemetry {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Sender<'a> {
    publisher: Publisher<'a>,
    bridge: u64,
    hz: u64,
    period: Duration,
    /// The newest of each that has not been sent.
    tick: Option<TelemetryTick>,
    policy: Option<Box<PolicyMsg>>,
    next_tick: Instant,
    next_policy: Instant,
}

impl<'a> Sender<'a> {
    fn new(publisher: Publisher<'a>, bridge: u64, hz: u64) -> Sender<'a> {
        Sender {
            publisher,
            bridge,
            hz,
            period: Duration::from_secs(1) / hz as u32,
            tick: None,
            policy: None,
            next_tick: Instant::now(),
            next_policy: Instant::now(),
        }
    }

    fn run(mut self, cell: &Cell, is_watched: &AtomicBool, stop: &AtomicBool) {
        let mut ports: Option<ObserverPorts> = None;
        while !stop.load(Ordering::Relaxed) {
            ports = ports.filter(|ports| ports.is_current() && is_watched.load(Ordering::Relaxed));
            if ports.is_none() && is_watched.load(Ordering::Relaxed) {
                ports = ObserverPorts::open(cell, OPEN).ok();
            }
            match &ports {
                Some(ports) => {
                    self.look(ports);
                    std::thread::sleep(LOOK);
                }
                None => {
                    (self.tick, self.policy) = (None, None);
                    std::thread::sleep(IDLE);
                }
            }
        }
    }

    fn look(&mut self, ports: &ObserverPorts) {
        while let Ok(Some(sample)) = ports.telemetry.receive() {
            self.tick = sample.ticks().last().copied().or(self.tick);
        }
        while let Ok(Some(policy)) = ports.in_loop.receive() {
            self.policy = Some(Box::new(*policy));
        }
        while let Ok(Some(header)) = ports.outcomes.receive() {
            if header.schema == SCHEMA {
                self.send(&Live::Outcome(Box::new(*header)));
            }
        }
        let now = Instant::now();
        // Before its ticks, which name it.
        if now >= self.next_policy
            && let Some(policy) = self.policy.take()
        {
            self.next_policy = now + self.period * TICKS_PER_POLICY;
            self.send(&Live::Policy(policy));
        }
        if now >= self.next_tick
            && let Some(tick) = self.tick.take()
        {
            // Batches come a little early and late; the rate is kept over both.
            self.next_tick = (self.next_tick + self.period).max(now - self.period);
            self.send(&Live::Tick(Box::new(tick)));
        }
    }

    fn send(&self, live: &Live) {
        // Nobody hears it where the network is cut.
        let _ = self.publisher.put(live.encode(self.bridge, self.hz)).wait();
    }
}
