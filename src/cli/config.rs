//! Arguments of `skillet config`.

use std::path::PathBuf;

use clap::Args;

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet config > my.toml            every setting with its unit, range and description
  skillet config landscape            the same for another task
  skillet config --config my.toml     my.toml with all defaults filled in
  skillet config --check my.toml      check my.toml and every file it names")]
pub struct ConfigArgs {
    /// Task whose defaults are shown; see `skillet task list` [default: pancake]
    #[arg(conflicts_with = "config")]
    pub task: Option<String>,
    /// Configuration file (TOML) [default: the built-in defaults]
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// Check a configuration file and the files it names; exits 1 if something is wrong
    #[arg(long, value_name = "FILE", conflicts_with_all = ["task", "config", "schema", "markdown"])]
    pub check: Option<PathBuf>,
    /// Print a JSON Schema of the configuration file
    #[arg(long, conflicts_with_all = ["task", "config", "markdown"])]
    pub schema: bool,
    /// Print the reference page docs/settings.md
    #[arg(long, conflicts_with_all = ["task", "config", "json"])]
    pub markdown: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}
