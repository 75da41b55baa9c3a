//! The arm by its own equations of motion, and a Rapier world for what its tip touches.
//!
//! Rapier integrates a multibody to first order and pays for columns that are zero. Here the arm is
//! integrated to second order from the mathematics of [`crate::arm`]; in Rapier its tip is a free body
//! that gives way as the arm would ([`EquivalentBody`]), and what it met there pushes the arm within
//! the same period.

mod arm;
mod equivalent;
mod stops;
mod tip;

use nalgebra::{Cholesky, Const};

use crate::arm::MAX_JOINTS;

pub use arm::{Arm, FreeMotion, Push};
pub use equivalent::EquivalentBody;
pub use tip::TipBody;

/// A factorised mass matrix.
type MassFactor = Cholesky<f64, Const<MAX_JOINTS>>;
