//! The real-time thread: it keeps the pace, owns the plant, and fills the memory of episodes.

pub mod action;
pub(crate) mod arm;
pub(crate) mod flight;
pub(crate) mod latch;
pub(crate) mod recording;
