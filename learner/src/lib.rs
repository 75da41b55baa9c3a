//! The learner: improves a compliant policy from the outcomes of its rollouts.
//!
//! It knows messages ([`shm_types`]), rewards and search; it links no simulator and no controller.
//! Everything is a pure function of configuration, seed and stored trials: equal inputs give equal
//! bits, and a stopped session continues as if it had never stopped.
//!
//! ```
//! use learner::Demonstration;
//! use learner::initial_policy::{InitialPolicyConfig, initial_policy};
//!
//! // A movement of 1 s that rises by 10 cm, m and rad.
//! let mut csv = String::from("t_s,x_m,y_m,z_m,pitch_rad\n");
//! for k in 0..=50 {
//!     let u = f64::from(k) / 50.0;
//!     csv += &format!("{u},0.78,0.0,{},0.0\n", 0.6 + 0.1 * u * u * (3.0 - 2.0 * u));
//! }
//! let demonstration = Demonstration::parse("rise.csv", &csv)?;
//! // Springs of equal stiffness whose attractors follow it: where the search starts.
//! let policy = initial_policy(&demonstration, &InitialPolicyConfig::default());
//! assert_eq!(policy.components().len(), 8);
//! assert!(policy.validate().is_ok());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
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
