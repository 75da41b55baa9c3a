//! `skillet trials`: its flags.

use std::path::PathBuf;

use clap::Args;

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet trials sessions/pancake-1 > trials.csv
  skillet trials sessions/pancake-1 --csv trials.csv
  skillet trials sessions/pancake-1 --json

One row per trial. Column names carry the units; reward, shares and theta (the scaled search vector of
a task with an arm) have none. Times count from the start of the movement. Numbers round-trip bit for
bit. A session of several cells also has cell, asked_after, arm, arm_urdf (12 digits of its SHA-256) and plant.")]
pub struct TrialsArgs {
    /// Session folder
    pub session: PathBuf,
    /// File to write, or - for standard output; never overwrites a file
    #[arg(long, value_name = "FILE", default_value = "-", conflicts_with = "json")]
    pub csv: PathBuf,
    /// Print JSON, one object per trial
    #[arg(long)]
    pub json: bool,
}
