//! `skillet cell`: its verbs and flags.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::{PaceArg, task_names};

#[derive(Args)]
pub struct CellsArgs {
    #[command(subcommand)]
    pub verb: CellVerb,
}

#[derive(Subcommand)]
pub enum CellVerb {
    /// Start the controller and the learner of a cell in the background
    Up(UpArgs),
    /// Stop the controller and the learner of a cell
    Down(DownArgs),
    /// List the cells of this user and what runs in them
    #[command(after_help = "Example: skillet cell list --json")]
    List {
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet cell up kitchen                            learns pancake into sessions/kitchen
  skillet cell up kitchen --config my.toml --pace max
  skillet cell up grill --config config/pancake.toml --session s7
  skillet cell up serving --no-learner               serves policies only

Returns once both are ready. They keep running after you log out, until `skillet cell down`. Services that already
run are left alone. An existing session is resumed. Logs are appended to files in the cell's state folder; a log
that exceeds 8 MB is renamed to LOG.1.")]
pub struct UpArgs {
    /// Name of the cell
    pub name: String,
    /// Task of a new session
    #[arg(long, value_parser = task_names(), conflicts_with = "config")]
    pub task: Option<String>,
    /// Configuration file (TOML) [default: the session's own, else the built-in defaults]
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// Session folder to create or resume [default: sessions/NAME]
    #[arg(long)]
    pub session: Option<PathBuf>,
    /// Pace of the loop
    #[arg(long, value_enum, default_value_t = PaceArg::Realtime)]
    pub pace: PaceArg,
    /// Record every rollout at full rate, as recording.mcap in the session folder
    #[arg(long, conflicts_with = "no_learner")]
    pub record: bool,
    /// Start the controller only
    #[arg(long)]
    pub no_learner: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
#[command(after_help = "\
Example: skillet cell down kitchen

Stops the learner first, then the controller; the session and the state of the cell are saved. A learner that also
works in other cells keeps running. If nothing runs, nothing happens. For services started by systemd use
`systemctl stop`, because systemd would restart them.")]
pub struct DownArgs {
    /// Name of the cell
    pub name: String,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}
