//! `skillet soak --hosts`: one learner and cells on other hosts, over a bridge and a bad network.
//!
//! Each host is a network namespace with folders of its own. Between them packets are delayed, lost, doubled and
//! overtaken; links are cut for moments and for longer than a rollout's lease; learner, hub, bridges and controllers
//! are killed. Every rollout must become a trial once, every episode that was durable must be learnt or known to be a
//! second execution, every session must come out again bit for bit, and a cell that is cut off must go on alone.

mod books;
mod chaos;
mod fleet;
mod host;
mod script;
mod spools;
mod summary;
mod tally;
mod tun;
mod wan;
mod weather;
mod witness;

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};

use crate::cli::PaceArg;
use crate::stderr::say;
use books::Books;
use chaos::Chaos;
use fleet::Fleet;
use host::Host;
use script::Script;
pub use summary::NetSummary;
use wan::Wan;
pub use weather::Weather;

/// So many events in the whole time, within limits.
const EVENTS: u32 = 240;
const SHORTEST: Duration = Duration::from_secs(3);
const LONGEST: Duration = Duration::from_secs(15);
/// How long episodes may take out of the spools once everything is up, and once their learner is back.
const DRAIN: Duration = Duration::from_secs(60);
const LOOK: Duration = Duration::from_millis(200);

/// What to do, and for how long.
#[derive(Clone, Debug)]
pub struct NetPlan {
    pub time: Duration,
    pub hosts: usize,
    pub cells: usize,
    pub weather: Weather,
    /// Rollouts of each session.
    pub rollouts: u64,
    pub seed: u64,
    pub pace: PaceArg,
    pub dir: PathBuf,
}

/// That this process can do it, before anything is made.
///
/// # Errors
/// What is missing, or does not fit.
pub fn check(hosts: usize, cells: usize) -> Result<()> {
    if !cfg!(feature = "bridge") {
        bail!("--hosts: {}", crate::cli::bridge::NOT_BUILT);
    }
    if cells < hosts - 1 {
        bail!(
            "--cells {cells}: with --hosts {hosts} there are {} hosts beside the learner's; use as many cells or more",
            hosts - 1
        );
    }
    host::check()
}

/// Runs until the time is over or `stop` is set.
pub fn run(plan: &NetPlan, stop: &AtomicBool) -> Result<NetSummary> {
    host::remove_left();
    let (mut hosts, mut links) = (Vec::new(), Vec::new());
    for k in 0..plan.hosts {
        let (host, link) = Host::make(k, &plan.dir)?;
        hosts.push(host);
        links.push(link);
    }
    let wan = Wan::start(links, plan.weather, plan.seed)?;
    let fleet = Fleet::make(plan, hosts)?;
    let pause = (plan.time / EVENTS).clamp(SHORTEST, LONGEST);
    let on_hosts = fleet.cells.iter().map(|cell| cell.host).collect();
    let script = Script::new(plan.seed, on_hosts, plan.hosts, pause);
    let start = Instant::now();
    let mut chaos = Chaos::new(&fleet, &wan, script);
    let result = chaos.run(start + plan.time, stop);
    let wall = start.elapsed();
    let mut failures = Vec::new();
    match result.and_then(|sessions| drain(&mut chaos, &fleet, sessions).map(|()| sessions)) {
        Ok(sessions) => {
            failures.extend(chaos.end());
            chaos.tally.books = books(&fleet, sessions)?;
        }
        Err(error) => failures.push(format!("{error:#}")),
    }
    let mut tally = std::mem::take(&mut chaos.tally);
    tally.packets = wan.counts();
    drop(chaos);
    let left_over = fleet.hosts.iter().flat_map(Host::left_over).collect();
    Ok(NetSummary { wall, plan: plan.clone(), tally, failures, left_over })
}

/// Waits until no episode is in a spool any more. Those of a session that has ended stay there until its learner has
/// been back.
fn drain(chaos: &mut Chaos<'_>, fleet: &Fleet, sessions: u64) -> Result<()> {
    let mut waiting = wait(fleet, sessions)?;
    let resumed: Vec<u64> = waiting.keys().copied().flatten().collect();
    for number in &resumed {
        say(&format!("session {number}: resumed for episodes that are still in a spool"));
        chaos.resume(*number)?;
    }
    if !resumed.is_empty() {
        waiting = wait(fleet, sessions)?;
    }
    chaos.tally.resumed = resumed.len() as u64;
    chaos.tally.in_spools = waiting.into_values().sum();
    Ok(())
}

/// What is still in the spools when they have had time to empty.
fn wait(fleet: &Fleet, sessions: u64) -> Result<std::collections::BTreeMap<Option<u64>, u64>> {
    let start = Instant::now();
    loop {
        let waiting = spools::waiting(fleet, sessions)?;
        if waiting.is_empty() || start.elapsed() >= DRAIN {
            return Ok(waiting);
        }
        std::thread::sleep(LOOK);
    }
}

fn books(fleet: &Fleet, sessions: u64) -> Result<Books> {
    say("ended; now every trial is executed again");
    let mut books = Books::default();
    for number in 0..sessions {
        books.add(&Books::of(fleet, number)?);
    }
    Ok(books)
}
