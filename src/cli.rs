//! Every command and flag.

pub mod arm;
pub mod bench;
pub mod bridge;
pub mod child;
pub mod demo;
pub mod doctor;
pub mod judge;
pub mod plant;
pub mod record;
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
    /// Learn a task: starts controller and learner, shows progress, writes a session folder
    Learn(LearnArgs),
    /// Run the controller service of a cell
    Controller(ControllerArgs),
    /// Run the learner service of a cell
    Learner(LearnerArgs),
    /// Ask a running controller how it is
    Status(StatusArgs),
    /// Hold the arm where it is, until it is re-armed
    Hold(arm::HoldArgs),
    /// End the hold after a machine fault, once its cause is mended
    Rearm(arm::RearmArgs),
    /// Move the elbow of a running arm while the skill goes on
    Posture(arm::PostureArgs),
    /// Look at the policies of a session; put policies into a running cell, and take them back
    Policy(PolicyArgs),
    /// Watch a running cell in the terminal, or in a 3-D viewer
    Watch(record::WatchArgs),
    /// Record a running cell at full rate, for Foxglove, PlotJuggler, Rerun and Python
    Record(record::RecordArgs),
    /// Run a trial of a session again, bit for bit, and record it
    Replay(record::ReplayArgs),
    /// Make demonstrations from recordings, and give one more to a session
    Demo(demo::DemoArgs),
    /// Check the URDF of an arm and make its configuration
    Arm(arm::ArmArgs),
    /// Plants in another process: serve the simulation as one, check one of your own
    Plant(plant::PlantArgs),
    /// Rate a rollout of a session, or judge all its trials by another reward
    Judge(judge::JudgeArgs),
    /// List what there is to be learnt
    Task(task::TaskArgs),
    /// Print all trials of a session as CSV or JSON
    Trials(trials::TrialsArgs),
    /// Write the figures and the HTML page of a session
    Report(ReportArgs),
    /// Repeat a study over many seeds: success rates with intervals, comparisons, figures
    Study(StudyArgs),
    /// Grade this host for hard real time, and say what to mend
    Doctor(doctor::DoctorArgs),
    /// Measure how long things take on this host
    Bench(bench::BenchArgs),
    /// Kill, swap and disturb cells that learn, for as long as you like, and count what is lost
    Soak(soak::SoakArgs),
    /// Cells on other machines: one learner, arms in several rooms
    Bridge(bridge::BridgeArgs),
    /// Show the configuration in effect
    Config(ConfigArgs),
    /// Print a script that completes commands and flags in a shell
    Completions(shell::CompletionsArgs),
    /// Write the manual pages
    Man(shell::ManArgs),
    /// Become another program, which ends with the process that started it
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
    /// By the wall clock
    Realtime,
    /// As fast as the simulation allows; the same numbers
    Max,
    /// By the samples of a real arm, a plant in another process
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
  skillet learn pancake --judge my_task.py           rewards by a program of your own, in any language
  skillet learn pancake --out s7 --where \"apex_m < 0.45\"    a ceiling came down; s7 goes on below it

Ctrl-C stops it with everything saved (exit code 1); the same command with --out resumes it.")]
pub struct LearnArgs {
    /// What to learn
    #[arg(value_parser = task_names())]
    pub task: String,
    /// Rollouts of the session, those of earlier runs included
    #[arg(long)]
    pub rollouts: Option<u64>,
    /// Seed of the search; equal seeds give equal trials, bit for bit, where there is one cell
    #[arg(long)]
    pub seed: Option<u64>,
    /// Cells that execute rollouts at the same time, each with an arm of its own
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=64))]
    pub cells: u8,
    /// What paces the loop; in simulation the numbers do not depend on it
    #[arg(long, value_enum, default_value_t = PaceArg::Max)]
    pub pace: PaceArg,
    /// Configuration file (TOML); see `skillet config`
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// What turns torques into measurements; `plant.kind` of the configuration when absent
    #[arg(long, value_enum)]
    pub plant: Option<plant::KindArg>,
    /// An arm that comes with the tool, instead of the task's own
    #[arg(long, value_parser = robot_names(), conflicts_with = "config")]
    pub arm: Option<String>,
    /// Program of an external plant, words apart by spaces, to be started and ended with the session
    #[arg(long, value_name = "COMMAND")]
    pub plant_program: Option<String>,
    /// Program that judges every rollout: a Python file, or words apart by spaces; see docs/own-task.md
    #[arg(long, value_name = "COMMAND")]
    pub judge: Option<String>,
    /// Where the skittle stands, in m from the post (task skittles)
    #[arg(long, value_name = "X,Y", value_parser = point, allow_hyphen_values = true)]
    pub target: Option<[f64; 2]>,
    /// Which of the modes found is the answer
    #[arg(long, value_enum)]
    pub prefer: Option<PreferArg>,
    /// What a success must be like from here on, over the measures; "" for nothing any more
    #[arg(long = "where", value_name = "EXPRESSION")]
    pub wish: Option<String>,
    /// Record every rollout at full rate, as recording.mcap in the session folder
    #[arg(long)]
    pub record: bool,
    /// Session folder; an existing session of the same task is resumed
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Print one JSON object at the end instead of a summary
    #[arg(long)]
    pub json: bool,
}

/// Every task with what it is about.
fn task_names() -> impl TypedValueParser<Value = String> {
    let value = |task: &&Task| PossibleValue::new(task.name).help(task.about);
    PossibleValuesParser::new(tasks::ALL.iter().map(value))
}

/// Every arm with what it is.
fn robot_names() -> impl TypedValueParser<Value = String> {
    let value = |robot: &Robot| PossibleValue::new(robot.name).help(robot.about);
    PossibleValuesParser::new(robots::ALL.iter().map(value))
}

/// Two numbers with a comma between them.
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
    /// Cell to serve, shared with its learner; `cell.name` of the configuration when absent
    #[arg(long)]
    pub cell: Option<String>,
    /// Configuration file (TOML); see `skillet config`
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// What paces the loop: a service keeps the wall clock unless told otherwise
    #[arg(long, value_enum, default_value_t = PaceArg::Realtime)]
    pub pace: PaceArg,
    /// What turns torques into measurements; `plant.kind` of the configuration when absent
    #[arg(long, value_enum)]
    pub plant: Option<plant::KindArg>,
    /// Keep nothing on disk: the cell will not outlive this process
    #[arg(long, hide = true)]
    pub private: bool,
    /// File to which the loop's timing is added at the end
    #[arg(long, hide = true)]
    pub timing: Option<PathBuf>,
    /// End when the process that started this one ends
    #[arg(long, hide = true, value_name = "PID")]
    pub child: Option<u32>,
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet learner --cell kitchen --session sessions/kitchen
  skillet learner --cell left --cell right --session sessions/both    two arms, one session")]
pub struct LearnerArgs {
    /// Cell of the controller to work with, `cell.name` of the configuration when absent; once for each of several
    #[arg(long)]
    pub cell: Vec<String>,
    /// Session folder to create or resume
    #[arg(long)]
    pub session: PathBuf,
    /// Configuration of a new session; a resumed one brings its own
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// What paces the loop beside it: one that keeps the wall clock has its core to itself
    #[arg(long, value_enum, default_value_t = PaceArg::Realtime)]
    pub pace: PaceArg,
    /// Record every rollout at full rate, as recording.mcap in the session folder
    #[arg(long)]
    pub record: bool,
    /// Print one JSON object a trial
    #[arg(long)]
    pub json: bool,
    /// End when the process that started this one ends
    #[arg(long, hide = true, value_name = "PID")]
    pub child: Option<u32>,
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
#[command(after_help = "Example: skillet report sessions/pancake-1")]
pub struct ReportArgs {
    /// Session folder
    pub session: PathBuf,
    /// Print the paths written as JSON
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet study landscape --seeds 300 --first-seed 1000
  skillet study skittles --seeds 300 --json

Seeds that are done are kept in --out; the same command goes on where it was stopped.")]
pub struct StudyArgs {
    /// Name of the study; without one, all are listed
    pub name: Option<String>,
    /// How many seeds
    #[arg(long, default_value = "20")]
    pub seeds: NonZero<u64>,
    #[arg(long, default_value_t = 0)]
    pub first_seed: u64,
    /// Folder of the results
    #[arg(long, default_value = "studies")]
    pub out: PathBuf,
    /// Seeds at the same time; all cores when absent
    #[arg(long)]
    pub threads: Option<NonZero<usize>>,
    /// End when the process that started this one ends
    #[arg(long, hide = true, value_name = "PID")]
    pub child: Option<u32>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet config > my.toml            every setting with its default
  skillet config --config my.toml     what my.toml means")]
pub struct ConfigArgs {
    /// Configuration file (TOML); the defaults when absent
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

#[cfg(test)]
#[path = "cli/tests.rs"]
mod tests;
