//! `skillet bridge`: cells on other machines. The flags are there in every build, the network in those with the
//! feature `bridge`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

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
