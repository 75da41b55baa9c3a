//! `skillet arm`, `skillet hold`, `skillet rearm` and `skillet posture`: verbs and flags.

use std::path::PathBuf;

use clap::{ArgGroup, Args, Subcommand};
use shm_types::MAX_JOINTS;

use super::CellArgs;

#[derive(Args)]
#[command(after_help = "\
Example: skillet hold --cell kitchen

Holds the arm with gravity compensation and damping from the next tick until `skillet rearm`, even
after a controller restart. This is not an emergency stop; use the hardware for that.")]
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

After a hardware fault the arm is held, even after a controller restart. `skillet status` names the
fault; the ticks before it are in `faults` in the cell's state folder.")]
pub struct RearmArgs {
    #[command(flatten)]
    pub cell: CellArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
#[command(group(ArgGroup::new("posture").required(true).args(["joint", "offset", "reset"])))]
#[command(after_help = "\
Examples:
  skillet posture --joint 1 --by 0.4 --in 1 --cell kitchen
  skillet posture --offset -0.4,0,0.5,0,0.3,0,0 --cell kitchen
  skillet posture --reset --cell kitchen

An arm with 7 joints can move its elbow while its tip follows the skill. The elbow is pulled towards the start
posture plus this offset; only the part of the offset that leaves the tip alone takes effect. A joint near
the base moves the elbow far, a wrist joint hardly at all. Every rollout begins at the start posture
and moves from there within --in.

The offset acts while a policy is served (`skillet policy activate`, `pin`). A learner's rollouts keep the start
posture, so that a session stays repeatable. The controller first tries the policy with the new posture on an
ideal arm, and refuses a posture that would disturb it. The offset does not outlive the controller.")]
pub struct PostureArgs {
    /// Joint to move, counted from 1 at the base; the others go to the start posture
    #[arg(long, value_name = "N", requires = "by")]
    #[arg(value_parser = clap::value_parser!(u8).range(1..=MAX_JOINTS as i64))]
    pub joint: Option<u8>,
    /// Offset from the start posture, rad
    #[arg(long, value_name = "RAD", requires = "joint", allow_negative_numbers = true)]
    pub by: Option<f64>,
    /// Offsets of all joints, starting at the base, rad; omitted joints go to the start posture
    #[arg(long, value_name = "RAD,RAD,...", value_parser = offsets, allow_hyphen_values = true)]
    pub offset: Option<[f64; MAX_JOINTS]>,
    /// Return to the start posture
    #[arg(long)]
    pub reset: bool,
    /// Duration of the move, s [default: as long as needed, at least 1 s]
    #[arg(long = "in", value_name = "S", value_parser = duration, allow_negative_numbers = true)]
    pub within: Option<f64>,
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
    /// Read a URDF, find a start posture and print the configuration
    Check(CheckArgs),
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet arm check my_arm.urdf
  skillet arm check my_arm.urdf --tip tool0 --pan-kg 0.3 --out arm.toml

The default tip is the link \"pan\" or the end of the longest chain of revolute joints. If the
tip is not a pan, one is added (`pan` in the configuration) unless --no-pan is given. All faults are listed
at once, each with its line.

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
    /// Mass of the pan added to the tip, kg [default: what the motors allow, up to 0.5]
    #[arg(long, value_name = "KG", conflicts_with = "no_pan", value_parser = mass)]
    pub pan_kg: Option<f64>,
    /// Add no pan: the tip already is one
    #[arg(long)]
    pub no_pan: bool,
    /// Seed of the search for the start posture
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Write the configuration to this file; never overwrites a file
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Parses comma-separated numbers, one per joint; zeros for the rest.
fn offsets(text: &str) -> Result<[f64; MAX_JOINTS], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    let numbers = numbers.map_err(|_| "write one number per joint, as in 0,0,0.5")?;
    let mut offsets = [0.0; MAX_JOINTS];
    let Some(used) = offsets.get_mut(..numbers.len()) else {
        return Err(format!("{} numbers: an arm has at most {MAX_JOINTS} joints", numbers.len()));
    };
    used.copy_from_slice(&numbers);
    Ok(offsets)
}

fn duration(text: &str) -> Result<f64, String> {
    let seconds: Option<f64> = text.parse().ok();
    seconds.filter(|seconds| *seconds > 0.0).ok_or("use seconds, more than 0".into())
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
