//! `skillet demo`: its verbs and flags.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use crate::demo::Assignment;

#[derive(Args)]
pub struct DemoArgs {
    #[command(subcommand)]
    pub verb: DemoVerb,
}

#[derive(Subcommand)]
pub enum DemoVerb {
    /// Make a demonstration from a recording of joint angles or poses, or from a primitive of dmpbbo
    Import(ImportArgs),
    /// Give a session one more demonstration to start from
    Add(AddArgs),
}

#[derive(Args)]
#[command(after_help = "\
Example:
  skillet demo add sessions/pancake-1 my_demo.csv

The demonstration must fit the session: same arm, same length, as `skillet demo import` writes it. From the
next rollout on the search takes turns between its starts, this one first. A running learner takes it
between two rollouts, otherwise it counts when the session is resumed.")]
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
  skillet demo import recording.csv --out my_demo.csv
  skillet demo import joints.csv --config my.toml --smooth-s 0.03 --start 1.2 --end 3.0 --out my_demo.csv
  skillet demo import elsewhere.csv --at-start --slow 2 --out my_demo.csv
  skillet demo import log.txt --columns t_ms=stamp,q1=joint_a,q2_deg=joint_b --out my_demo.csv
  skillet demo import primitive.json --out my_demo.csv

Any table of text: commas, semicolons, tabs, spaces or | between the columns, decimal point or comma,
UTF-8, UTF-16 or Latin-1, comments after #, % or //. Columns in any order; others are not read:
  t_s (or _ms, _us, _ns)   time, also since 1970, and either
  q1_rad, q2_rad, …        joints of the configured arm (or _deg)
  x_m, y_m, z_m            tip in the world frame (or _cm, _mm), and its orientation:
                           pitch_rad, roll_rad, yaw_rad (or _deg; y, x, z of the rotation vector,
                           0 when absent), or a unit quaternion qw, qx, qy, qz
With learner.orientation = \"sphere\" in the file of --config it may turn any way and any number of times.
Units may also stand in the header, as in 't [s]' or 'q1 (deg)', or in a row below it. Without a unit,
lengths are m, angles rad, and the size of the steps tells the unit of the time. The names that
`rostopic echo -p`, PlotJuggler, TUM/evo, EuRoC, UR RTDE, LeRobot and libfranka write are known;
--columns says what no name does.

A Dmp of dmpbbo, written with its savejson_for_cpp, is played from its start over its _tau. 3 coordinates are x, y, z, 4
have a pitch besides, 6 roll and yaw too, as many as the arm has joints are these; --columns x_mm=y1,y_mm=y2,z_mm=y3
says otherwise. The learner fits it anew: with learner.encoding = dmp as a primitive again, with gains of its own.

Exit code 1 when the file is written but the configured arm cannot follow it: out of reach, or faster
than its joint speeds and torques allow.")]
pub struct ImportArgs {
    /// Recording (CSV, or any table of text), or a primitive of dmpbbo (JSON)
    pub file: PathBuf,
    /// Demonstration to write; never overwrites a file
    #[arg(long)]
    pub out: PathBuf,
    /// Samples a second of the result
    #[arg(long, default_value_t = 100.0, value_parser = rate)]
    pub rate_hz: f64,
    /// Smooth by parabolas fitted with Gaussian weights of this standard deviation, s
    #[arg(long, value_parser = positive)]
    pub smooth_s: Option<f64>,
    /// Begin here, s since the first row of the recording
    #[arg(long, value_name = "S", value_parser = finite, allow_hyphen_values = true)]
    pub start: Option<f64>,
    /// End here, s since the first row of the recording
    #[arg(long, value_name = "S", value_parser = finite, allow_hyphen_values = true)]
    pub end: Option<f64>,
    /// Play it this many times slower than it was recorded
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = slow)]
    pub slow: f64,
    /// Move it so that it begins at the arm's start posture; its directions stay
    #[arg(long)]
    pub at_start: bool,
    /// Say which column is what: t, q1, q2, …, x, y, z, qw, …, pitch, roll, yaw, with a unit as in
    /// q1_deg; a column by its name or its number from 1
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
