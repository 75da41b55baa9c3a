//! What may enter: the checks of a policy before it drives the arm, and of a posture before the arm is drawn to it.

pub mod admission;
pub mod disturbance;
pub(crate) mod dry_run;
pub mod posture;
