//! Cells on other machines: one learner, and controllers that are elsewhere.
//!
//! Learner and controller know nothing of it. On the learner's machine the **hub** plays the controller of a local
//! cell for every remote one; on the machine of a cell **join** plays its learner. Between the two goes one exchange,
//! the *turn*: a query of the cell, and an answer that says what is durable and what is to be executed.
//!
//! ```text
//! learner ─ shared memory ─ hub ═══ network ═══ join ─ shared memory ─ controller
//! ```
//!
//! ```
//! use bridge::turn::{MessageError, Turn};
//!
//! // Everything that comes over the network is checked before use.
//! assert_eq!(Turn::decode(b"GET / HTTP/1.1\r\nHost: hub\r\n\r\n"), Err(MessageError::Magic));
//! ```
//!
//! Only the messages are built without the feature `network`.

pub mod acks;
pub mod answer;
pub mod backoff;
pub mod command;
#[cfg(feature = "network")]
mod counter;
#[cfg(feature = "network")]
mod desk;
pub mod event;
#[cfg(feature = "network")]
pub mod hub;
#[cfg(feature = "network")]
pub mod join;
#[cfg(feature = "network")]
pub mod keys;
pub mod live;
pub mod message;
#[cfg(feature = "network")]
pub mod net;
#[cfg(feature = "network")]
mod relay;
pub mod ros2;
#[cfg(feature = "network")]
mod said;
#[cfg(feature = "network")]
mod seat;
pub mod turn;
