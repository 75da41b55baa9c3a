//! The contract between the controller and the learner: plain data and its channels.
//!
//! Every message is `#[repr(C)]`, versioned by its type name and by [`SCHEMA`], and validated by
//! its receiver. No mathematics and no policy logic live here.
//!
//! ```
//! use shm_types::policy::PolicyMsg;
//!
//! // Two numbers for a task without an arm, sealed with their digest.
//! let policy = PolicyMsg::of_action(&[0.8, 12.5]).sealed();
//! assert!(policy.validate().is_ok());
//! // Bits that change on the way are noticed by the receiver.
//! let changed = PolicyMsg { duration_s: 2.0, ..policy };
//! assert!(changed.validate().is_err());
//! ```
//!
//! Without the feature `transport` only the messages are left, for programs that never meet a cell.

#![allow(unsafe_code)] // only what the ZeroCopySend derive expands to

use std::hash::{BuildHasher, Hasher, RandomState};

mod schema;
#[macro_use]
mod message;

#[cfg(feature = "transport")]
mod advice;
#[cfg(feature = "transport")]
pub mod cell;
#[cfg(feature = "transport")]
pub mod channel;
pub mod command;
#[cfg(feature = "transport")]
pub mod echo;
pub mod episode;
pub mod equipment;
#[cfg(feature = "transport")]
mod generation;
#[cfg(feature = "transport")]
mod janitor;
pub mod measures;
pub mod news;
#[cfg(feature = "transport")]
mod observer;
#[cfg(feature = "transport")]
pub mod plant;
pub mod policy;
pub mod policy_json;
#[cfg(feature = "transport")]
pub mod ports;
#[cfg(feature = "transport")]
pub mod service_manager;
pub mod telemetry;
pub mod text;
#[cfg(feature = "transport")]
mod tool;

pub use schema::{Digest, SCHEMA};

/// A number that names a session, a request or a process. It is random and decides nothing.
pub fn random_id() -> u64 {
    RandomState::new().build_hasher().finish()
}

/// Joints of the largest arm a message can carry.
pub const MAX_JOINTS: usize = 7;
/// Task coordinates in the order x, y, z, pitch, roll, yaw (m and rad).
pub const TASK_DIM: usize = 6;
/// Attractors of the largest policy a message can carry.
pub const MAX_COMPONENTS: usize = 16;
/// Entries of the largest action vector of a task without arm.
pub const MAX_ACTIONS: usize = 16;
/// Entries of a packed lower triangle of a 6×6 matrix.
pub const PACKED: usize = TASK_DIM * (TASK_DIM + 1) / 2;
