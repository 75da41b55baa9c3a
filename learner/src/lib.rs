//! The learner: improves a compliant policy from the outcomes of its rollouts.
//!
//! It knows messages ([`shm_types`]), rewards and search; it links no simulator and no controller.
//! Everything is a pure function of configuration, seed and stored trials: equal inputs give equal
//! bits, and a stopped session continues as if it had never stopped.
//!
//! Without the feature `session` the mathematics is left: what is searched, from where and along which
//! directions.

#![forbid(unsafe_code)]

pub mod action;
pub mod activation;
#[cfg(feature = "session")]
pub mod cells;
pub mod compliance;
pub mod config;
pub mod damping;
pub mod demonstration;
pub mod encoding;
mod error;
pub mod exploration;
pub mod expression;
#[cfg(feature = "session")]
pub mod history;
pub mod initial_policy;
pub mod judge;
#[cfg(feature = "session")]
pub mod learner;
#[cfg(feature = "session")]
pub mod mail;
pub mod modes;
pub mod orientation;
pub mod parameters;
pub mod path;
pub mod people;
pub mod prediction;
pub mod problem;
#[cfg(feature = "session")]
pub mod ratings;
#[cfg(feature = "session")]
pub mod repertoire;
#[cfg(feature = "session")]
pub mod replay;
pub mod reward;
#[cfg(feature = "session")]
pub mod session;
pub mod smoothing;
#[cfg(feature = "session")]
pub mod store;
#[cfg(feature = "session")]
pub mod summary;
pub mod targets;
pub mod trajectory;
#[cfg(feature = "session")]
pub mod wish;

pub use config::LearnerConfig;
pub use demonstration::Demonstration;
pub use error::{CompleteError, LearnerError};
#[cfg(feature = "session")]
pub use learner::Learner;
