//! Every command and flag.

pub mod arm;
pub mod bench;
pub mod bridge;
pub mod cell;
pub mod child;
pub mod config;
pub mod convert;
pub mod demo;
pub mod doctor;
pub mod families;
pub mod judge;
pub mod plant;
pub mod rate;
pub mod record;
pub mod session;
pub mod shell;
pub mod soak;
pub mod task;
pub mod trials;

use std::num::NonZero;
use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::robots::{self, Robot};
use crate::tasks::{self, Task};

mod policy;

pub use policy::{AtArg, CellArgs, ChoiceArgs, FormatArg, PolicyArgs, PolicyVerb};

/// Learns compliant robot skills on a hard real-time loop.
///
/// Cells live in $SKILLET_RUNTIME_DIR, else $XDG_RUNTIME_DIR/skillet, else /tmp/skillet-<uid>.
#[derive(Parser)]
#[command(version, propagate_version = true, max_term_width = 100)]
#[command(after_help = crate::exit::help(), color = crate::tty::help_color())]
pub struct Cli {
    #[command(subcommand)]
    pub verb: Verb,
}

#[derive(Subcommand)]
pub enum Verb {
    /// Learn a task: run controller and learner, write a session folder
    Learn(LearnArgs),
    /// List the sessions in a folder, or show one
    Session(session::SessionArgs),
    /// Print all trials of a session as CSV or JSON
    Trials(trials::TrialsArgs),
    /// Inspect, load and roll back policies of a session or a cell
    Policy(PolicyArgs),
    /// Rate a rollout, from 0 to 10
    Rate(rate::RateArgs),
    /// Re-judge all trials of a session with another reward
    Judge(judge::JudgeArgs),
    /// Convert a recording to a demonstration, or add one to a session
    Demo(demo::DemoArgs),
    /// Rerun a trial of a session, bit for bit, and record it
    Replay(record::ReplayArgs),
    /// Convert a recording, or a trial of a session, to a ROS 2 bag
    Convert(convert::ConvertArgs),
    /// Write the HTML report of a session and its figures
    Report(ReportArgs),
    /// Start, stop and list cells in the background
    Cell(cell::CellsArgs),
    /// Show controller health (exits 1 if it needs attention)
    Status(StatusArgs),
    /// Watch a running cell in the terminal, a browser or a 3-D viewer
    Watch(record::WatchArgs),
    /// Record a running cell at full rate to an MCAP file
    Record(record::RecordArgs),
    /// Hold the arm at its current position until `skillet rearm`
    Hold(arm::HoldArgs),
    /// Release the arm after a hold, or once a hardware fault is fixed
    Rearm(arm::RearmArgs),
    /// Move the elbow of a running arm without interrupting the skill
    Posture(arm::PostureArgs),
    /// Run the controller service of a cell
    Controller(ControllerArgs),
    /// Run the learner service of a cell
    Learner(LearnerArgs),
    /// Connect cells on other machines to one learner
    Bridge(bridge::BridgeArgs),
    /// List the tasks that can be learnt, or serve one to a program
    Task(task::TaskArgs),
    /// Check the URDF of an arm and write its configuration
    Arm(arm::ArmArgs),
    /// Serve our simulation as an external plant, or check your own
    Plant(plant::PlantArgs),
    /// Run a study over many seeds: success rates, comparisons, figures
    Study(StudyArgs),
    /// Run benchmarks on this host
    Bench(bench::BenchArgs),
    /// Kill, swap and disturb learning cells, and count the losses
    Soak(soak::SoakArgs),
    /// Check this host for hard real time and suggest fixes
    Doctor(doctor::DoctorArgs),
    /// Show every setting, or check a configuration file
    Config(config::ConfigArgs),
    /// Print a shell completion script
    Completions(shell::CompletionsArgs),
    /// Write the manual pages
    Man(shell::ManArgs),
    /// Run another program, which ends with the process that started it
    #[command(hide = true)]
    Child(child::ChildArgs),
}

#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub enum PreferArg {
    /// The mode with the best trial
    Best,
    /// The mode that loses least when executed with errors
    Tolerant,
}

impl From<PreferArg> for learner::modes::Prefer {
    fn from(prefer: PreferArg) -> Self {
        match prefer {
            PreferArg::Best => learner::modes::Prefer::Best,
            PreferArg::Tolerant => learner::modes::Prefer::Tolerant,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub enum PaceArg {
    /// Follow the wall clock
    Realtime,
    /// Run as fast as the simulation allows, with the same results
    Max,
    /// Follow the samples of an external plant, such as a real arm
    Plant,
}

impl PaceArg {
    pub fn name(self) -> &'static str {
        match self {
            PaceArg::Realtime => "realtime",
            PaceArg::Max => "max",
            PaceArg::Plant => "plant",
        }
    }
}

impl From<PaceArg> for rt_controller::Pace {
    fn from(pace: PaceArg) -> Self {
        match pace {
            PaceArg::Realtime => rt_controller::Pace::Realtime,
            PaceArg::Max => rt_controller::Pace::Max,
            PaceArg::Plant => rt_controller::Pace::Plant,
        }
    }
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet learn pancake                              100 rollouts into sessions/pancake-1
  skillet learn pancake --seed 7 --out s7            a session in s7; the same line resumes it
  skillet learn pancake --rollouts 20 --pace realtime --json
  skillet learn skittles --target 1.2,0.0 --prefer tolerant
  skillet learn pancake --arm panda                  on a Franka Emika Panda
  skillet learn pancake --plant-program \"python3 examples/plant_mujoco.py\"
  skillet learn pancake --judge my_task.py           rewards from your own program, in any language
  skillet learn pancake --out s7 --where \"apex_m < 0.45\"    continue s7 under a lower ceiling

Ctrl-C stops the session with everything saved (exit code 1); rerun the command with --out to resume it.")]
pub struct LearnArgs {
    /// Task to learn
    #[arg(value_parser = task_names())]
    pub task: String,
    /// Rollouts of the session, including those of earlier runs
    #[arg(long)]
    pub rollouts: Option<u64>,
    /// Seed of the search; with one cell, equal seeds give bitwise equal trials
    #[arg(long)]
    pub seed: Option<u64>,
    /// Number of cells that execute rollouts in parallel, each with its own arm
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=64))]
    pub cells: u8,
    /// Pace of the loop; in simulation it does not affect the results
    #[arg(long, value_enum, default_value_t = PaceArg::Max)]
    pub pace: PaceArg,
    /// Configuration file (TOML); see `skillet config`
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// Plant that turns torques into measurements [default: `plant.kind` of the configuration]
    #[arg(long, value_enum)]
    pub plant: Option<plant::KindArg>,
    /// Use a built-in arm instead of the task's own
    #[arg(long, value_parser = robot_names(), conflicts_with = "config")]
    pub arm: Option<String>,
    /// Program of an external plant, split at spaces; starts and ends with the session
    #[arg(long, value_name = "COMMAND")]
    pub plant_program: Option<String>,
    /// Program that judges every rollout: a Python file, or a command split at spaces; see docs/own-judge.md
    #[arg(long, value_name = "COMMAND")]
    pub judge: Option<String>,
    /// Position of the skittle relative to the post, m (task skittles)
    #[arg(long, value_name = "X,Y", value_parser = point, allow_hyphen_values = true)]
    pub target: Option<[f64; 2]>,
    /// Mode that provides the selected policy
    #[arg(long, value_enum)]
    pub prefer: Option<PreferArg>,
    /// Condition over the measures that a success must meet from now on; "" removes it
    #[arg(long = "where", value_name = "EXPRESSION")]
    pub wish: Option<String>,
    /// Record every rollout at full rate, as recording.mcap in the session folder
    #[arg(long)]
    pub record: bool,
    /// Session folder; an existing session of the same task is resumed
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Print one JSON object at the end instead of the summary
    #[arg(long)]
    pub json: bool,
}

/// Parses a task name; the help lists each task with its description.
pub fn task_names() -> impl TypedValueParser<Value = String> {
    let value = |task: &&Task| PossibleValue::new(task.name).help(task.about);
    PossibleValuesParser::new(tasks::ALL.iter().map(value))
}

/// Parses an arm name; the help lists each arm with its description.
fn robot_names() -> impl TypedValueParser<Value = String> {
    let value = |robot: &Robot| PossibleValue::new(robot.name).help(robot.about);
    PossibleValuesParser::new(robots::ALL.iter().map(value))
}

/// Parses two numbers separated by a comma.
fn point(text: &str) -> Result<[f64; 2], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    let numbers = numbers.map_err(|_| "write it as 1.2,0.0")?;
    numbers.try_into().map_err(|_| "write two numbers, as 1.2,0.0".to_string())
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet controller --cell kitchen --config config/pancake.toml
  skillet controller --cell kitchen --plant external --pace plant    a robot's driver is the clock")]
pub struct ControllerArgs {
    /// Cell to serve, shared with its learner [default: `cell.name` of the configuration]
    #[arg(long)]
    pub cell: Option<String>,
    /// Configuration file (TOML); see `skillet config`
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// Pace of the loop
    #[arg(long, value_enum, default_value_t = PaceArg::Realtime)]
    pub pace: PaceArg,
    /// Plant that turns torques into measurements [default: `plant.kind` of the configuration]
    #[arg(long, value_enum)]
    pub plant: Option<plant::KindArg>,
    /// Keep nothing on disk; the cell does not outlive this process
    #[arg(long, hide = true)]
    pub private: bool,
    /// Append the loop's timing to this file at the end
    #[arg(long, hide = true)]
    pub timing: Option<PathBuf>,
    /// End when the process that started this one ends
    #[arg(long, hide = true, value_name = "PID")]
    pub child: Option<u32>,
    /// Leave the terminal and log to this file
    #[arg(long, hide = true, value_name = "LOG", conflicts_with = "child")]
    pub background: Option<PathBuf>,
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet learner --cell kitchen --session sessions/kitchen
  skillet learner --cell left --cell right --session sessions/both    two arms, one session")]
pub struct LearnerArgs {
    /// Cell of the controller; repeat it for several [default: `cell.name` of the configuration]
    #[arg(long)]
    pub cell: Vec<String>,
    /// Session folder to create or resume
    #[arg(long)]
    pub session: PathBuf,
    /// Configuration of a new session; a resumed session keeps its own
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// Pace of the controller's loop; the learner stays off the core of a real-time loop
    #[arg(long, value_enum, default_value_t = PaceArg::Realtime)]
    pub pace: PaceArg,
    /// Record every rollout at full rate, as recording.mcap in the session folder
    #[arg(long)]
    pub record: bool,
    /// Print one JSON object per trial
    #[arg(long)]
    pub json: bool,
    /// End when the process that started this one ends
    #[arg(long, hide = true, value_name = "PID")]
    pub child: Option<u32>,
    /// Leave the terminal and log to this file
    #[arg(long, hide = true, value_name = "LOG", conflicts_with = "child")]
    pub background: Option<PathBuf>,
}

#[derive(Args)]
#[command(after_help = "Example: skillet status --cell kitchen --json")]
pub struct StatusArgs {
    #[command(flatten)]
    pub cell: CellArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet report sessions/pancake-1
  skillet report sessions/pancake-1 sessions/pancake-2 --out comparison")]
pub struct ReportArgs {
    /// Session folders; several are compared on one page
    #[arg(required = true, value_name = "SESSION")]
    pub sessions: Vec<PathBuf>,
    /// Folder for the page [default: `report` in the session folder; for several sessions, in the current folder]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print the written paths as JSON
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet study landscape --seeds 300 --first-seed 1000
  skillet study skittles --seeds 300 --json

Finished seeds are kept in --out; rerun the command to continue where it stopped.")]
pub struct StudyArgs {
    /// Name of the study; without one, list all
    pub name: Option<String>,
    /// Number of seeds
    #[arg(long, default_value = "20")]
    pub seeds: NonZero<u64>,
    /// First seed
    #[arg(long, default_value_t = 0)]
    pub first_seed: u64,
    /// Folder for the results
    #[arg(long, default_value = "studies")]
    pub out: PathBuf,
    /// Seeds to run in parallel [default: number of cores]
    #[arg(long)]
    pub threads: Option<NonZero<usize>>,
    /// End when the process that started this one ends
    #[arg(long, hide = true, value_name = "PID")]
    pub child: Option<u32>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
}

#[cfg(test)]
#[path = "cli/tests.rs"]
mod tests;
