//! The disturbances: real learners, real kills, real observers, real swaps.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use rt_controller::rt::now_ns;
use shm_types::cell::Cell;
use shm_types::ports::ObserverPorts;

use super::Scenario;
use crate::bench::Row;
use crate::bench::service::{BenchCell, Commander, Learners};
use crate::children::Service;

const N_OBSERVERS: u64 = 10;
const KILL_PERIOD: Duration = Duration::from_secs(1);
const SWAP_PERIOD: Duration = Duration::from_millis(10);
const GOLDEN_RATIO: f64 = 0.618_033_988_749_894_9;
const SOON: Duration = Duration::from_secs(5);

/// What disturbs a controller until it is stopped.
pub struct Load {
    over: Arc<AtomicBool>,
    threads: Vec<JoinHandle<Result<()>>>,
    services: Vec<Service>,
}

impl Load {
    pub fn start(bench: &BenchCell, scenario: &Scenario) -> Result<Load> {
        let over = Arc::new(AtomicBool::new(false));
        let mut load = Load { over: over.clone(), threads: Vec::new(), services: Vec::new() };
        if scenario.observers {
            for number in 0..N_OBSERVERS {
                let (cell, over) = (bench.cell.clone(), over.clone());
                load.threads.push(std::thread::spawn(move || come_and_go(&cell, number, &over)));
            }
        }
        if scenario.learner {
            // The learner's mathematics on every core, without pause.
            load.services.push(bench.study()?);
        }
        match (scenario.learner, scenario.kills) {
            (_, true) => {
                let (learners, over) = (bench.learners(), over.clone());
                load.threads.push(std::thread::spawn(move || start_and_kill(&learners, &over)));
            }
            (true, false) => load.services.push(bench.learners().start()?),
            _ => {}
        }
        Ok(load)
    }

    pub fn stop(self) -> Result<()> {
        self.over.store(true, Ordering::Relaxed);
        for mut service in self.services {
            service.kill();
        }
        for thread in self.threads {
            thread.join().ok().context("a disturbance panicked")??;
        }
        Ok(())
    }
}

/// An observer that joins, looks for a while, and leaves, again and again.
fn come_and_go(cell: &Cell, number: u64, over: &AtomicBool) -> Result<()> {
    while !over.load(Ordering::Relaxed) {
        let observer = ObserverPorts::open(cell, SOON)?;
        let leaves = Instant::now() + Duration::from_millis(100 + 20 * number);
        while Instant::now() < leaves {
            while observer.telemetry.receive()?.is_some() {}
            std::thread::sleep(Duration::from_millis(10));
        }
    }
    Ok(())
}

/// A learner that is killed every second, and started again.
fn start_and_kill(learners: &Learners, over: &AtomicBool) -> Result<()> {
    while !over.load(Ordering::Relaxed) {
        let mut learner = learners.start()?;
        let dies = Instant::now() + KILL_PERIOD;
        while Instant::now() < dies && !over.load(Ordering::Relaxed) {
            if let Some(status) = learner.exited()? {
                bail!(learner.obituary(status));
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        learner.kill();
    }
    Ok(())
}

/// Swaps two policies in turn until `over`; every one must be acknowledged as what it is.
pub fn swap_every_10_ms(cell: &Cell, over: &AtomicBool, row: &mut Row) -> Result<()> {
    let mut commander = Commander::open(cell)?;
    let targets = commander.two_policies()?;
    let (mut swaps, mut bad) = (0_usize, 0);
    let start = Instant::now();
    for number in 1.. {
        // Spread evenly over the loop's period, which a fixed distance would always meet in one place.
        let phase = (f64::from(number) * GOLDEN_RATIO).fract();
        let next = start + SWAP_PERIOD * number + Duration::from_secs_f64(1e-3 * phase);
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
        if over.load(Ordering::Relaxed) {
            break;
        }
        let to = targets[(swaps + 1) % 2];
        let sent_ns = now_ns();
        let reply = commander.ask(to.activate())?;
        if reply.accepted != 1 {
            // A stalled loop has not finished the last blend.
            if !reply.reason_text().contains("under way") {
                bail!("refused by the controller: {}", reply.reason_text());
            }
            continue;
        }
        swaps += 1;
        bad += u64::from(reply.policy.digest != to.digest);
        row.add_time(Duration::from_nanos(reply.applied_ns.saturating_sub(sent_ns)));
    }
    let status = commander.status()?;
    // The one that put the first policy to work is not among the measured.
    let lost = (swaps as u64 + 1).abs_diff(status.swaps_applied);
    row.misses = Some(row.misses.unwrap_or(0) + bad + lost + status.swaps_torn);
    Ok(())
}
