//! `skillet bench`: measures, and prints or writes what came out.

use anyhow::Result;

use crate::Verdict;
use crate::bench::{Bench, Plan, latency, learner, output, sim, swap, tick, transport};
use crate::cli::bench::{BenchArgs, BenchOptions, BenchVerb};
use crate::fields;
use crate::host::Host;
use crate::output::{print, print_json};
use crate::stderr::say;

pub fn run(args: &BenchArgs) -> Result<Verdict> {
    match &args.verb {
        BenchVerb::Tick(options) => measure(&tick::BENCH, options, None)?,
        BenchVerb::Sim(options) => measure(&sim::BENCH, options, None)?,
        BenchVerb::Transport(options) => measure(&transport::BENCH, options, None)?,
        BenchVerb::Latency(options) => measure(&latency::BENCH, options, None)?,
        BenchVerb::Learner(options) => measure(&learner::BENCH, options, None)?,
        BenchVerb::Swap(args) => measure(&swap::BENCH, &args.options, args.swaps)?,
        BenchVerb::Echo(args) => transport::peer::echo(args)?,
    }
    Ok(Verdict::Done)
}

fn measure(bench: &Bench, options: &BenchOptions, n: Option<u64>) -> Result<()> {
    if cfg!(debug_assertions) {
        say(&format!(
            "skillet: timings of a development build mean little: use `cargo run --release -- \
             bench {}`",
            bench.name
        ));
    }
    // Before: its load average is not this bench's own.
    let host = Host::here();
    let seconds = options.seconds.unwrap_or(bench.seconds);
    let rows = (bench.run)(&Plan { seconds, rounds: options.rounds.get(), n })?;
    if options.json {
        print_json(&fields::short(output::as_json(bench, &host, &rows)))?;
    } else {
        print(&output::as_text(&host, &rows))?;
    }
    if let Some(folder) = &options.out {
        output::write(folder, bench, &host, &rows)?;
    }
    Ok(())
}
