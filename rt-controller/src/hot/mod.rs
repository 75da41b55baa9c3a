//! What runs every period: a measurement in, a torque out. No heap, no lock, no log, no transport, no plant.

#[cfg(feature = "loop")]
pub(crate) mod blend;
#[cfg(feature = "loop")]
pub(crate) mod estimate;
#[cfg(feature = "loop")]
pub mod limits;
#[cfg(feature = "loop")]
pub(crate) mod measured;
#[cfg(feature = "loop")]
pub(crate) mod monitor;
pub mod policy;
#[cfg(feature = "loop")]
pub mod posture;
#[cfg(feature = "loop")]
pub mod rollout;
pub mod task_space;
#[cfg(feature = "loop")]
pub mod tick;
#[cfg(feature = "loop")]
pub(crate) mod trust;
#[cfg(feature = "loop")]
pub mod wrench;
