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
    /// Accept cells from other machines; runs on the learner's machine
    Serve(ServeArgs),
    /// Connect a cell to a learner on another machine; runs beside the controller
    Join(JoinArgs),
    /// Make certificates for the learner's machine and every cell
    Keys(KeysArgs),
    /// Publish a running cell on a ROS 2 graph, over Zenoh like rmw_zenoh
    Ros2(Ros2Args),
}

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet bridge serve --listen 0.0.0.0:7447 --keys keys/learner --allow kitchen,lab
  skillet learner --cell kitchen --cell lab --session sessions/both

For a learner on this machine, each allowed cell is like a local one. Without --keys, only loopback addresses
are allowed.")]
pub struct ServeArgs {
    /// Address to listen on, HOST:PORT
    #[arg(long, value_name = "HOST:PORT")]
    pub listen: String,
    /// Cells that may join; all others are refused
    #[arg(long, value_name = "CELLS", required = true, value_delimiter = ',')]
    pub allow: Vec<String>,
    /// Folder with the keys of this machine, from `skillet bridge keys`
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

It reconnects until it is stopped. While the learner's machine does not respond, the controller serves its last good
policy, and finished episodes wait in its spool.")]
pub struct JoinArgs {
    /// The learner's machine, HOST:PORT
    #[arg(long, value_name = "HOST:PORT")]
    pub connect: String,
    /// Cell of the controller [default: `cell.name` of the configuration]
    #[arg(long)]
    pub cell: Option<String>,
    /// Folder with the keys of this cell, from `skillet bridge keys`
    #[arg(long, value_name = "DIR")]
    pub keys: Option<PathBuf>,
    /// Configuration of the controller; if given, its task and arm are compared with the learner's
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// Accept `skillet policy` and `skillet posture` from the learner's machine; `hold` is always accepted
    #[arg(long)]
    pub accept_commands: bool,
    /// Also accept `skillet rearm` from there, although somebody beside the arm may have held it
    #[arg(long)]
    pub accept_rearm: bool,
    /// Largest number of ticks per second to send to observers on the learner's machine; 0: none
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

Copy keys/learner to the learner's machine and keys/cells/<cell> to the machine of each cell. keys/ca.key signs
new certificates: keep it elsewhere. Nothing is overwritten.")]
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
    /// Days for which the certificates are valid
    #[arg(long, default_value_t = 730)]
    pub days: u32,
}

#[derive(Args)]
#[command(after_help = "\
Example:
  ros2 run rmw_zenoh_cpp rmw_zenohd                      the router, started once
  skillet bridge ros2 --cell kitchen
  RMW_IMPLEMENTATION=rmw_zenoh_cpp ros2 topic echo /joint_states

Best-effort, like `skillet watch`: readers never affect the loop, and no message on the graph reaches the cell. Tested
with independent readers, not with ROS itself.")]
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
    /// Loopback address on which readers connect directly, without a router
    #[arg(long, value_name = "HOST:PORT")]
    pub listen: Option<String>,
    /// ROS domain [default: $ROS_DOMAIN_ID, or 0]
    #[arg(long)]
    pub domain: Option<u32>,
    /// Namespace of node and topics, for several cells on one graph
    #[arg(long, default_value = "")]
    pub namespace: String,
    /// Largest number of ticks to publish per second
    #[arg(long, value_name = "HZ", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=4000))]
    pub rate: u32,
    /// Stop after this many seconds
    #[arg(long)]
    pub duration_s: Option<f64>,
}
