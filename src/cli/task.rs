//! `skillet task`: its flags.

use clap::{Args, Subcommand};

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet task list
  skillet task list --json")]
pub struct TaskArgs {
    #[command(subcommand)]
    pub verb: TaskVerb,
}

#[derive(Subcommand)]
pub enum TaskVerb {
    /// List the tasks with what is measured of their rollouts
    List {
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
}
