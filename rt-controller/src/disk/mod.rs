//! What survives: the state of a cell, its episodes, its flight records.

pub(crate) mod catalogue;
pub mod flight_files;
pub(crate) mod keeper;
pub(crate) mod spool;
pub mod state_file;
pub mod timing_file;
