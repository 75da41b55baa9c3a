//! `skillet plant`: plants in another process.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use crate::config::plant::PlantKind;

/// The plant, which turns torques into measurements.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub enum KindArg {
    /// Simulated by the controller
    Simulated,
    /// Another process that connects to the controller
    External,
}

impl From<KindArg> for PlantKind {
    fn from(kind: KindArg) -> Self {
        match kind {
            KindArg::Simulated => PlantKind::Simulated,
            KindArg::External => PlantKind::External,
        }
    }
}

#[derive(Args)]
pub struct PlantArgs {
    #[command(subcommand)]
    pub verb: PlantVerb,
}

#[derive(Subcommand)]
pub enum PlantVerb {
    /// Serve a task's simulated world to a controller with an external plant
    Serve(ServeArgs),
    /// Check your own plant step by step, one verdict per line
    Check(CheckArgs),
}

#[derive(Args)]
#[command(after_help = "\
Example, in two terminals:
  skillet controller --cell kitchen --plant external --pace max
  skillet plant serve --cell kitchen")]
pub struct ServeArgs {
    /// Cell of the controller [default: `cell.name` of the configuration]
    #[arg(long)]
    pub cell: Option<String>,
    /// Configuration file (TOML) with the task and the arm
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// Poll shared memory for replies; needs a spare core
    #[arg(long)]
    pub poll: bool,
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet plant check                                        waits for a plant in the cell `skillet`
  skillet plant check --program \"python3 examples/plant_mujoco.py\" --json")]
pub struct CheckArgs {
    /// Cell to wait in [default: `cell.name` of the configuration]
    #[arg(long)]
    pub cell: Option<String>,
    /// Configuration file (TOML) with the arm, the period and the start posture
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// Program of the plant, split at spaces; started as often as needed
    #[arg(long, value_name = "COMMAND")]
    pub program: Option<String>,
    /// The plant is the clock, like a real arm
    #[arg(long)]
    pub real: bool,
    /// Samples per trial
    #[arg(long, default_value_t = 2000)]
    pub samples: u64,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}
