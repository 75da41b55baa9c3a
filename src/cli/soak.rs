//! Flags of `skillet soak`.

use std::num::NonZero;
use std::path::PathBuf;

use clap::Args;

use super::PaceArg;

const ACROSS: &str = "Across machines";

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet soak --minutes 60          three cells learn under kills, swaps and observers
  skillet soak --kills 200 --json    until every kind of kill has happened 200 times in each cell
  sudo skillet soak --hosts 3 --cells 4 --minutes 60 --rollouts 100    across machines, over a bridge

Kills controllers, learners and external plants at random instants, one by one, together and during
start-up. After a plant alone dies, the arm must be held until it is re-armed. Each session is compared
bit for bit with an undisturbed one. Exits 1 if anything was lost, differs or did not come back, and
then keeps the folder with the logs.

With --hosts each host is a network namespace: the first has learner and `bridge serve`, the others have
cells with `bridge join`. Between them packets are delayed, lost, duplicated and reordered, links are cut
for moments and for longer than a lease, and every process is killed. Needs root, `ip` and a build with
the feature `bridge`.")]
pub struct SoakArgs {
    /// Duration, min [default: 2, or as long as --kills takes]
    #[arg(long, value_name = "MIN", value_parser = minutes)]
    pub minutes: Option<f64>,
    /// End once every kind of kill has happened N times in each cell
    #[arg(long, value_name = "N")]
    pub kills: Option<u64>,
    /// Rollouts per session; sessions run one after another
    #[arg(long, value_name = "N", default_value = "40")]
    pub rollouts: NonZero<u64>,
    /// Seed of the schedule
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Pace of the loops
    #[arg(long, value_enum, default_value_t = PaceArg::Max)]
    pub pace: PaceArg,
    /// Run the cells on N hosts (including the learner's) over a bridge instead
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(2..=9), conflicts_with = "kills")]
    #[arg(help_heading = ACROSS)]
    pub hosts: Option<u8>,
    /// Number of cells, spread over all hosts except the learner's
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u8).range(1..=64))]
    #[arg(requires = "hosts", help_heading = ACROSS)]
    pub cells: u8,
    /// Delay of each packet, one way, ms
    #[arg(long, value_name = "MS", default_value_t = 200, value_parser = clap::value_parser!(u16).range(0..=2000))]
    #[arg(requires = "hosts", help_heading = ACROSS)]
    pub delay_ms: u16,
    /// Share of packets that are lost
    #[arg(long, value_name = "SHARE", default_value_t = 0.01, value_parser = share)]
    #[arg(requires = "hosts", help_heading = ACROSS)]
    pub loss: f64,
    /// Share of packets that arrive twice
    #[arg(long, value_name = "SHARE", default_value_t = 0.01, value_parser = share)]
    #[arg(requires = "hosts", help_heading = ACROSS)]
    pub duplicate: f64,
    /// Share of packets that are reordered
    #[arg(long, value_name = "SHARE", default_value_t = 0.02, value_parser = share)]
    #[arg(requires = "hosts", help_heading = ACROSS)]
    pub reorder: f64,
    /// Folder for sessions and logs; if given, it is always kept
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
}

fn minutes(text: &str) -> Result<f64, String> {
    let minutes: f64 = text.parse().map_err(|_| "write a number of minutes")?;
    match (0.01..=1e5).contains(&minutes) {
        true => Ok(minutes),
        false => Err("use 0.01 to 100000 minutes".into()),
    }
}

fn share(text: &str) -> Result<f64, String> {
    let share: f64 = text.parse().map_err(|_| "write a number, as in 0.01")?;
    match (0.0..=0.5).contains(&share) {
        true => Ok(share),
        false => Err("use 0 to 0.5".into()),
    }
}
