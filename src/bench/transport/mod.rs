//! `skillet bench transport`: round trips of messages between two processes.

mod link;
pub mod peer;

use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use shm_types::cell::{Cell, Role, runtime_dir};
use shm_types::episode::TickRecord;
use shm_types::policy::PolicyMsg;

use super::{Bench, Case, Plan, Row, interleave};
use crate::cli::bench::Link;
use crate::signals::end_after;
use link::Wait;
use peer::Peer;

pub const BENCH: Bench = Bench {
    name: "transport",
    title: "What a message costs",
    about: "A round trip: one process copies a message in; another one reads it out and sends it \
            back in the same way. The two are pinned to two cores and run at normal priority. \
            Polling retries without sleeping; waking sleeps until the message is there (iceoryx2: \
            a notification in addition to the message; socket and pipe: a blocking read). Socket \
            (Unix domain, stream) and pipe have buffers of the message's size if the host allows \
            it. Every slice starts a new peer, whose first round trips are not counted. In a \
            session, episodes are written in place, without any copies.",
    seconds: 20.0,
    run,
};

/// Records of a typical rollout of the pancake.
const N_RECORDS: usize = 1500;
/// Round trips in which pages and caches are filled.
const N_WARM_UP: usize = 20;
const CELL_PREFIX: &str = "bench-";

fn run(plan: &Plan) -> Result<Vec<Row>> {
    let cores = cores()?;
    // Only a bench that was killed leaves a cell.
    Cell::remove_idle(&runtime_dir(), CELL_PREFIX);
    let cell = Cell::new(&format!("{CELL_PREFIX}{}", std::process::id()))?;
    let lock = cell.lock(Role::Controller)?;
    let shared = cell.clone();
    end_after(move || shared.tear_down())?;
    let result = std::thread::scope(|scope| {
        // A thread of its own: its core is nobody else's business.
        let thread = scope.spawn(|| {
            pin(cores.0)?;
            interleave(plan, cases(&cell, cores.1))
        });
        thread.join().ok().context("the bench panicked; please report it")?
    });
    drop(lock);
    cell.remove_if_idle();
    result
}

fn cases(cell: &Cell, core: usize) -> Vec<Case<'_>> {
    let policy = ("policy", size_of::<PolicyMsg>());
    let episode = ("episode", N_RECORDS * size_of::<TickRecord>());
    let mut cases = Vec::new();
    for (what, len) in [policy, episode] {
        for (link, name) in
            [(Link::Iceoryx2, "iceoryx2"), (Link::Socket, "socket"), (Link::Pipe, "pipe")]
        {
            for (wait, how) in [(Wait::Spin, "polling"), (Wait::Sleep, "waking")] {
                let group = format!("Round trip of one {what}, {len} bytes");
                let row = Row::time(&group, &format!("{name}, {how}"), &format!("{what}, {len} B"));
                let measure = move |slice: Duration, row: &mut Row| {
                    let mut peer = Peer::start(cell, link, wait, len, core)?;
                    let result = round_trips(&mut peer, len, slice, row);
                    result.with_context(|| format!("{name}, {how}, {len} bytes"))?;
                    peer.stop()
                };
                cases.push(Case { row, measure: Box::new(measure) });
            }
        }
    }
    cases
}

fn round_trips(peer: &mut Peer, len: usize, slice: Duration, row: &mut Row) -> Result<()> {
    let mut message = vec![0x5a_u8; len];
    let mut reply = vec![0_u8; len];
    let mut begin = Instant::now();
    for number in 0_usize.. {
        // Both ends of the message differ from the last one's.
        message[..8].copy_from_slice(&number.to_ne_bytes());
        message[len - 1] = number as u8;
        let start = Instant::now();
        peer.end.send(&message)?;
        let answered = peer.end.receive(&mut reply)?;
        let time = start.elapsed();
        if !answered {
            bail!("the peer ended early; its message on standard error says why");
        }
        if reply[..8] != message[..8] || reply[len - 1] != message[len - 1] {
            bail!("the reply is not the message: the transport is broken; please report it");
        }
        if number < N_WARM_UP {
            begin = Instant::now();
            continue;
        }
        row.add_time(time);
        if begin.elapsed() >= slice {
            break;
        }
    }
    Ok(())
}

/// The first and the last core this process may use.
fn cores() -> Result<(usize, usize)> {
    let allowed = sched_getaffinity(None).context("asking for the cores of this process")?;
    let mut cores = (0..CpuSet::MAX_CPU).filter(|core| allowed.is_set(*core));
    match (cores.next(), cores.next_back()) {
        (Some(first), Some(last)) => Ok((first, last)),
        _ => bail!("the transport is measured between two cores: allow this process a second one"),
    }
}

fn pin(core: usize) -> Result<()> {
    let mut set = CpuSet::new();
    set.set(core);
    sched_setaffinity(None, &set).with_context(|| format!("pinning to core {core}"))
}
