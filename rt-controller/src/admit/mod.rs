//! What may enter: the checks of a policy before it drives the arm.

pub mod admission;
pub(crate) mod dry_run;
