//! What the operating system must grant for hard real time. The only unsafe code of the crate.

mod clock;
mod thread;

pub use clock::{Clock, Wake, now_ns};
pub use thread::{Privileges, Raised, acquire};
