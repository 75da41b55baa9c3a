//! What the operating system must grant for hard real time. The only unsafe code of the crate.

mod clock;
mod cores;
mod thread;

pub use clock::{Clock, Wake, now_ns};
pub use cores::{leave_core, loop_core};
pub use thread::{Privileges, Raised, acquire};
