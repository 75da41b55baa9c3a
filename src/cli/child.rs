//! `skillet child`: its flags. For this tool itself, which starts a judge's program by it.

use std::ffi::OsString;

use clap::Args;

#[derive(Args)]
pub struct ChildArgs {
    /// The process with which the program is to end
    #[arg(long, value_name = "PID")]
    pub parent: u32,
    /// Program and arguments
    #[arg(last = true, required = true)]
    pub program: Vec<OsString>,
}
