//! `skillet task`: its flags.

use std::path::PathBuf;

use clap::{Args, Subcommand};

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet task list
  skillet task list --json
  skillet task serve pancake --json")]
pub struct TaskArgs {
    #[command(subcommand)]
    pub verb: TaskVerb,
}

#[derive(Subcommand)]
pub enum TaskVerb {
    /// List the tasks and the measures of their rollouts
    List {
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Run rollouts for another program: one JSON object per line, in and out
    #[command(after_help = "\
Examples:
  skillet task serve pancake
  skillet task serve pancake --config config/pancake-aim.toml

The first output line describes the search: start, directions, box, measures, settings. Every input line is a request:
  {\"theta\": [0.1, …], \"path\": false}    runs θ; replies with reward, success, measures and fault
  {\"policy\": {…}}                       runs a policy as `policy export` prints it
  {\"decode\": [0.1, …]}                  replies with the policy of θ and runs nothing
The reply to a request that cannot be run is {\"refused\": \"why\"}. The command ends when its input ends. The
Python package's Task and environments use it; the rollouts are bitwise equal to those of a session.")]
    Serve(ServeArgs),
}

#[derive(Args)]
pub struct ServeArgs {
    /// Name of the task; see `skillet task list`
    pub task: String,
    /// Configuration file (TOML); see `skillet config`
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// Value of a `task.options` setting, as NAME=VALUE; may be repeated
    #[arg(long = "option", value_name = "NAME=VALUE", value_parser = choice, conflicts_with = "config")]
    pub options: Vec<(String, String)>,
    /// Print errors as JSON; all other output is JSON in any case
    #[arg(long)]
    pub json: bool,
}

/// Parses NAME=VALUE.
fn choice(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("write it as NAME=VALUE")?;
    Ok((name.into(), value.into()))
}
