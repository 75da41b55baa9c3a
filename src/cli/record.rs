//! `skillet record`, `skillet replay` and `skillet watch`: their flags.

use std::net::SocketAddr;
use std::num::NonZero;
use std::path::PathBuf;

use clap::Args;

use super::CellArgs;

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet record --cell kitchen                       kitchen.mcap, until Ctrl-C
  skillet record --cell kitchen --out runs/a.mcap --duration-s 60
  skillet record --cell kitchen --by-rollout          one file per rollout

The files open in Foxglove, PlotJuggler and Rerun; `mcap info FILE` lists their contents. A killed
recorder loses its last second; the next recorder in the same folder repairs its file.")]
pub struct RecordArgs {
    #[command(flatten)]
    pub cell: CellArgs,
    /// File to write, NAME.mcap [default: the name of the cell]; existing files are kept, and the
    /// next free number is used
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Start a new file for every rollout
    #[arg(long)]
    pub by_rollout: bool,
    /// Start a new file at this size, MB
    #[arg(long, default_value = "512")]
    pub max_mb: NonZero<u64>,
    /// Stop after this many seconds
    #[arg(long)]
    pub duration_s: Option<f64>,
    /// Print one JSON object at the end
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet replay sessions/pancake-1 --trial 91        the best flip, as replay-91.mcap
  skillet replay sessions/pancake-1 --all             every trial, compared bit for bit

Reruns a trial from the session folder and compares the outcome with the stored one. Exits 1 if they
differ.")]
pub struct ReplayArgs {
    /// Session folder
    pub session: PathBuf,
    /// Rollout to rerun [default: the best one]
    #[arg(long, conflicts_with = "all")]
    pub trial: Option<u64>,
    /// Rerun every trial without recording
    #[arg(long)]
    pub all: bool,
    /// File to write [default: `replay-N.mcap` in the session folder]
    #[arg(long, conflicts_with = "all")]
    pub out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet watch --cell kitchen                loop, policies, rewards, with keys for commands
  skillet watch --cell kitchen --json         one JSON object per second, for scripts
  skillet watch --cell kitchen --web          in a browser: open the link that is printed
  skillet watch --cell kitchen --serve        for Foxglove: open the connection ws://127.0.0.1:8765

Viewers are best-effort: a slow or crashed one never affects the loop.")]
pub struct WatchArgs {
    #[command(flatten)]
    pub cell: CellArgs,
    /// Serve 3-D viewers over WebSocket, on a loopback address
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, default_missing_value = "127.0.0.1:8765")]
    pub serve: Option<SocketAddr>,
    /// Serve a page with the arm in 3-D, curves and a hold button, on a loopback address
    #[arg(
        long,
        value_name = "ADDRESS",
        num_args = 0..=1,
        default_missing_value = "127.0.0.1:8766",
        conflicts_with_all = ["serve", "json"]
    )]
    pub web: Option<SocketAddr>,
    /// Also allow the page to re-arm, activate, roll back and pin
    #[arg(long, requires = "web")]
    pub allow_commands: bool,
    /// Stop after this many seconds
    #[arg(long)]
    pub duration_s: Option<f64>,
    /// Print one JSON object per second
    #[arg(long, conflicts_with = "serve")]
    pub json: bool,
}
