//! The hard loop: state in, torque out, once a millisecond.
//!
//! [`tick`] is the hot path. Around it, the rt thread ([`run`]) keeps the pace and owns the plant,
//! and the exchange thread ([`exchange`]) owns everything iceoryx2. The two share wait-free rings
//! only, so that no learner, observer or tool can delay a tick.

#![allow(non_snake_case)] // monogram notation: J_WP, X_WP

pub mod action;
pub mod admission;
mod blend;
mod catalogue;
mod commands;
pub mod config;
mod dry_run;
mod estimate;
mod exchange;
pub mod fault;
mod flight;
pub mod flight_files;
#[cfg(fuzzing)]
pub mod fuzzing;
mod hand_over;
mod keeper;
mod latch;
mod learner_link;
pub mod limits;
mod loop_report;
mod measured;
mod monitor;
mod outcome_message;
pub mod policy;
mod recording;
pub mod rollout;
pub mod rt;
mod rt_loop;
pub mod run;
mod safety;
mod serve;
mod serving;
pub mod simulate;
mod spool;
mod stalls;
pub mod state_file;
mod status;
mod swap;
pub mod task;
pub mod tick;
mod timing;
pub mod timing_file;
mod trust;
pub mod wrench;

pub use action::run_action;
pub use config::{ControllerConfig, Pace};
pub use run::{RunError, RunSummary, run};
