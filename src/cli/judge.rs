//! `skillet judge`: its flags.

use std::path::PathBuf;

use clap::Args;

#[derive(Args)]
#[command(after_help = "\
Example:
  skillet judge sessions/pancake-1 --config new.toml

Judges every stored trial again from its measures, with another configuration's judge (task.judge or
learner.reward). No program is started: a program's results are among the measures. The output counts the
trials whose reward would change and lists those whose success would; the session stays as it is. To rate a
rollout yourself, see `skillet rate`.")]
pub struct JudgeArgs {
    /// Session folder with the trials to re-judge
    pub session: PathBuf,
    /// Configuration (TOML) with the other judge
    #[arg(long)]
    pub config: PathBuf,
    /// Print JSON: every trial with both verdicts
    #[arg(long)]
    pub json: bool,
}
