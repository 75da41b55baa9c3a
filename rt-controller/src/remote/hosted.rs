//! A plant in another process for a rollout at a time: without cell, loop and pace. For studies and replays.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use physics::arm::JointVector;
use physics::plant::{Measurement, Plant, Presence};
use shm_types::plant::socket::SocketError;

use crate::exchange::boot_id;
use crate::remote::door::Door;
use crate::remote::plant::RemotePlant;
use crate::remote::{Seen, rings};
use crate::run::External;

/// Between two looks whether the plant has come.
const LOOK: Duration = Duration::from_millis(5);

pub struct Hosted {
    plant: RemotePlant,
    is_over: Arc<AtomicBool>,
    door: Option<JoinHandle<()>>,
}

impl Hosted {
    /// Opens the door; episodes begin at `q0`, rad.
    pub fn open(external: External, q0: &JointVector) -> Result<Hosted, SocketError> {
        let External { socket, expected } = external;
        let (ends, door_ends) = rings();
        let seen = Arc::new(Seen::default());
        let plant = RemotePlant::new(ends, seen.clone(), &expected, q0);
        let door = Door::open(&socket, expected, boot_id(), door_ends, seen)?;
        let is_over = Arc::new(AtomicBool::new(false));
        let stop = is_over.clone();
        let door = Some(std::thread::spawn(move || door.run(&stop)));
        Ok(Hosted { plant, is_over, door })
    }

    /// Whether the plant has come within `patience`.
    pub fn has_come(&mut self, patience: Duration) -> bool {
        let start = Instant::now();
        while start.elapsed() < patience {
            if self.plant.presence() == Presence::There {
                return true;
            }
            std::thread::sleep(LOOK);
        }
        false
    }
}

impl Drop for Hosted {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        if let Some(door) = self.door.take() {
            // One that panicked has said so.
            let _ = door.join();
        }
    }
}

impl Plant for Hosted {
    fn is_simulated(&self) -> bool {
        self.plant.is_simulated()
    }

    fn begin_reset(&mut self) {
        self.plant.begin_reset();
    }

    fn is_ready(&self) -> bool {
        self.plant.is_ready()
    }

    fn measure(&self) -> Measurement {
        self.plant.measure()
    }

    fn apply(&mut self, tau: &JointVector) {
        self.plant.apply(tau);
    }

    fn advance(&mut self) {
        self.plant.advance();
    }

    fn presence(&mut self) -> Presence {
        self.plant.presence()
    }
}
