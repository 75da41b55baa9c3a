//! `skillet bridge`: cells on other machines. The flags are there in every build, the network in those with the
//! feature `bridge`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::CellArgs;
/// What a build without the feature says.
pub const NOT_BUILT: &str = "this build has no network: build it with `cargo build --release --features bridge`; see docs/bridge.md";

#[derive(Args)]
pub struct BridgeArgs {
    #[command(subcommand)]
    pub verb: BridgeVerb,
}

#[derive(Subcommand)]
pub enum BridgeVerb {
    /// On the learner's machine: let cells of other machines in
    Serve(ServeArgs),
    /// Beside a controller: connect its cell to a learner on another machine
    Join(JoinArgs),
    /// Make certificates: for the learner's machine and for every cell
    Keys(KeysArgs),
    /// Publish a cell live on a ROS 2 graph, over Zenoh as rmw_zenoh does
    Ros2(Ros2Args),
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet bridge serve --listen 0.0.0.0:7447 --keys keys/learner --allow kitchen,lab
  skillet learner --cell kitchen --cell lab --session sessions/both

Each allowed cell becomes a cell of this machine, for a learner like any other. Without --keys only this machine
can be listened on.")]
pub struct ServeArgs {
    /// Where to listen, HOST:PORT
    #[arg(long, value_name = "HOST:PORT")]
    pub listen: String,
    /// The cells that may join, and no others
    #[arg(long, value_name = "CELLS", required = true, value_delimiter = ',')]
    pub allow: Vec<String>,
    /// Folder with the keys of this machine, as `skillet bridge keys` makes it
    #[arg(long, value_name = "DIR")]
    pub keys: Option<PathBuf>,
    /// Configuration of the session; a cell with another task or arm is refused
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// End when the process that started this one ends
    #[arg(long, hide = true, value_name = "PID")]
    pub child: Option<u32>,
}

#[derive(Args)]
#[command(after_help = "\
Example:
  skillet controller --cell kitchen --config config/pancake.toml
  skillet bridge join --connect oven.lan:7447 --keys kitchen --cell kitchen --config config/pancake.toml

From the learner's machine `skillet status`, `watch`, `record` and `hold` work with this cell. Other commands are
refused unless --accept-commands is given; the owner of the arm decides.

It tries again until it is stopped. While the learner's machine does not answer, the controller serves its last good
policy, and what was executed waits in its spool.")]
pub struct JoinArgs {
    /// The learner's machine, HOST:PORT
    #[arg(long, value_name = "HOST:PORT")]
    pub connect: String,
    /// Cell of the controller; `cell.name` of the configuration when absent
    #[arg(long)]
    pub cell: Option<String>,
    /// Folder with the keys of this cell, as `skillet bridge keys` makes it
    #[arg(long, value_name = "DIR")]
    pub keys: Option<PathBuf>,
    /// Configuration of the controller; with it task and arm are compared with those of the learner
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// Carry out `skillet policy` and `skillet posture` given on the learner's machine; `hold` always is
    #[arg(long)]
    pub accept_commands: bool,
    /// Let the learner's machine re-arm the arm, too; somebody beside it may have held it
    #[arg(long)]
    pub accept_rearm: bool,
    /// Ticks a second that the learner's machine sees at most, while somebody watches there; 0: none
    #[arg(long, value_name = "HZ", default_value_t = 50, value_parser = clap::value_parser!(u64).range(0..=50))]
    pub telemetry: u64,
    /// End when the process that started this one ends
    #[arg(long, hide = true, value_name = "PID")]
    pub child: Option<u32>,
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet bridge keys --out keys --learner oven.lan,192.168.1.10 --cells kitchen,lab
  skillet bridge keys --out keys --cells garage                       one more cell, later

Copy keys/learner to the learner's machine and keys/cells/<cell> to that of each cell. keys/ca.key makes new
certificates: keep it elsewhere. Nothing is overwritten.")]
pub struct KeysArgs {
    /// Folder to write
    #[arg(long)]
    pub out: PathBuf,
    /// Names or addresses by which cells reach the learner's machine
    #[arg(long, value_name = "HOSTS", value_delimiter = ',')]
    pub learner: Vec<String>,
    /// Cells to make certificates for
    #[arg(long, value_name = "CELLS", required = true, value_delimiter = ',')]
    pub cells: Vec<String>,
    /// How long the certificates are valid
    #[arg(long, default_value_t = 730)]
    pub days: u32,
}

#[derive(Args)]
#[command(after_help = "\
Example:
  ros2 run rmw_zenoh_cpp rmw_zenohd                      the router, started once
  skillet bridge ros2 --cell kitchen
  RMW_IMPLEMENTATION=rmw_zenoh_cpp ros2 topic echo /joint_states

Best-effort, like `skillet watch`: readers never affect the loop, and nothing of the graph reaches the cell. Tested with
independent readers, not with ROS itself.")]
pub struct Ros2Args {
    #[command(flatten)]
    pub cell: CellArgs,
    /// The Zenoh router of the graph, HOST:PORT
    #[arg(
        long,
        value_name = "HOST:PORT",
        default_value = "localhost:7447",
        conflicts_with = "listen"
    )]
    pub connect: String,
    /// Let readers of this machine connect here instead, on a loopback address
    #[arg(long, value_name = "HOST:PORT")]
    pub listen: Option<String>,
    /// ROS domain [default: $ROS_DOMAIN_ID, or 0]
    #[arg(long)]
    pub domain: Option<u32>,
    /// Namespace of node and topics, for several cells on one graph
    #[arg(long, default_value = "")]
    pub namespace: String,
    /// Publish at most so many ticks per second
    #[arg(long, value_name = "HZ", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=4000))]
    pub rate: u32,
    /// Stop after this many seconds
    #[arg(long)]
    pub duration_s: Option<f64>,
}
