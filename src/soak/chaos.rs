//! What happens to one cell: a random script of kills, swaps and observers around its sessions.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use learner::store::{Store, TrialRecord};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use shm_types::ports::ObserverPorts;

use super::cell::SoakCell;
use super::footprint::Held;
use super::ledger::Ledger;
use super::operator::Operator;
use super::ordeal::{Kill, Role};
use super::process::Process;
use super::tally::{Tally, locked};
use crate::bench::service::Commander;
use crate::stderr::say;

/// Between two events, ms.
const PAUSE_MS: std::ops::Range<u64> = 20..300;
/// The same while sessions are finished in peace.
const PEACE: Duration = Duration::from_millis(20);
/// A start takes about as long: a kill within it meets every stage, ms.
const START_UP_MS: std::ops::Range<u64> = 0..40;
/// How long an observer lives before it is killed, and how long it stalls before that, ms.
const OBSERVED_MS: std::ops::Range<u64> = 0..150;
/// Out of ten events: kills, swaps, observers; the rest are observers that are killed.
const KILLS: u32 = 6;
const SWAPS: u32 = 8;
const OBSERVERS: u32 = 9;
const SOON: Duration = Duration::from_secs(10);

/// The services of a session; a learner that is done is gone.
type Running = BTreeMap<Role, Process>;

pub struct Chaos<'a> {
    cell: &'a SoakCell,
    rng: ChaCha8Rng,
    over: &'a AtomicBool,
    tally: &'a Mutex<Tally>,
}

impl<'a> Chaos<'a> {
    pub fn new(
        cell: &'a SoakCell,
        seed: u64,
        over: &'a AtomicBool,
        tally: &'a Mutex<Tally>,
    ) -> Chaos<'a> {
        Chaos { cell, rng: ChaCha8Rng::seed_from_u64(seed), over, tally }
    }

    /// Session after session until it is over. The one under way is finished in peace.
    pub fn run(mut self) -> Result<()> {
        let mut running = Running::new();
        for number in 0.. {
            self.session(number, &mut running)?;
            if self.is_over() {
                break;
            }
        }
        if let Some(controller) = running.remove(&Role::Controller) {
            controller.stop()?;
        }
        expect_end(&mut running)
    }

    fn session(&mut self, number: u64, running: &mut Running) -> Result<()> {
        for role in self.missing(running) {
            self.start(role, number, running)?;
        }
        while goes_on(running)? {
            let is_over = self.is_over();
            std::thread::sleep(if is_over { PEACE } else { self.random_ms(PAUSE_MS) });
            self.attend()?;
            if !is_over {
                self.happen(number, running)?;
            }
        }
        self.settle_accounts(number, running)
    }

    fn happen(&mut self, number: u64, running: &mut Running) -> Result<()> {
        match self.rng.random_range(0..10) {
            event if event < KILLS => self.kill(number, running),
            event if event < SWAPS => self.swap(),
            event if event < OBSERVERS => self.look_on(),
            _ => self.kill_observer(),
        }
    }

    /// Kills one of the services, or several at once, and starts them again.
    fn kill(&mut self, number: u64, running: &mut Running) -> Result<()> {
        let kills = self.cell.ordeal.kills();
        let kill = kills[self.rng.random_range(0..kills.len())];
        match kill {
            [Role::Plant] => {
                let mut operator = Operator::of(&self.cell.cell)?;
                let killed = Instant::now();
                let _dead = self.strike(kill, running);
                let held = operator.see_hold(killed)?;
                self.count(|tally| {
                    tally.holds.push(held);
                    tally.rearms.refused += 1;
                });
            }
            _ => drop(self.strike(kill, running)),
        }
        if !running.contains_key(&Role::Controller) {
            expect_end(running)?;
        }
        for role in self.missing(running) {
            self.kill_at_start(role, number)?;
            self.start(role, number, running)?;
        }
        self.attend()
    }

    /// At once: their managers, which take a moment to end, are left to the caller.
    fn strike(&mut self, kill: Kill, running: &mut Running) -> Vec<Process> {
        let mut victims: Vec<Process> =
            kill.iter().filter_map(|role| running.remove(role)).collect();
        if self.rng.random() {
            victims.reverse();
        }
        victims.iter_mut().for_each(Process::kill);
        self.count(|tally| {
            *tally.kills.entry(kill).or_default() += 1;
            kill.iter().for_each(|role| tally.role(*role).kills += 1);
        });
        victims
    }

    /// Half the time, once to three times.
    fn kill_at_start(&mut self, role: Role, number: u64) -> Result<()> {
        for _ in 0..self.rng.random_range(0..7_u32).saturating_sub(3) {
            let mut process = self.cell.start(role, number)?;
            std::thread::sleep(self.random_ms(START_UP_MS));
            process.kill();
            self.count(|tally| {
                tally.role(role).kills += 1;
                tally.role(role).at_start += 1;
            });
        }
        Ok(())
    }

    fn missing(&self, running: &Running) -> Vec<Role> {
        let services = self.cell.ordeal.services().iter().copied();
        services.filter(|role| !running.contains_key(role)).collect()
    }

    /// Waits until it is up. A learner whose session was done already is gone again.
    fn start(&mut self, role: Role, number: u64, running: &mut Running) -> Result<()> {
        let mut process = self.cell.start(role, number)?;
        match process.said(role.when_up())? {
            Some(up) => {
                self.count(|tally| tally.role(role).restarts.push(up));
                running.insert(role, process);
            }
            None if role == Role::Learner => {}
            None => bail!("the {} ended by itself", role.name()),
        }
        Ok(())
    }

    /// Re-arms an arm that is held. Only a plant that was in the loop latches when it dies, and a
    /// controller that dies with it may have put that on disk or not.
    fn attend(&mut self) -> Result<()> {
        if self.cell.ordeal.has_plant() {
            let rearms = Operator::of(&self.cell.cell)?.attend()?;
            self.count(|tally| tally.rearms.add(rearms));
        }
        Ok(())
    }

    /// Into the rollout in progress, as an operator would.
    fn swap(&mut self) -> Result<()> {
        let mut commander = Commander::open(&self.cell.cell)?;
        let policies = commander.import_two()?;
        let to = policies[self.rng.random_range(0..2)];
        let reply = commander.ask(to.activate())?;
        let reason = reply.reason_text();
        if reply.accepted == 1 {
            self.count(|tally| tally.swaps += 1);
        } else if !reason.contains("under way") && !reason.contains("ended before") {
            bail!("swap refused by the controller: {reason}");
        }
        Ok(())
    }

    /// Status and telemetry.
    fn look_on(&mut self) -> Result<()> {
        Commander::open(&self.cell.cell)?.status()?;
        let observer = ObserverPorts::open(&self.cell.cell, SOON)?;
        let leaves = Instant::now() + self.random_ms(0..50);
        while Instant::now() < leaves {
            while observer.telemetry.receive()?.is_some() {}
            std::thread::sleep(Duration::from_millis(1));
        }
        self.count(|tally| tally.observers += 1);
        Ok(())
    }

    /// A process that watches, half the time stops reading, and dies without a farewell.
    fn kill_observer(&mut self) -> Result<()> {
        let mut observer = self.cell.observer()?;
        std::thread::sleep(self.random_ms(OBSERVED_MS));
        if self.rng.random() {
            observer.stall()?;
            std::thread::sleep(self.random_ms(OBSERVED_MS));
        }
        observer.kill();
        self.count(|tally| tally.observers_killed += 1);
        Ok(())
    }

    /// Compares the session with an undisturbed one, and the episodes with their log.
    fn settle_accounts(&mut self, number: u64, running: &Running) -> Result<()> {
        let (folder, seed) = self.cell.session(number);
        let trials = |folder: &std::path::Path| -> Result<Vec<Vec<u64>>> {
            let trials = Store::open(&folder.join("session.db"))?.trials()?;
            Ok(trials.iter().map(TrialRecord::bits).collect())
        };
        let same = trials(&folder)? == trials(&self.cell.reference(seed)?)?;
        if !same {
            say(&format!("{}: differs from an undisturbed run", folder.display()));
        }
        let ledger = Ledger::of(&folder, &self.cell.dir.join("controller.log"))?;
        let held = match running.get(&Role::Controller) {
            Some(controller) if self.cell.ordeal.spares(Role::Controller) => {
                Some(Held::at_rest(controller.id())?)
            }
            _ => None,
        };
        self.count(|tally| {
            tally.sessions += 1;
            tally.different += u64::from(!same);
            tally.ledger.add(&ledger);
            held.into_iter().for_each(|held| tally.footprint.add(held));
        });
        Ok(())
    }

    fn random_ms(&mut self, range: std::ops::Range<u64>) -> Duration {
        // Finer than a millisecond: kills must meet every instruction.
        Duration::from_micros(self.rng.random_range(1000 * range.start..1000 * range.end))
    }

    fn is_over(&self) -> bool {
        self.over.load(Ordering::Relaxed)
    }

    fn count(&self, change: impl FnOnce(&mut Tally)) {
        change(&mut locked(self.tally));
    }
}

/// Whether the learner is at work. Nobody else ends by itself.
fn goes_on(running: &mut Running) -> Result<bool> {
    let mut is_done = false;
    for (role, process) in running.iter_mut() {
        match process.exited()? {
            None => {}
            Some(status) if *role == Role::Learner && status.success() => is_done = true,
            Some(status) => bail!(process.obituary(status)),
        }
    }
    if is_done {
        running.remove(&Role::Learner);
    }
    Ok(running.contains_key(&Role::Learner))
}

/// A plant without its controller ends by itself.
fn expect_end(running: &mut Running) -> Result<()> {
    match running.remove(&Role::Plant) {
        Some(plant) => plant.end().context("a plant whose controller is gone"),
        None => Ok(()),
    }
}
