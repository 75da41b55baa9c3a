//! `skillet child`: its flags. Used by this tool itself to start a judge's program.

use std::ffi::OsString;

use clap::Args;

#[derive(Args)]
pub struct ChildArgs {
    /// Process with which the program ends
    #[arg(long, value_name = "PID")]
    pub parent: u32,
    /// Program and arguments
    #[arg(last = true, required = true)]
    pub program: Vec<OsString>,
}
