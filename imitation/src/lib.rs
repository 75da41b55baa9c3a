//! Learns movements from demonstrations: mixtures, regression, stable fields and primitives.
//! It knows no robot, transport or database.

#![allow(non_snake_case)] // matrices
#![forbid(unsafe_code)]

mod gaussian;
mod lists;
pub mod mixture;
pub mod recording;
pub mod systems;

pub use mixture::Mixture;
pub use recording::Recording;
pub use systems::Systems;
