//! The learner: improves a compliant policy from the outcomes of its rollouts.
//!
//! It knows messages ([`shm_types`]), rewards and search; it links no simulator and no controller.
//! Everything is a pure function of configuration, seed and stored trials: equal inputs give equal
//! bits, and a stopped session continues as if it had never stopped.

#![forbid(unsafe_code)]

pub mod action;
pub mod activation;
pub mod compliance;
pub mod config;
pub mod damping;
pub mod demonstration;
mod error;
pub mod exploration;
pub mod expression;
pub mod history;
pub mod initial_policy;
pub mod judge;
pub mod learner;
pub mod mail;
pub mod modes;
pub mod parameters;
pub mod path;
pub mod people;
pub mod prediction;
pub mod problem;
pub mod repertoire;
pub mod replay;
pub mod reward;
pub mod session;
pub mod smoothing;
pub mod store;
pub mod summary;
pub mod targets;
pub mod trajectory;
pub mod wish;

pub use config::LearnerConfig;
pub use demonstration::Demonstration;
pub use error::{CompleteError, LearnerError};
pub use learner::Learner;
