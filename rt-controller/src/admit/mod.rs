//! What may enter: the checks of a policy before it drives the arm, and of a posture before the arm is drawn to it.

pub mod admission;
pub(crate) mod dry_run;
pub mod posture;
