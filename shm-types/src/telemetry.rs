//! Telemetry of a running controller for observers: lossy by design.

use crate::SCHEMA;
use crate::episode::TickRecord;
use crate::equipment::Equipment;
use crate::text::{self, HOST_LEN, NO_HOST};
#[cfg(feature = "transport")]
use iceoryx2::prelude::ZeroCopySend;

/// Ticks in one telemetry sample.
pub const TELEMETRY_TICKS: usize = 20;

/// Values of [`Heartbeat::waits`]: the learner waits for nothing, for a full disk, for a judge, or for a
/// person's rating. A learner that asks for a demonstration continues meanwhile.
pub const WAITS_NOT: u64 = 0;
pub const WAITS_DISK: u64 = 1;
pub const WAITS_JUDGE: u64 = 2;
pub const WAITS_RATING: u64 = 3;
pub const ASKS_DEMONSTRATION: u64 = 4;

message! {
    /// One tick as an observer sees it.
    pub struct TelemetryTick as "skillet/TelemetryTick/2" {
        pub record: TickRecord,
        /// Digest of the policy in the loop, or of the last one; 0 before the first.
        pub policy_digest: u64,
        /// Wake-up after the deadline, and time spent in the tick itself (without the plant), ns.
        pub wakeup_ns: u64,
        pub tick_ns: u64,
        /// Deadlines missed since the loop began.
        pub missed: u64,
    }
}

message! {
    /// A batch of ticks.
    pub struct Telemetry as "skillet/Telemetry/3" {
        pub schema: u64,
        /// Ticks lost before this sample because the exchange thread was late.
        pub lost: u64,
        /// Ticks in use, from the start.
        pub n_ticks: u64,
        /// Machine of the controller where a bridge lies between, else [`NO_HOST`]; and how many ticks a second
        /// it sends at most. Those between are left out, not lost.
        pub via: [u8; HOST_LEN],
        pub via_hz: u64,
        pub ticks: [TelemetryTick; TELEMETRY_TICKS],
    }
}

message! {
    /// A heartbeat: a counter, whose age shows whether the sender is alive.
    pub struct Heartbeat as "skillet/Heartbeat/6" {
        pub schema: u64,
        pub boot_id: u64,
        pub counter: u64,
        /// Controller: 1 while it serves a pinned policy and learners must wait.
        pub pinned: u64,
        /// Controller: the hardware fault that holds the arm until it is re-armed, or 0.
        pub latched: u64,
        /// Learner: 1 in its last heartbeat, when it ends cleanly.
        pub leaving: u64,
        /// Learner: `WAITS_*`.
        pub waits: u64,
        /// Controller: what it drives.
        pub equipment: Equipment,
    }
}

impl Heartbeat {
    /// What stands for a process that has sent nothing yet.
    pub const NONE: Heartbeat = Heartbeat {
        schema: 0,
        boot_id: 0,
        counter: 0,
        pinned: 0,
        latched: 0,
        leaving: 0,
        waits: 0,
        equipment: Equipment::UNKNOWN,
    };

    /// It comes from this build and holds text where text belongs.
    pub fn is_valid(&self) -> bool {
        self.schema == SCHEMA && self.equipment.is_valid()
    }
}

impl Telemetry {
    pub const EMPTY: Telemetry = Telemetry {
        schema: SCHEMA,
        lost: 0,
        n_ticks: 0,
        via: NO_HOST,
        via_hz: 0,
        ticks: [TelemetryTick::ZERO; TELEMETRY_TICKS],
    };

    /// The machine behind a bridge that it came from.
    pub fn via(&self) -> Option<String> {
        text::host(&self.via)
    }

    /// The ticks in use; none of a sample of another build.
    pub fn ticks(&self) -> &[TelemetryTick] {
        let n_ticks = if self.schema == SCHEMA { self.n_ticks as usize } else { 0 };
        &self.ticks[..n_ticks.min(TELEMETRY_TICKS)]
    }
}

impl TelemetryTick {
    pub const ZERO: TelemetryTick = TelemetryTick {
        record: TickRecord::ZERO,
        policy_digest: 0,
        wakeup_ns: 0,
        tick_ns: 0,
        missed: 0,
    };
}
