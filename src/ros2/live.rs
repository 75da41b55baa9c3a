//! A running cell on a ROS 2 graph.
//!
//! Best-effort: the cell is observed as `skillet watch` observes it, and a slow network loses messages. Neither affects
//! the loop.

use std::collections::VecDeque;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::Result;
use bridge::net::NetError;
use bridge::ros2::layout::NodeName;
use bridge::ros2::node::{Graph, Link, Node};
use shm_types::cell::Cell;
use shm_types::channel::ChannelError;
use shm_types::policy::PolicyMsg;
use shm_types::telemetry::TelemetryTick;

use super::conversion::Conversion;
use super::graph::GraphOutlet;
use super::pace::Pace;
use super::robot::{Robot, Scope};
use crate::config::Config;
use crate::record::messages::{Measures, Outcome, Policy, Trial};
use crate::record::watcher::{Seen, Watcher, pause};
use crate::setup;
use crate::watch::vitals::Vitals;

/// Between two attempts to reach the router or a controller, and between two looks whether they are there.
const AGAIN: Duration = Duration::from_secs(1);
const LOOK: Duration = Duration::from_millis(50);
/// Policies remembered: the one in the loop, and those on their way to it.
const KNOWN: usize = 8;
/// What tf2 interpolates between, Hz.
const MAX_FRAMES: u32 = 100;

/// Which cell is published, where, as which node, and how often at most.
pub struct LiveConfig<'a> {
    pub cell: &'a Cell,
    pub config: &'a Config,
    pub graph: Graph,
    pub node: NodeName,
    pub rate_hz: u32,
}

/// Publishes the cell until `is_over`.
pub fn run(live: &LiveConfig, is_over: &dyn Fn() -> bool) -> Result<()> {
    let robot =
        live.config.has_arm().then(|| Robot::new(live.config, setup::arm_text(live.config)?));
    let robot = robot.transpose()?;
    let Some(node) = reach(live, is_over)? else { return Ok(()) };
    let (name, cell) = (&live.node, live.cell.name());
    let (node_name, domain, address) =
        (format!("{}/{}", name.namespace, name.name), name.domain, node.address());
    tracing::info!("cell '{cell}' is the ROS 2 node {node_name} of domain {domain} at {address}");
    let mut router = Router { link: node.link(), address: address.to_string(), is_there: true };
    let outlet = GraphOutlet::new(node, &name.namespace);
    let frames_every = u64::from(live.rate_hz.div_ceil(MAX_FRAMES));
    let mut told = Told {
        conversion: Conversion::new(outlet, robot, frames_every)?,
        pace: Pace::new(live.rate_hz),
        known: VecDeque::new(),
    };
    let Some(mut watcher) = watcher(live, is_over)? else { return Ok(()) };
    let (mut vitals, mut looked) = (Vitals::of(live.cell), Instant::now());
    while !is_over() {
        let round = Instant::now();
        while let Some(seen) = watcher.next()? {
            if matches!(seen, Seen::Tick(..)) {
                vitals.ticked();
            }
            told.take(seen)?;
        }
        vitals.look();
        for change in vitals.changes() {
            tracing::warn!("{change}");
            told.conversion.warn(change, now_ns())?;
        }
        if looked.elapsed() >= AGAIN {
            looked = Instant::now();
            router.look();
        }
        pause(round);
    }
    Ok(())
}

/// Joins the graph, however long it takes; `None` when it is over before.
fn reach(live: &LiveConfig, is_over: &dyn Fn() -> bool) -> Result<Option<Node>> {
    let mut has_complained = false;
    loop {
        match Node::open(&live.graph, live.node.clone()) {
            Ok(node) => return Ok(Some(node)),
            Err(error @ NetError::Transport { .. }) if matches!(live.graph, Graph::Router(_)) => {
                if !has_complained {
                    tracing::warn!(
                        "no Zenoh router: {error}; start one, as with `ros2 run rmw_zenoh_cpp rmw_zenohd`, or see \
                         --connect; trying again every second"
                    );
                    has_complained = true;
                }
            }
            Err(error) => return Err(error.into()),
        }
        if !wait(is_over) {
            return Ok(None);
        }
    }
}

/// An observer of the cell, as soon as it has a controller; `None` when it is over before.
fn watcher(live: &LiveConfig, is_over: &dyn Fn() -> bool) -> Result<Option<Watcher>> {
    let period = Duration::from_nanos(live.config.controller.period_ns());
    let mut has_complained = false;
    loop {
        match Watcher::open(live.cell, period, LOOK) {
            Ok(watcher) => return Ok(Some(watcher)),
            Err(error) => match error.downcast_ref() {
                Some(ChannelError::NoController { .. }) if !has_complained => {
                    tracing::warn!("{error}; waiting for it");
                    has_complained = true;
                }
                Some(ChannelError::NoController { .. }) => {}
                _ => return Err(error),
            },
        }
        if !wait(is_over) {
            return Ok(None);
        }
    }
}

/// Until it is time to try again; false when it is over.
fn wait(is_over: &dyn Fn() -> bool) -> bool {
    let since = Instant::now();
    while since.elapsed() < AGAIN && !is_over() {
        std::thread::sleep(LOOK);
    }
    !is_over()
}

/// What is known of the router, and said of it when it changes. Zenoh connects again by itself.
struct Router {
    link: Link,
    address: String,
    is_there: bool,
}

impl Router {
    fn look(&mut self) {
        let (was_there, address) = (self.is_there, &self.address);
        self.is_there = self.link.is_connected();
        match (was_there, self.is_there) {
            (true, false) => tracing::warn!(
                "the router at {address} is gone; messages are lost until it is back"
            ),
            (false, true) => tracing::info!("the router at {address} is back"),
            _ => {}
        }
    }
}

/// What is seen, told to the graph.
struct Told {
    conversion: Conversion<GraphOutlet>,
    pace: Pace,
    /// Digests of policies, and how many task coordinates each has learnt, the newest first.
    known: VecDeque<(u64, usize)>,
}

impl Told {
    fn take(&mut self, seen: Seen) -> Result<()> {
        match seen {
            Seen::Tick(tick, at_ns) => self.tick(&tick, at_ns),
            Seen::Policy(policy) => self.policy(&policy),
            Seen::Outcome(header) => self.conversion.outcome(&Outcome::from(&*header), now_ns()),
            Seen::Trial(news) => self.conversion.trial(&Trial::from(&*news), now_ns()),
            Seen::Measures(news) => self.conversion.measures(&Measures::from(&*news), now_ns()),
            Seen::Bridged(bridged) => {
                tracing::warn!("{}", bridged.sentence());
                self.conversion.warn(bridged.sentence(), now_ns())
            }
            // Told with those that stand still; ticks are left out on purpose.
            Seen::ControllerGone | Seen::ControllerBack | Seen::Lost(_) => Ok(()),
        }
    }

    fn tick(&mut self, tick: &TelemetryTick, at_ns: u64) -> Result<()> {
        let Some(stamp_ns) = self.pace.stamp(at_ns, now_ns()) else { return Ok(()) };
        let policy = self.known.iter().find(|(digest, _)| *digest == tick.policy_digest);
        let n_learnt = policy.map_or(0, |(_, task_dim)| *task_dim);
        self.conversion.tick(&tick.record, Scope { n_learnt, has_object: true }, stamp_ns)
    }

    /// A policy in the loop is said ten times a second, and told once. What a controller would not admit is not believed.
    fn policy(&mut self, policy: &PolicyMsg) -> Result<()> {
        let is_known = self.known.iter().any(|(digest, _)| *digest == policy.digest);
        if is_known || policy.validate().is_err() {
            return Ok(());
        }
        self.known.push_front((policy.digest, policy.task_dim as usize));
        self.known.truncate(KNOWN);
        self.conversion.policy(&Policy::from(policy), now_ns())
    }
}

/// Since the epoch.
fn now_ns() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos() as u64
}
