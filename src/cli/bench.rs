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
    /// Measure a tick and its parts, by components and dimensions of the policy
    #[command(after_help = "Example: skillet bench tick --seconds 60 --json")]
    Tick(BenchOptions),
    /// Measure a simulation step, and rollouts per second on one core and on all
    #[command(after_help = "Example: skillet bench sim --rounds 20")]
    Sim(BenchOptions),
    /// Measure round trips between two processes: shared memory, socket, pipe
    #[command(after_help = "Example: skillet bench transport --out benches/results")]
    Transport(BenchOptions),
    /// Measure the real-time loop under swaps, learner load, observers and kills, against an empty loop
    #[command(after_help = "Example: skillet bench latency --seconds 120 --out benches/results")]
    Latency(BenchOptions),
    /// Measure the episodes per second that one learner stores durably, with 1 to 32 cells
    #[command(after_help = "Example: skillet bench learner --seconds 60 --json")]
    Learner(BenchOptions),
    /// Swap policies as fast as possible, and check each swap
    #[command(after_help = "Example: skillet bench swap --swaps 1000000")]
    Swap(SwapArgs),
    /// The other end of a round trip
    #[command(hide = true)]
    Echo(EchoArgs),
}

/// Options of every bench.
#[derive(Args)]
pub struct BenchOptions {
    /// Total measurement time, s; each bench has its own default
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub seconds: Option<f64>,
    /// Rounds through all measurements, so that host drift affects all of them equally
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
    /// Number of swaps, instead of --seconds
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
    /// Poll instead of sleeping
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
