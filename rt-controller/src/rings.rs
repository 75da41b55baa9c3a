//! What the executing thread and the exchange thread hand each other, through wait-free rings.

use rtrb::{Consumer, Producer};
use shm_types::channel::EpisodeLoan;
use shm_types::measures::Measures;
use shm_types::telemetry::TelemetryTick;

use crate::executor::flight::FlightRecord;
use crate::executor::recording::Recording;
use crate::fault::Fault;
use crate::hot::posture::PostureMove;

/// A rollout to execute: travels exchange → executing thread with the memory its records go to.
pub(crate) struct Job<P> {
    pub policy: P,
    pub policy_digest: u64,
    /// Where the null space is drawn to in it, unless it is an experiment or a newer order has come.
    pub posture: PostureOrder,
    /// Number of the rollout in the session.
    pub rollout: u64,
    pub episode: EpisodeLoan,
    /// The swap that it fulfils, to be acknowledged when the policy acts.
    pub swap: Option<u64>,
    /// A learner's proposal: a fault in it is its episode's matter.
    pub is_experiment: bool,
}

/// A policy for the rollout in progress.
pub(crate) struct Swap<P> {
    pub seq: u64,
    pub policy: P,
    pub policy_digest: u64,
}

/// An executed rollout: travels back.
pub(crate) struct Done {
    pub episode: EpisodeLoan,
    pub recording: Recording,
    pub fault: Fault,
    /// What only the plant could measure.
    pub measures: Measures,
}

/// The loop's word that a swap is done.
#[derive(Debug)]
pub(crate) struct Applied<P> {
    pub seq: u64,
    /// First tick in which no other policy acts alone, and when it began, ns.
    pub tick: u64,
    pub at_ns: u64,
    /// A rollout is in progress.
    pub in_rollout: bool,
    /// What the loop now holds, to be compared with what it was sent.
    pub policy: P,
}

/// A posture for all rollouts that are no experiments, the one in progress included; the highest number is the
/// newest.
#[derive(Clone, Copy)]
pub(crate) struct PostureOrder {
    pub seq: u64,
    pub to: PostureMove,
}

/// The loop's word that it has it.
pub(crate) struct PostureTaken {
    pub seq: u64,
    /// First tick that knows of it, and when it was taken, ns.
    pub tick: u64,
    pub at_ns: u64,
}

/// The executing thread's ends of the rings.
pub(crate) struct Ends<P> {
    pub jobs: Consumer<Job<P>>,
    pub swaps: Consumer<Swap<P>>,
    pub applied: Producer<Applied<P>>,
    pub postures: Consumer<PostureOrder>,
    pub postures_taken: Producer<PostureTaken>,
    pub done: Producer<Done>,
    pub telemetry: Producer<TelemetryTick>,
    pub flights: Producer<Box<FlightRecord>>,
    pub spare_flights: Consumer<Box<FlightRecord>>,
}

/// The exchange thread's ends.
pub(crate) struct ExchangeEnds<P> {
    pub jobs: Producer<Job<P>>,
    pub swaps: Producer<Swap<P>>,
    pub applied: Consumer<Applied<P>>,
    pub postures: Producer<PostureOrder>,
    pub postures_taken: Consumer<PostureTaken>,
    pub done: Consumer<Done>,
    pub flights: Consumer<Box<FlightRecord>>,
    pub spare_flights: Producer<Box<FlightRecord>>,
}
