//! Flags of `skillet bench`.

use std::num::NonZero;
use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet bench tick                               the table
  skillet bench transport --out benches/results    and a page with histograms")]
pub struct BenchArgs {
    #[command(subcommand)]
    pub verb: BenchVerb,
}

#[derive(Subcommand)]
pub enum BenchVerb {
    /// What a tick and its parts cost, by components and dimensions of the policy
    #[command(after_help = "Example: skillet bench tick --seconds 60 --json")]
    Tick(BenchOptions),
    /// What a step of the simulation costs, and rollouts a second on one core and on all
    #[command(after_help = "Example: skillet bench sim --rounds 20")]
    Sim(BenchOptions),
    /// Round trips between two processes: shared memory, socket, pipe
    #[command(after_help = "Example: skillet bench transport --out benches/results")]
    Transport(BenchOptions),
    /// The loop in real time under swaps, learner load, observers and kills, beside a bare loop
    #[command(after_help = "Example: skillet bench latency --seconds 120 --out benches/results")]
    Latency(BenchOptions),
    /// Episodes a second that one learner makes durable, from 1 to 32 cells
    #[command(after_help = "Example: skillet bench learner --seconds 60 --json")]
    Learner(BenchOptions),
    /// Swaps as fast as they go, each one checked
    #[command(after_help = "Example: skillet bench swap --swaps 1000000")]
    Swap(SwapArgs),
    /// The other end of a round trip
    #[command(hide = true)]
    Echo(EchoArgs),
}

/// What every bench understands.
#[derive(Args)]
pub struct BenchOptions {
    /// How long to measure, all in all; each bench has its own default
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub seconds: Option<f64>,
    /// How often everything is measured in turn, so that drift of the host hits all alike
    #[arg(long, value_name = "N", default_value = "10")]
    pub rounds: NonZero<u32>,
    /// Folder to write <bench>.json and <bench>.html to
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
pub struct SwapArgs {
    /// So many swaps instead of --seconds
    #[arg(long, value_name = "N", conflicts_with = "seconds")]
    pub swaps: Option<u64>,
    #[command(flatten)]
    pub options: BenchOptions,
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if (1e-3..=1e5).contains(&seconds) => Ok(seconds),
        _ => Err("use a number of seconds within 0.001..=100000".into()),
    }
}

/// How messages travel.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub enum Link {
    Iceoryx2,
    Socket,
    Pipe,
}

#[derive(Args)]
pub struct EchoArgs {
    #[arg(long, value_enum)]
    pub link: Link,
    /// Ask again and again instead of sleeping
    #[arg(long)]
    pub spin: bool,
    #[arg(long)]
    pub len: usize,
    #[arg(long)]
    pub core: usize,
    #[arg(long)]
    pub cell: String,
    #[arg(long)]
    pub child: u32,
}
