//! `skillet bench swap`: swaps as fast as possible, each one checked.

use std::time::Duration;

use anyhow::{Result, bail};

use super::service::{BenchCell, Commander, resident_mib};
use super::{Bench, Plan, Row};
use crate::config::Config;
use rt_controller::rt::now_ns;

pub const BENCH: Bench = Bench {
    name: "swap",
    title: "Swaps, one after the other",
    about: "A controller at the pace of the simulation serves two very different policies, which are \
            swapped into each other within rollouts, blended over 1 ms, as fast as each is \
            acknowledged. Every acknowledgement must name the policy asked for, and no tick before \
            the last one's; the controller compares what its loop holds with what it was \
            sent. Misses are swaps without acknowledgement (published to applied) and swaps read \
            back different (round trip). Memory is the controller's, sampled a hundred times after \
            the first tenth.",
    // One swap takes about half a millisecond.
    seconds: 60.0,
    run,
};

/// At the pace of the simulation a blend costs a step of the simulation a tick.
const BLEND_S: f64 = 0.001;
const SAMPLES: u32 = 100;

fn run(plan: &Plan) -> Result<Vec<Row>> {
    let mut config = Config::default();
    config.controller.blend_s = BLEND_S;
    let bench = BenchCell::create(&config)?;
    let mut controller = bench.controller("max")?;
    let result = measure(&bench, controller.id(), Duration::from_secs_f64(plan.seconds), plan.n);
    controller.stop()?;
    result
}

fn measure(
    bench: &BenchCell,
    pid: u32,
    duration: Duration,
    n_swaps: Option<u64>,
) -> Result<Vec<Row>> {
    let mut commander = Commander::open(&bench.cell)?;
    let targets = commander.two_policies()?;
    let mut applied = Row::time("Swap", "published to applied", "as fast as acknowledged");
    let mut round_trip = Row::time("Swap", "round trip of the command", "as fast as acknowledged");
    let mut memory = Row::value("Memory", "controller, resident", "after the first tenth", "MiB");
    let (start_ns, mut last_tick, mut swaps) = (now_ns(), 0, 0_u64);
    let (mut unacknowledged, mut progress) = (0, 0);
    while progress < SAMPLES {
        let to = targets[(swaps + 1) as usize % 2];
        let sent_ns = now_ns();
        let reply = commander.ask(to.activate())?;
        if reply.accepted != 1 {
            // Too early is an answer, too: the last swap still fades in.
            if !reply.reason_text().contains("under way") {
                bail!("refused by the controller: {}", reply.reason_text());
            }
            continue;
        }
        round_trip.add_time(Duration::from_nanos(now_ns() - sent_ns));
        applied.add_time(Duration::from_nanos(reply.applied_ns.saturating_sub(sent_ns)));
        let is_right = reply.policy.digest == to.digest && reply.applied_tick >= last_tick;
        unacknowledged += u64::from(!is_right);
        last_tick = reply.applied_tick;
        swaps += 1;
        let share = match n_swaps {
            Some(n) => swaps as f64 / n as f64,
            None => (now_ns() - start_ns) as f64 * 1e-9 / duration.as_secs_f64(),
        };
        if (share * f64::from(SAMPLES)) as u32 > progress {
            progress += 1;
            if progress > SAMPLES / 10 {
                memory.add(resident_mib(pid)?);
            }
        }
    }
    let status = commander.status()?;
    // The one that put the first policy to work is not among the measured.
    let lost = (swaps + 1).abs_diff(status.swaps_applied);
    applied.misses = Some(unacknowledged + lost);
    round_trip.misses = Some(status.swaps_torn);
    Ok(vec![applied, round_trip, memory])
}
