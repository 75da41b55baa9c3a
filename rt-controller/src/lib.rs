//! The hard loop: state in, torque out, once a millisecond.
//!
//! [`hot`] is what runs every period. Around it, the rt thread ([`executor`]) keeps the pace and owns the
//! plant, and the exchange thread ([`exchange`]) owns everything iceoryx2. The two share wait-free rings
//! only, so that no learner, observer or tool can delay a tick.

#![allow(non_snake_case)] // monogram notation: J_WP, X_WP

pub mod admit;
pub mod config;
pub mod disk;
mod exchange;
pub mod executor;
pub mod fault;
#[cfg(fuzzing)]
pub mod fuzzing;
pub mod hot;
pub mod remote;
mod rings;
pub mod rt;
pub mod run;
mod serve;
pub mod simulate;
mod summary;

pub use config::{ControllerConfig, Pace};
pub use exchange::boot_id;
pub use executor::action::run_action;
pub use run::{run, run_external};
pub use summary::{RunError, RunSummary};
