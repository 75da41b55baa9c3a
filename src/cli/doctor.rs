//! Flags of `skillet doctor`.

use std::path::PathBuf;

use clap::Args;

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet doctor                         what to mend before a loop runs here
  skillet doctor --json | jq .verdict

Exit code: 0 when nothing is poor, 1 when something is.")]
pub struct DoctorArgs {
    /// Configuration file (TOML): priority and core of the loop
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
    /// Ask for real time, print what was granted, and end
    #[arg(long, hide = true)]
    pub attempt: bool,
}
