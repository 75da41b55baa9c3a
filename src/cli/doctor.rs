//! Flags of `skillet doctor`.

use std::path::PathBuf;

use clap::Args;

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet doctor                         what to fix before a loop runs here
  skillet doctor --json | jq .verdict

Exits 1 if any check is poor.")]
pub struct DoctorArgs {
    /// Configuration file (TOML) with the loop's priority and core
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
    /// Request real-time scheduling, print what was granted, and exit
    #[arg(long, hide = true)]
    pub attempt: bool,
}
