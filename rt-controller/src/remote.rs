//! A plant in another process: a simulator in lockstep, or a robot whose samples are the clock.
//!
//! A thread of its own minds the `door`: it lets plants in, compares what they say of themselves with
//! what is [`expected`], and sees off those that are gone. The rt thread holds the connection through
//! [`plant`]: a send and a receive a tick, beside the hot path and not in it, and no heap.

pub(crate) mod door;
pub mod expected;
pub mod plant;

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};

use rtrb::{Consumer, Producer, RingBuffer};
use shm_types::equipment::EQUIPMENT_PLANT_LEN;
use shm_types::plant::line::Line;
use shm_types::plant::socket::LinkError;
use shm_types::plant::{PlantCommand, PlantHello, PlantState};
use shm_types::text;
use thiserror::Error;

/// The controller's end of a line to a plant.
pub(crate) type ControllerLine = Line<PlantCommand, PlantState>;

/// What the plant that came last calls itself, with the version of its protocol; empty before the first. The door writes
/// it, the exchange reads it.
#[derive(Clone)]
pub(crate) struct PlantName(Arc<Mutex<[u8; EQUIPMENT_PLANT_LEN]>>);

impl PlantName {
    pub fn none() -> PlantName {
        PlantName(Arc::new(Mutex::new([0; EQUIPMENT_PLANT_LEN])))
    }

    pub fn set(&self, hello: &PlantHello) {
        let name = match hello.name() {
            name if name.is_empty() => "unnamed".to_string(),
            name => name,
        };
        let name = format!("{name} (plant protocol {})", hello.version);
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = text::pack(&name);
    }

    pub fn get(&self) -> [u8; EQUIPMENT_PLANT_LEN] {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A plant that was let in, with its first sample.
pub(crate) struct Arrival {
    pub line: ControllerLine,
    pub state: PlantState,
}

/// A line that the loop gave up, and why. It is taken apart off the rt thread.
pub(crate) struct Departure {
    pub why: Ended,
    pub _line: ControllerLine,
}

/// Why the loop gave a connection up.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub(crate) enum Ended {
    #[error(transparent)]
    Link(#[from] LinkError),
    #[error("it sent sample {found} after {last}: sample numbers must increase")]
    Sequence { found: u64, last: u64 },
    #[error("its time went from {last} to {found} ns: it must increase with every sample")]
    Time { found: u64, last: u64 },
    #[error("it sent a sample of episode {found} instead of {wanted}")]
    Episode { found: u64, wanted: u64 },
    #[error(
        "after a reset its joint {joint} is at {found:.4} rad and {speed:.4} rad/s: put it to the start \
         posture, {wanted:.4} rad, at rest"
    )]
    Start { joint: usize, found: f64, speed: f64, wanted: f64 },
    #[error("it replied with a message that is not a sample")]
    Message,
}

/// What the two threads hand each other.
pub(crate) struct Ends {
    pub arrivals: Consumer<Arrival>,
    pub departures: Producer<Departure>,
    pub has_hung_up: Arc<AtomicBool>,
}

pub(crate) struct DoorEnds {
    pub arrivals: Producer<Arrival>,
    pub departures: Consumer<Departure>,
    /// The plant in the loop has closed its end: seen while the loop does not look.
    pub has_hung_up: Arc<AtomicBool>,
}

pub(crate) fn rings() -> (Ends, DoorEnds) {
    // One plant at a time: the next one is let in when the last one has departed.
    let (arrive, arrivals) = RingBuffer::new(1);
    let (departures, depart) = RingBuffer::new(1);
    let has_hung_up = Arc::new(AtomicBool::new(false));
    let ends = Ends { arrivals, departures, has_hung_up: has_hung_up.clone() };
    (ends, DoorEnds { arrivals: arrive, departures: depart, has_hung_up })
}
