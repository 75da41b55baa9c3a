//! What runs every period: a measurement in, a torque out. No heap, no lock, no log, no transport, no plant.

pub(crate) mod blend;
pub(crate) mod estimate;
pub mod limits;
pub(crate) mod measured;
pub(crate) mod monitor;
pub mod policy;
pub mod rollout;
pub mod task_space;
pub mod tick;
pub(crate) mod trust;
pub mod wrench;
