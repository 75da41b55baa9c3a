//! The flight record: the last ticks before a fault, of every phase, as the loop saw them.
//!
//! The loop writes into one box while the other is being put on disk; the two change owner through
//! rings, and nothing is allocated.

use physics::arm::JointVector;
use physics::plant::Measurement;
use shm_types::TASK_DIM;
use shm_types::episode::TickRecord;

/// Ticks kept: a second at 1 kHz.
pub const FLIGHT_TICKS: usize = 1000;

/// One tick. The measurement is as it came, numbers or not.
#[derive(Clone, Copy)]
pub(crate) struct FlightTick {
    pub tick: u64,
    pub phase: u32,
    pub fault: u32,
    pub flags: u32,
    pub t_s: f64,
    pub late_ns: u64,
    pub measured: Measurement,
    /// What no torque explains, N·m.
    pub force: JointVector,
    pub tau: JointVector,
    pub x: [f64; TASK_DIM],
    pub attractor: [f64; TASK_DIM],
}

impl FlightTick {
    pub fn new(
        record: &TickRecord,
        measured: &Measurement,
        force: &JointVector,
        tau: &JointVector,
        late_ns: u64,
    ) -> FlightTick {
        FlightTick {
            tick: record.tick,
            phase: record.phase,
            fault: record.fault,
            flags: record.flags,
            t_s: record.t_s,
            late_ns,
            measured: *measured,
            force: *force,
            tau: *tau,
            x: record.x,
            attractor: record.attractor,
        }
    }
}

/// The newest [`FLIGHT_TICKS`] ticks, in a ring.
pub(crate) struct FlightRecord {
    /// Grows to its capacity once, and never beyond.
    ticks: Vec<FlightTick>,
    oldest: usize,
}

impl FlightRecord {
    pub fn new() -> FlightRecord {
        FlightRecord { ticks: Vec::with_capacity(FLIGHT_TICKS), oldest: 0 }
    }

    pub fn push(&mut self, tick: FlightTick) {
        if self.ticks.len() < FLIGHT_TICKS {
            self.ticks.push(tick);
        } else {
            self.ticks[self.oldest] = tick;
            self.oldest = (self.oldest + 1) % FLIGHT_TICKS;
        }
    }

    pub fn clear(&mut self) {
        self.ticks.clear();
        self.oldest = 0;
    }

    /// Oldest first.
    pub fn ticks(&self) -> impl Iterator<Item = &FlightTick> {
        self.ticks[self.oldest..].iter().chain(&self.ticks[..self.oldest])
    }

    /// The tick that faulted.
    pub fn last(&self) -> Option<&FlightTick> {
        self.ticks().last()
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use nalgebra::{UnitQuaternion, Vector3};
    use physics::plant::ObjectState;

    /// A record of `n` ticks, numbered from 0.
    pub fn record_of(n: u64) -> FlightRecord {
        let object = ObjectState {
            p_WO: Vector3::zeros(),
            R_WO: UnitQuaternion::identity(),
            in_contact: false,
        };
        let zeros = JointVector::zeros();
        let measured = Measurement { q: zeros, qd: zeros, object, sample: 0, t_ns: 0 };
        let mut record = FlightRecord::new();
        for tick in 0..n {
            let tick = TickRecord { tick, ..TickRecord::ZERO };
            record.push(FlightTick::new(&tick, &measured, &zeros, &zeros, 0));
        }
        record
    }

    #[test]
    fn the_newest_ticks_are_kept_in_order_and_in_place() {
        let n = FLIGHT_TICKS as u64;
        let mut record = record_of(2 * n + 7);
        let ticks: Vec<u64> = record.ticks().map(|tick| tick.tick).collect();
        assert_eq!(ticks, (n + 7..2 * n + 7).collect::<Vec<_>>());
        assert_eq!(record.last().unwrap().tick, 2 * n + 6);
        assert_eq!(record.ticks.capacity(), FLIGHT_TICKS, "it never grows");
        record.clear();
        assert_eq!((record.ticks().count(), record.ticks.capacity()), (0, FLIGHT_TICKS));
    }
}
