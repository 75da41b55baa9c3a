//! What observers see of a running controller: lossy by design.

use crate::MAX_JOINTS;
use iceoryx2::prelude::ZeroCopySend;

/// Ticks in one telemetry sample.
pub const TELEMETRY_TICKS: usize = 20;

message! {
    /// One tick as an observer sees it.
    pub struct TelemetryTick as "skillet/TelemetryTick/1" {
        pub tick: u64,
        pub phase: u32,
        pub fault: u32,
        /// Wake-up after the deadline, and time spent in the tick itself (without the plant), ns.
        pub wakeup_ns: u64,
        pub tick_ns: u64,
        /// Deadlines missed since the loop began.
        pub missed: u64,
        pub q: [f64; MAX_JOINTS],
        pub tau: [f64; MAX_JOINTS],
    }
}

message! {
    /// A batch of ticks.
    pub struct Telemetry as "skillet/Telemetry/1" {
        pub schema: u64,
        /// Ticks lost before this sample because the exchange thread was late.
        pub lost: u64,
        pub ticks: [TelemetryTick; TELEMETRY_TICKS],
    }
}

message! {
    /// "I am alive": a counter; its age tells.
    pub struct Heartbeat as "skillet/Heartbeat/3" {
        pub schema: u64,
        pub boot_id: u64,
        pub counter: u64,
        /// Of a controller: 1 while it serves a pinned policy and learners must wait.
        pub pinned: u64,
        /// Of a controller: the machine fault that holds the arm until it is re-armed, or 0.
        pub latched: u64,
    }
}

impl TelemetryTick {
    pub const ZERO: TelemetryTick = TelemetryTick {
        tick: 0,
        phase: 0,
        fault: 0,
        wakeup_ns: 0,
        tick_ns: 0,
        missed: 0,
        q: [0.0; MAX_JOINTS],
        tau: [0.0; MAX_JOINTS],
    };
}
