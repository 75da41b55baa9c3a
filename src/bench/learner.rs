//! `skillet bench learner`: how many episodes a second one learner makes durable, from how many cells.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use shm_types::SCHEMA;
use shm_types::cell::{Cell, Role, runtime_dir};
use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::policy::PolicyMsg;
use shm_types::ports::ControllerPorts;
use shm_types::telemetry::Heartbeat;

use super::service::{Learners, resident_mib};
use super::{Bench, Plan, Row};
use crate::cli::PaceArg;
use crate::config::{Config, LogConfig};
use crate::setup;
use crate::tasks::executor::executor;

pub const BENCH: Bench = Bench {
    name: "learner",
    title: "One learner, many cells",
    about: "A learner service runs a session of the pancake and gets its episodes from stand-in \
            controllers. Each of them answers a proposal at once, through shared memory as a real \
            controller does, and always with the same complete episode, so that only the learner \
            is measured. An episode counts when it is acknowledged: judged, learnt, and durable \
            in the session. Processor time and memory are those of the learner's process.",
    seconds: 60.0,
    run,
};

const CELLS: [usize; 6] = [1, 2, 4, 8, 16, 32];
const PREFIX: &str = "bl-";
const BEAT: Duration = Duration::from_millis(100);
/// Before anything is measured: the learner starts and joins its cells.
const WARM_UP: Duration = Duration::from_secs(2);
/// Longest wait for the first episode.
const SOON: Duration = Duration::from_secs(60);
/// Length of one sample.
const SAMPLE: Duration = Duration::from_millis(500);

fn run(plan: &Plan) -> Result<Vec<Row>> {
    let mut config = Config::of_task("pancake");
    config.log = LogConfig { level: "error".into(), ..config.log };
    config.learner.rollouts = 100_000;
    let episode = whole_episode(&config)?;
    let slice = Duration::from_secs_f64(plan.seconds / CELLS.len() as f64);
    let mut rows = Vec::new();
    for n in CELLS {
        rows.extend(measure(&config, &episode, n, slice)?);
    }
    Ok(rows)
}

/// What every cell executes: the demonstrated flip.
fn whole_episode(config: &Config) -> Result<(EpisodeHeader, Vec<TickRecord>)> {
    let start =
        learner::encoding::fit(&config.learner.encoding(), &setup::demonstrations(config)?)?;
    let (header, records) = executor(config)?(&start)?;
    Ok((EpisodeHeader { n_records: records.len() as u64, ..header }, records))
}

/// What the made-up controllers share.
struct Feed<'a> {
    header: &'a EpisodeHeader,
    records: &'a [TickRecord],
    durable: AtomicU64,
    is_over: AtomicBool,
}

fn measure(
    config: &Config,
    (header, records): &(EpisodeHeader, Vec<TickRecord>),
    n: usize,
    slice: Duration,
) -> Result<Vec<Row>> {
    Cell::remove_idle(&runtime_dir(), PREFIX);
    let name = |k| Cell::new(&format!("{PREFIX}{}-{k}", std::process::id()));
    let cells = (0..n).map(name).collect::<Result<Vec<Cell>, _>>()?;
    let dir = std::env::temp_dir().join(format!("skillet-bench-learner-{}", std::process::id()));
    std::fs::create_dir_all(&dir)
        .with_context(|| format!("{}: cannot create it", dir.display()))?;
    let feed =
        Feed { header, records, durable: AtomicU64::new(0), is_over: AtomicBool::new(false) };
    let result = std::thread::scope(|scope| {
        let threads: Vec<_> = cells.iter().map(|cell| scope.spawn(|| serve(cell, &feed))).collect();
        let rows = watch(config, &dir, &cells, &feed, slice);
        feed.is_over.store(true, Ordering::Relaxed);
        for thread in threads {
            thread.join().ok().context("a made-up controller panicked")??;
        }
        rows
    });
    // A folder that stays behind harms nobody.
    let _ = std::fs::remove_dir_all(&dir);
    result
}

/// Plays the controller of a cell.
fn serve(cell: &Cell, feed: &Feed<'_>) -> Result<()> {
    let _lock = cell.lock(Role::Controller)?;
    let ports = ControllerPorts::create(cell)?;
    let (mut next_beat, mut counter, mut asked): (_, _, Option<PolicyMsg>) =
        (Instant::now(), 0, None);
    while !feed.is_over.load(Ordering::Relaxed) {
        let now = Instant::now();
        if now >= next_beat {
            (next_beat, counter) = (now + BEAT, counter + 1);
            let (schema, boot_id) = (SCHEMA, 1);
            let beat = Heartbeat { schema, boot_id, counter, ..Heartbeat::NONE };
            let _ = ports.beat.send_copy(beat);
            ports.meet_newcomers();
        }
        let mut is_idle = true;
        // First, as the next proposal comes right after it.
        while let Ok(Some(ack)) = ports.acks.receive() {
            if asked.take_if(|asked| ack.covers(asked.session, asked.rollout)).is_some() {
                feed.durable.fetch_add(1, Ordering::Relaxed);
            }
        }
        while let Ok(Some(policy)) = ports.policies.receive() {
            asked = Some(*policy);
            is_idle = false;
            answer(&ports, &policy, feed)?;
        }
        if is_idle {
            std::thread::sleep(Duration::from_micros(200));
        }
    }
    Ok(())
}

fn answer(ports: &ControllerPorts, policy: &PolicyMsg, feed: &Feed<'_>) -> Result<()> {
    let mut episode = ports.loan_episode(feed.records.len())?;
    *episode.user_header_mut() = EpisodeHeader {
        boot_id: 1,
        session: policy.session,
        rollout: policy.rollout,
        policy_id: policy.policy_id,
        policy_digest: policy.digest,
        ..*feed.header
    };
    episode.payload_mut().copy_from_slice(feed.records);
    episode.send().ok().context("sending an episode")?;
    let _ = ports.episode_sent.notify();
    Ok(())
}

/// Counts what becomes durable while a learner serves the cells.
fn watch(
    config: &Config,
    dir: &Path,
    cells: &[Cell],
    feed: &Feed<'_>,
    slice: Duration,
) -> Result<Vec<Row>> {
    let file = dir.join("bench.toml");
    std::fs::write(&file, config.to_toml()?)
        .with_context(|| format!("{}: cannot write", file.display()))?;
    let learners = Learners {
        cells: cells.iter().map(|cell| cell.name().into()).collect(),
        pace: PaceArg::Max,
        config: file,
        session: dir.join("session"),
        log: dir.join("learner.log"),
    };
    let mut learner = learners.start()?;
    let begun = Instant::now();
    while feed.durable.load(Ordering::Relaxed) == 0 {
        if let Some(status) = learner.exited()? {
            bail!(learner.obituary(status));
        }
        if begun.elapsed() > SOON {
            bail!("no episode within {SOON:?}; the log is {}", learners.log.display());
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    std::thread::sleep(WARM_UP);
    let scenario = format!("{} cell{}", cells.len(), if cells.len() == 1 { "" } else { "s" });
    let mut rate = Row::value("Durable episodes", "one learner", &scenario, "1/s");
    let mut cost = Row::value("Processor time of an episode", "learner", &scenario, "ms");
    let begun = Instant::now();
    while begun.elapsed() < slice {
        let (at, durable, cpu_s) = (Instant::now(), count(feed), cpu_seconds(learner.id())?);
        std::thread::sleep(SAMPLE);
        let new = count(feed) - durable;
        rate.add(new as f64 / at.elapsed().as_secs_f64());
        if new > 0 {
            cost.add(1e3 * (cpu_seconds(learner.id())? - cpu_s) / new as f64);
        }
    }
    let mut memory = Row::value("Memory", "learner, resident", &scenario, "MiB");
    memory.add(resident_mib(learner.id())?);
    learner.stop()?;
    Ok(vec![rate, cost, memory])
}

fn count(feed: &Feed<'_>) -> u64 {
    feed.durable.load(Ordering::Relaxed)
}

/// Processor time of a process so far, s.
fn cpu_seconds(pid: u32) -> Result<f64> {
    let path = format!("/proc/{pid}/stat");
    let text = std::fs::read_to_string(&path).with_context(|| path.clone())?;
    // The name, in brackets, may hold spaces.
    let fields: Vec<&str> = text.rsplit(')').next().unwrap_or("").split_whitespace().collect();
    let ticks: u64 =
        fields.get(11..13).context("utime and stime")?.iter().flat_map(|t| t.parse::<u64>()).sum();
    Ok(ticks as f64 / rustix::param::clock_ticks_per_second() as f64)
}
