//! Flags of `skillet soak`.

use std::num::NonZero;
use std::path::PathBuf;

use clap::Args;

use super::PaceArg;

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet soak --minutes 60          three cells learn under kills, swaps and observers
  skillet soak --kills 200 --json    until every kind of kill has happened 200 times in each cell

Kills controllers, learners and external plants at random instants, one by one, together and during
start-up. After a plant alone dies, the arm must be held until it is re-armed. Each session is compared
bit for bit with an undisturbed one. Exits 1 if anything was lost, differs or did not come back, and
then keeps the folder with the logs.")]
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
    /// What paces the loops
    #[arg(long, value_enum, default_value_t = PaceArg::Max)]
    pub pace: PaceArg,
    /// Folder for sessions and logs, which is then always kept
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
