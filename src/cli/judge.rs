//! `skillet judge`: its flags.

use std::path::PathBuf;

use clap::Args;

#[derive(Args)]
#[command(after_help = "\
Example:
  skillet judge --again sessions/pancake-1 --config new.toml

Judges every stored trial anew, by the judge of another configuration, from what was measured of it:
task.judge there, or learner.reward. No program is started: what it said is among the measures. The
output says what would have been another success or another reward; the session stays as it is.")]
pub struct JudgeArgs {
    /// Session folder whose trials are judged once more
    #[arg(long, value_name = "SESSION")]
    pub again: PathBuf,
    /// Configuration (TOML) with the other judge
    #[arg(long)]
    pub config: PathBuf,
    /// Print JSON: every trial with both verdicts
    #[arg(long)]
    pub json: bool,
}
