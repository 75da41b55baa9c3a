//! `skillet plant`: plants in another process.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use crate::config::plant::PlantKind;

/// What turns torques into measurements.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub enum KindArg {
    /// The controller simulates it
    Simulated,
    /// Another process, which comes to the controller
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
    /// Serve a task's own simulated world to a controller that waits for an external plant
    Serve(ServeArgs),
    /// Try out a plant of your own, step by step, with a verdict a line
    Check(CheckArgs),
}

#[derive(Args)]
#[command(after_help = "\
Example, in two terminals:
  skillet controller --cell kitchen --plant external --pace max
  skillet plant serve --cell kitchen")]
pub struct ServeArgs {
    /// Cell of the controller; `cell.name` of the configuration when absent
    #[arg(long)]
    pub cell: Option<String>,
    /// Configuration file (TOML): its task's world, its arm
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// Poll shared memory for answers; for a machine with a core to spare
    #[arg(long)]
    pub poll: bool,
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet plant check                                        waits for a plant in the cell `skillet`
  skillet plant check --program \"python3 examples/plant_mujoco.py\" --json")]
pub struct CheckArgs {
    /// Cell to wait in; `cell.name` of the configuration when absent
    #[arg(long)]
    pub cell: Option<String>,
    /// Configuration file (TOML): the arm, the period, the start posture
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// Program of the plant, words apart by spaces, to be started as often as needed
    #[arg(long, value_name = "COMMAND")]
    pub program: Option<String>,
    /// The plant is the clock, as a real arm is
    #[arg(long)]
    pub real: bool,
    /// Samples of each trial
    #[arg(long, default_value_t = 2000)]
    pub samples: u64,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}
