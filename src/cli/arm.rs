//! `skillet hold` and `skillet rearm`: their flags.

use clap::Args;

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
