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
  skillet record --cell kitchen --by-rollout          a file for every rollout

The files open in Foxglove, PlotJuggler and Rerun; `mcap info FILE` lists what is in them. A recorder
that is killed loses its last second; the next one that records into the folder completes its file.")]
pub struct RecordArgs {
    #[command(flatten)]
    pub cell: CellArgs,
    /// File to write, NAME.mcap; the name of the cell when absent. What exists is kept, the next
    /// free number is taken
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// A new file for every rollout
    #[arg(long)]
    pub by_rollout: bool,
    /// A new file when one has grown so large
    #[arg(long, default_value = "512")]
    pub max_mb: NonZero<u64>,
    /// Stop after so many seconds
    #[arg(long)]
    pub duration_s: Option<f64>,
    /// Print one JSON object at the end
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet replay sessions/pancake-1 --trial 91        the best flip again, as replay-91.mcap
  skillet replay sessions/pancake-1 --all             every trial again, compared bit for bit

A trial is executed again from what the session folder holds, and its outcome compared with what was
stored. Exit code 1: it differs.")]
pub struct ReplayArgs {
    /// Session folder
    pub session: PathBuf,
    /// Rollout to run again; the best one when absent
    #[arg(long, conflicts_with = "all")]
    pub trial: Option<u64>,
    /// Run every trial again, and record none
    #[arg(long)]
    pub all: bool,
    /// File to write; `replay-N.mcap` in the session folder when absent
    #[arg(long, conflicts_with = "all")]
    pub out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet watch --cell kitchen                loop, policies, rewards; keys to act
  skillet watch --cell kitchen --json         one JSON object a second, for scripts
  skillet watch --cell kitchen --serve        for Foxglove: open the connection ws://127.0.0.1:8765

Whoever watches is lossy by design: a watcher that is slow or dies is noticed by nobody.")]
pub struct WatchArgs {
    #[command(flatten)]
    pub cell: CellArgs,
    /// Serve 3-D viewers over WebSocket, on a loopback address
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, default_missing_value = "127.0.0.1:8765")]
    pub serve: Option<SocketAddr>,
    /// Stop after so many seconds
    #[arg(long)]
    pub duration_s: Option<f64>,
    /// Print one JSON object a second
    #[arg(long, conflicts_with = "serve")]
    pub json: bool,
}
