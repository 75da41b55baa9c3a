//! `skillet demo`: its verbs and flags.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use crate::demo::{AS_IT_IS, Assignment};

#[derive(Args)]
pub struct DemoArgs {
    #[command(subcommand)]
    pub verb: DemoVerb,
}

#[derive(Subcommand)]
pub enum DemoVerb {
    /// Convert a recording of joint angles or poses, or a dmpbbo primitive, to a demonstration
    #[command(name = "convert", alias = "import")]
    Import(ImportArgs),
    /// Add a demonstration to a session
    Add(AddArgs),
}

#[derive(Args)]
#[command(after_help = "\
Example:
  skillet demo add sessions/pancake-1 my_demo.csv

The demonstration must match the session's arm and length, in the format that `skillet demo convert` writes.
From the next rollout on, the search alternates between its starts, this one first. A running learner picks
it up between two rollouts; otherwise it takes effect when the session is resumed.")]
pub struct AddArgs {
    /// Session folder
    pub session: PathBuf,
    /// Demonstration (CSV)
    pub file: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet demo convert recording.csv --out my_demo.csv
  skillet demo convert joints.csv --config my.toml --smooth-s 0.03 --start 1.2 --end 3.0 --out my_demo.csv
  skillet demo convert elsewhere.csv --at-start --slow 2 --out my_demo.csv
  skillet demo convert log.txt --columns t_ms=stamp,q1=joint_a,q2_deg=joint_b --out my_demo.csv
  skillet demo convert primitive.json --out my_demo.csv

Reads any text table: commas, semicolons, tabs, spaces or | between columns, decimal point or comma,
UTF-8, UTF-16 or Latin-1, comments after #, % or //. Columns may be in any order; others are ignored:
  t_s (or _ms, _us, _ns)   time (also Unix time), and either
  q1_rad, q2_rad, …        joints of the configured arm (or _deg)
  x_m, y_m, z_m            tip in the world frame (or _cm, _mm), and its orientation:
                           pitch_rad, roll_rad, yaw_rad (or _deg; y, x, z of the rotation vector,
                           0 when absent), or a unit quaternion qw, qx, qy, qz
With learner.orientation = \"sphere\" in the --config file, rotations are unlimited.
Units may also stand in the header, as in 't [s]' or 'q1 (deg)', or in a row below it. Without a unit,
lengths are in m and angles in rad; the unit of time is inferred from the step size. Column names written by
`rostopic echo -p`, PlotJuggler, TUM/evo, EuRoC, UR RTDE, LeRobot and libfranka are recognised; use
--columns for all others.

A dmpbbo Dmp, written with savejson_for_cpp, is integrated from its start over its _tau. 3 coordinates are x, y, z; 4
add pitch; 6 add roll and yaw; one per joint of the arm are joint angles. --columns x_mm=y1,y_mm=y2,z_mm=y3 overrides
this. The learner refits the movement; learner.encoding = dmp gives a primitive with the learner's own gains.

Exits 1 if the file is written but the configured arm cannot follow it: out of reach, too long for an episode,
or faster than its joint speeds and torques allow.")]
pub struct ImportArgs {
    /// Recording (CSV or any text table), or a dmpbbo primitive (JSON)
    pub file: PathBuf,
    /// Demonstration to write
    #[arg(long)]
    pub out: PathBuf,
    /// Overwrite the file if it exists
    #[arg(long)]
    pub force: bool,
    /// Sample rate of the result, Hz
    #[arg(long, default_value_t = AS_IT_IS.rate_hz, value_parser = rate)]
    pub rate_hz: f64,
    /// Smooth with local parabolas; standard deviation of their Gaussian weights, s
    #[arg(long, value_parser = positive)]
    pub smooth_s: Option<f64>,
    /// Start of the movement, s since the first row of the recording
    #[arg(long, value_name = "S", value_parser = finite, allow_hyphen_values = true)]
    pub start: Option<f64>,
    /// End of the movement, s since the first row of the recording
    #[arg(long, value_name = "S", value_parser = finite, allow_hyphen_values = true)]
    pub end: Option<f64>,
    /// Slow the recording down by this factor
    #[arg(long, value_name = "FACTOR", default_value_t = AS_IT_IS.slow, value_parser = slow)]
    pub slow: f64,
    /// Translate the recording so that it begins at the arm's start posture
    #[arg(long)]
    pub at_start: bool,
    /// Assign columns: t, q1, q2, …, x, y, z, qw, …, pitch, roll, yaw, with a unit as in q1_deg;
    /// name a column or give its number from 1
    #[arg(long, value_name = "QUANTITY=COLUMN,…", value_delimiter = ',')]
    pub columns: Vec<Assignment>,
    /// Configuration file (TOML) with the arm: plant.arm, plant.tip, plant.start_posture_rad
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

fn finite(text: &str) -> Result<f64, String> {
    let number: Option<f64> = text.parse().ok();
    number.filter(|number| number.is_finite()).ok_or("give a finite number of seconds".into())
}

fn positive(text: &str) -> Result<f64, String> {
    finite(text).ok().filter(|s| *s > 0.0).ok_or("give seconds above 0, such as 0.03".into())
}

fn rate(text: &str) -> Result<f64, String> {
    let rate: Option<f64> = text.parse().ok();
    rate.filter(|rate| (20.0..=1000.0).contains(rate)).ok_or("use 20 to 1000 Hz".into())
}

fn slow(text: &str) -> Result<f64, String> {
    let factor: Option<f64> = text.parse().ok();
    factor
        .filter(|factor| (0.1..=100.0).contains(factor))
        .ok_or("use a factor of 0.1 to 100".into())
}
