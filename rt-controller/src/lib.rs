//! The hard loop: state in, torque out, once a millisecond.
//!
//! [`hot`] is what runs every period. Around it, the rt thread ([`executor`]) keeps the pace and owns the
//! plant, and the exchange thread ([`exchange`]) owns everything iceoryx2. The two share wait-free rings
//! only, so that no learner, observer or tool can delay a tick.

#![allow(non_snake_case)] // monogram notation: J_WP, X_WP

#[cfg(feature = "loop")]
pub mod admit;
#[cfg(feature = "loop")]
pub mod config;
#[cfg(feature = "loop")]
pub mod disk;
#[cfg(feature = "loop")]
mod exchange;
#[cfg(feature = "loop")]
pub mod executor;
#[cfg(feature = "loop")]
pub mod fault;
#[cfg(all(fuzzing, feature = "loop"))]
pub mod fuzzing;
pub mod hot;
#[cfg(feature = "loop")]
pub mod remote;
#[cfg(feature = "loop")]
mod rings;
#[cfg(feature = "loop")]
pub mod rt;
#[cfg(feature = "loop")]
pub mod run;
#[cfg(feature = "loop")]
mod serve;
#[cfg(feature = "loop")]
pub mod simulate;
#[cfg(feature = "loop")]
mod summary;

#[cfg(feature = "loop")]
pub use config::{ControllerConfig, Pace};
#[cfg(feature = "loop")]
pub use exchange::boot_id;
#[cfg(feature = "loop")]
pub use executor::action::run_action;
#[cfg(feature = "loop")]
pub use run::{Station, run, run_external};
#[cfg(feature = "loop")]
pub use summary::{RunError, RunSummary};
