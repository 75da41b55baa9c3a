//! `skillet policy`: its verbs and flags.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use super::PreferArg;

/// Options that select a running cell.
#[derive(Args, Clone)]
pub struct CellArgs {
    /// Name of the cell [default: `cell.name` of the configuration]
    #[arg(long)]
    pub cell: Option<String>,
    /// Configuration file (TOML); see `skillet config`
    #[arg(long)]
    pub config: Option<PathBuf>,
}

/// Options that select a policy of a session.
#[derive(Args, Clone)]
pub struct ChoiceArgs {
    /// Choose the mode of the session by this criterion [default: as configured]
    #[arg(long, value_enum)]
    pub prefer: Option<PreferArg>,
    /// Use this mode of the session
    #[arg(long, conflicts_with = "prefer")]
    pub mode: Option<usize>,
    /// Choose a policy whose successes meet this condition on the session's measures
    #[arg(long = "where", value_name = "EXPRESSION", conflicts_with_all = ["prefer", "mode"])]
    pub wish: Option<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub enum AtArg {
    /// At the end of the current rollout
    NextRollout,
    /// Now, blended into the current rollout
    Now,
}

#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub enum FormatArg {
    Json,
    /// With units in comments
    Toml,
}

#[derive(Args)]
#[command(after_help = "\
Policies of a session that is not running:
  skillet policy list sessions/pancake-1 --best 5
  skillet policy modes sessions/pancake-1
  skillet policy show sessions/pancake-1 17 --json
  skillet policy forbid sessions/skittles-1 1       a mode; the best of the others is selected

Policies of a running cell:
  skillet policy import sessions/pancake-1 --cell kitchen     the selected policy gets a number, say 1
  skillet policy activate 1 --at now --cell kitchen           blended in; reports the exact tick
  skillet policy pin --cell kitchen                           keep serving it and ignore the learner
  skillet policy rollback --cell kitchen
  skillet policy list --cell kitchen")]
pub struct PolicyArgs {
    #[command(subcommand)]
    pub verb: PolicyVerb,
}

#[derive(Subcommand)]
pub enum PolicyVerb {
    /// List the policies of a session, one per trial; without a session, those of a cell
    #[command(after_help = "\
Examples:
  skillet policy list sessions/pancake-1 --best 5
  skillet policy list --cell kitchen")]
    List {
        /// Session folder
        session: Option<PathBuf>,
        /// Only the N policies of the session with the highest reward
        #[arg(long)]
        best: Option<usize>,
        /// Print JSON
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        cell: CellArgs,
    },
    /// Show the parameters of one policy of a session or a cell
    #[command(after_help = "\
Examples:
  skillet policy show sessions/pancake-1 17 --json    0 is the initial policy
  skillet policy show 1 --cell kitchen")]
    Show {
        /// Session and policy id, as in `policy list`; or only the number of a policy in the cell
        #[arg(required = true, num_args = 1..=2, value_names = ["SESSION", "ID"])]
        policy: Vec<String>,
        /// Print JSON
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        cell: CellArgs,
    },
    /// Show the modes the search has found, each with its best reward and tolerance
    #[command(after_help = "Example: skillet policy modes sessions/skittles-1 --prefer tolerant")]
    Modes {
        /// Session folder
        session: PathBuf,
        /// Choose the mode that provides the selected policy by this criterion [default: as configured]
        #[arg(long, value_enum)]
        prefer: Option<PreferArg>,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Forbid a mode of a session, or a policy of a cell; `allow` undoes it
    #[command(after_help = "\
Examples:
  skillet policy forbid sessions/skittles-1 1    the best of the other modes is selected
  skillet policy allow sessions/skittles-1 1     undoes it
  skillet policy forbid 3 --cell kitchen         policy 3 can no longer be activated

The last allowed mode of a session cannot be forbidden.")]
    Forbid {
        /// Session and mode, as in `policy modes`; or only the number of a policy in the cell
        #[arg(required = true, num_args = 1..=2, value_names = ["SESSION", "MODE"])]
        policy: Vec<String>,
        /// Print JSON
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        cell: CellArgs,
    },
    /// Allow a forbidden mode of a session, or a forbidden policy of a cell, again
    #[command(after_help = "\
Examples:
  skillet policy allow sessions/skittles-1 1
  skillet policy allow 3 --cell kitchen")]
    Allow {
        /// Session and mode, as in `policy modes`; or only the number of a policy in the cell
        #[arg(required = true, num_args = 1..=2, value_names = ["SESSION", "MODE"])]
        policy: Vec<String>,
        /// Print JSON
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        cell: CellArgs,
    },
    /// Print a policy as JSON or TOML: the selected policy of a session, or one of a cell
    #[command(after_help = "\
Examples:
  skillet policy export sessions/skittles-1 --prefer best > throw.json
  skillet policy export sessions/pancake-1 --format toml > flip.toml
  skillet policy export sessions/pancake-1 --where \"apex_m > 0.6\" > high.json
  skillet policy export 3 --cell kitchen
  skillet policy export last-good --cell kitchen

--where chooses among the session's rollouts a policy that met the condition in a region where most
neighbours met it too. It needs no further rollout.")]
    Export {
        /// Session folder, number in the cell, or last-good
        from: String,
        #[command(flatten)]
        choice: ChoiceArgs,
        /// JSON for programs, TOML to read and edit; `policy import` takes both
        #[arg(long, value_enum, default_value_t = FormatArg::Json)]
        format: FormatArg,
        #[command(flatten)]
        cell: CellArgs,
    },
    /// Load a policy into a running cell, where it is checked and numbered
    #[command(after_help = "\
Examples:
  skillet policy import flip.toml --cell kitchen
  skillet policy import sessions/pancake-1 --cell kitchen           the selected policy
  skillet policy import sessions/pancake-1 --id 91 --cell kitchen   policy of one trial
  skillet policy import sessions/pancake-1 --where \"apex_m < 0.45\" --cell kitchen

The controller checks bounds and stiffness and first runs the policy on an ideal arm. If it refuses a
policy, it gives the reason.")]
    Import {
        /// Policy (JSON or TOML, as `policy export` prints it), or a session folder
        from: PathBuf,
        /// Policy of the session, as in `policy list`
        #[arg(long, conflicts_with_all = ["prefer", "mode", "wish"])]
        id: Option<u64>,
        #[command(flatten)]
        choice: ChoiceArgs,
        /// Print JSON
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        cell: CellArgs,
    },
    /// Activate a policy; returns once it is applied, with the exact tick
    #[command(after_help = "\
Examples:
  skillet policy activate 1 --cell kitchen
  skillet policy activate 1 --at now --cell kitchen --json
  skillet policy activate last-good --cell kitchen")]
    Activate {
        /// Number in the cell, or last-good
        id: String,
        /// When the policy takes over
        #[arg(long, value_enum, default_value_t = AtArg::NextRollout)]
        at: AtArg,
        /// Print JSON
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        cell: CellArgs,
    },
    /// Keep serving the active policy and ignore the learner; persists across restarts
    #[command(after_help = "Example: skillet policy pin --cell kitchen")]
    Pin {
        /// Print JSON
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        cell: CellArgs,
    },
    /// Accept the learner's proposals again
    #[command(after_help = "Example: skillet policy unpin --cell kitchen")]
    Unpin {
        /// Print JSON
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        cell: CellArgs,
    },
    /// Go back to the previously active policy, or else to the last good one
    #[command(after_help = "Example: skillet policy rollback --cell kitchen")]
    Rollback {
        /// When the policy takes over
        #[arg(long, value_enum, default_value_t = AtArg::Now)]
        at: AtArg,
        /// Print JSON
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        cell: CellArgs,
    },
}
