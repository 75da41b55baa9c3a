//! The hard loop: state in, torque out, once a millisecond.
//!
//! [`tick`] is the hot path. Around it, the rt thread ([`run`]) keeps the pace and owns the plant,
//! and the exchange thread ([`exchange`]) owns everything iceoryx2. The two share wait-free rings
//! only, so that no learner, observer or tool can delay a tick.

#![allow(non_snake_case)] // monogram notation: J_WP, X_WP

pub mod action;
pub mod admission;
pub mod config;
mod exchange;
pub mod limits;
mod loop_report;
mod outcome_message;
pub mod policy;
mod request;
pub mod rollout;
pub mod rt;
pub mod run;
mod serve;
pub mod task;
pub mod tick;
mod timing;
pub mod wrench;

pub use action::run_action;
pub use config::{ControllerConfig, Pace};
pub use run::{RunError, RunSummary, run};
