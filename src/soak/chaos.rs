//! What happens to one cell: a random script of kills, swaps and observers around its sessions.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use learner::store::{Store, TrialRecord};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use shm_types::cell::Role;
use shm_types::ports::ObserverPorts;

use super::cell::SoakCell;
use super::footprint::{Footprint, Held};
use super::ledger::Ledger;
use super::process::Process;
use crate::bench::service::Commander;
use crate::stderr::say;

/// Between two events, ms.
const PAUSE_MS: std::ops::Range<u64> = 20..300;
/// A start takes about as long: a kill within it meets every stage, ms.
const START_UP_MS: std::ops::Range<u64> = 0..40;
/// How long an observer lives before it is killed, and how long it stalls before that, ms.
const OBSERVED_MS: std::ops::Range<u64> = 0..150;
/// Out of ten events: kills, swaps, onlookers; the others are observers that are killed.
const KILLS: u32 = 6;
const SWAPS: u32 = 8;
const ONLOOKERS: u32 = 9;
const SOON: Duration = Duration::from_secs(10);

/// What was done to a role, and how it came back.
#[derive(Clone, Debug, Default)]
pub struct RoleTally {
    pub kills: u64,
    /// Of these, within the first moments after the start.
    pub at_start: u64,
    /// From its start to readiness, or for a learner to its controller.
    pub restarts: Vec<Duration>,
}

/// What happened in a cell so far.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    pub controller: RoleTally,
    pub learner: RoleTally,
    pub swaps: u64,
    pub onlookers: u64,
    /// Processes that watched, stalled or not, and were killed.
    pub observers_killed: u64,
    pub sessions: u64,
    /// Sessions that are not those of an undisturbed run.
    pub different: u64,
    pub ledger: Ledger,
    /// Of a controller that nobody kills.
    pub footprint: Footprint,
}

impl Tally {
    pub fn line(&self) -> String {
        format!(
            "{} + {} kills (controller + learner), {} swaps, {} sessions, {} trials, {} different",
            self.controller.kills,
            self.learner.kills,
            self.swaps,
            self.sessions,
            self.ledger.learnt,
            self.different
        )
    }
}

pub struct Chaos<'a> {
    cell: &'a SoakCell,
    kills_controller: bool,
    rng: ChaCha8Rng,
    over: &'a AtomicBool,
    tally: &'a Mutex<Tally>,
}

/// The services of a session; a learner that is done is gone.
struct Running {
    controller: Process,
    learner: Option<Process>,
}

impl<'a> Chaos<'a> {
    pub fn new(
        cell: &'a SoakCell,
        kills_controller: bool,
        seed: u64,
        over: &'a AtomicBool,
        tally: &'a Mutex<Tally>,
    ) -> Chaos<'a> {
        Chaos { cell, kills_controller, rng: ChaCha8Rng::seed_from_u64(seed), over, tally }
    }

    /// Session after session until it is over. The one under way is finished in peace.
    pub fn run(mut self) -> Result<()> {
        let mut controller = self.cell.controller()?;
        controller.said("READY=1")?.context("the controller ended by itself")?;
        for number in 0.. {
            controller = self.session(number, controller)?;
            if self.is_over() {
                break;
            }
        }
        controller.stop()
    }

    fn session(&mut self, number: u64, controller: Process) -> Result<Process> {
        let learner = self.start_learner(number)?;
        let mut running = Running { controller, learner };
        while let Some(learner) = &mut running.learner {
            if let Some(status) = running.controller.exited()? {
                bail!(running.controller.obituary(status));
            }
            match learner.exited()? {
                Some(status) if status.success() => running.learner = None,
                Some(status) => bail!(learner.obituary(status)),
                None if self.is_over() => {
                    std::thread::sleep(Duration::from_millis(20));
                }
                None => {
                    std::thread::sleep(self.random_ms(PAUSE_MS));
                    running = self.happen(number, running)?;
                }
            }
        }
        self.settle_accounts(number, &running.controller)?;
        Ok(running.controller)
    }

    fn happen(&mut self, number: u64, mut running: Running) -> Result<Running> {
        match self.rng.random_range(0..10) {
            event if event < KILLS => running = self.kill(number, running)?,
            event if event < SWAPS => self.swap()?,
            event if event < ONLOOKERS => self.look_on()?,
            _ => self.kill_observer()?,
        }
        Ok(running)
    }

    /// Kills one of the services, or both at once, and starts them again.
    fn kill(&mut self, number: u64, running: Running) -> Result<Running> {
        let Running { mut controller, mut learner } = running;
        let which = if self.kills_controller { self.rng.random_range(0..5) } else { 0 };
        let (kill_learner, kill_controller) = (which < 3, which >= 2);
        if kill_learner && let Some(learner) = learner.take() {
            learner.kill();
            self.count(|tally| tally.learner.kills += 1);
        }
        if kill_controller {
            controller.kill();
            self.count(|tally| tally.controller.kills += 1);
            self.kill_at_start(Role::Controller, number)?;
            controller = self.cell.controller()?;
            let ready = controller.said("READY=1")?.context("the controller ended by itself")?;
            self.count(|tally| tally.controller.restarts.push(ready));
        }
        if kill_learner {
            self.kill_at_start(Role::Learner, number)?;
            learner = self.start_learner(number)?;
        }
        Ok(Running { controller, learner })
    }

    /// Half the time, once to three times.
    fn kill_at_start(&mut self, role: Role, number: u64) -> Result<()> {
        for _ in 0..self.rng.random_range(0..7_u32).saturating_sub(3) {
            let process = match role {
                Role::Controller => self.cell.controller()?,
                Role::Learner => self.cell.learner(number)?,
            };
            std::thread::sleep(self.random_ms(START_UP_MS));
            process.kill();
            self.count(|tally| {
                let role = match role {
                    Role::Controller => &mut tally.controller,
                    Role::Learner => &mut tally.learner,
                };
                role.kills += 1;
                role.at_start += 1;
            });
        }
        Ok(())
    }

    /// `None` when the session was done already.
    fn start_learner(&mut self, number: u64) -> Result<Option<Process>> {
        let mut learner = self.cell.learner(number)?;
        let Some(ready) = learner.said("STATUS=learning")? else { return Ok(None) };
        self.count(|tally| tally.learner.restarts.push(ready));
        Ok(Some(learner))
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
        self.count(|tally| tally.onlookers += 1);
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
    fn settle_accounts(&mut self, number: u64, controller: &Process) -> Result<()> {
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
        let held = match self.kills_controller {
            true => None,
            false => Some(Held::at_rest(controller.id())?),
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
        match self.tally.lock() {
            Ok(mut tally) => change(&mut tally),
            Err(broken) => change(&mut broken.into_inner()),
        }
    }
}
