//! `skillet arm`, `skillet hold` and `skillet rearm`: verbs and flags.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::CellArgs;

#[derive(Args)]
#[command(after_help = "\
Example: skillet hold --cell kitchen

Damped gravity hold from the next tick on, over a restart of the controller as well, until
`skillet rearm`. It is no emergency stop: that is hardware.")]
pub struct HoldArgs {
    #[command(flatten)]
    pub cell: CellArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
#[command(after_help = "\
Example: skillet rearm --cell kitchen

After a fault of the machine the arm is held, also over a restart of the controller. `skillet status`
names the fault; the ticks before it lie in the cell's state folder, below faults.")]
pub struct RearmArgs {
    #[command(flatten)]
    pub cell: CellArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
pub struct ArmArgs {
    #[command(subcommand)]
    pub verb: ArmVerb,
}

#[derive(Subcommand)]
pub enum ArmVerb {
    /// Read a URDF, find a start posture, print the configuration to use
    Check(CheckArgs),
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet arm check my_arm.urdf
  skillet arm check my_arm.urdf --tip tool0 --pan-kg 0.3 --out arm.toml

Without --tip it takes the link \"pan\" or the end of the longest chain of revolute joints. A tip that
is no pan gets one (`pan` in the configuration); --no-pan leaves it as it is. All faults are listed at
once, each with its line.

Exit code 0: usable as printed; 1: not usable, with the reasons; 2: the file cannot be read.")]
pub struct CheckArgs {
    /// URDF of the arm
    pub urdf: PathBuf,
    /// Link that is the pan or carries it
    #[arg(long)]
    pub tip: Option<String>,
    /// Link at which the arm begins; joints before it are held
    #[arg(long)]
    pub base: Option<String>,
    /// Hold this joint, in rad or m; may be repeated
    #[arg(long, value_name = "JOINT=POSITION", value_parser = held)]
    pub hold: Vec<(String, f64)>,
    /// Mass of the pan that is added to the tip, kg; as the motors allow, up to 0.5, when absent
    #[arg(long, value_name = "KG", conflicts_with = "no_pan", value_parser = mass)]
    pub pan_kg: Option<f64>,
    /// The tip is a pan already: add none
    #[arg(long)]
    pub no_pan: bool,
    /// Seed of the search for the start posture
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Write the configuration to this file; never overwrites one
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

fn held(text: &str) -> Result<(String, f64), String> {
    let (joint, position) = text.rsplit_once('=').ok_or("write it as joint=0.2")?;
    let position: f64 = position.trim().parse().map_err(|_| "write it as joint=0.2")?;
    Ok((joint.trim().to_string(), position))
}

fn mass(text: &str) -> Result<f64, String> {
    let mass: Option<f64> = text.parse().ok();
    mass.filter(|mass| (0.01..=20.0).contains(mass)).ok_or("use 0.01 to 20 kg".into())
}
