//! The operator of a cell whose plant may die: checks that the arm is held, and re-arms it.

use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use shm_types::cell::Cell;
use shm_types::command::{COMMAND_REARM, Command, PLANT_ABSENT};

use super::tally::Rearms;
use crate::bench::service::Commander;

/// Timeout of every step.
const PATIENCE: Duration = Duration::from_secs(30);
/// Between two looks at the status while the time is taken.
const GLANCE: Duration = Duration::from_millis(1);
/// Between two attempts to re-arm.
const AGAIN: Duration = Duration::from_millis(20);

pub struct Operator {
    commander: Commander,
}

impl Operator {
    pub fn of(cell: &Cell) -> Result<Operator> {
        Ok(Operator { commander: Commander::open(cell)? })
    }

    /// Waits until the controller's status says that the arm is held. A re-arm must then be refused, since the
    /// plant is dead.
    pub fn see_hold(&mut self, killed: Instant) -> Result<Duration> {
        while self.commander.status()?.latched_fault == 0 {
            if killed.elapsed() > PATIENCE {
                bail!("the plant was killed, and the arm is not held after {PATIENCE:?}");
            }
            std::thread::sleep(GLANCE);
        }
        let held = killed.elapsed();
        match self.rearm()? {
            Ok(()) => bail!("re-armed without a plant"),
            Err(_) => Ok(held),
        }
    }

    /// Waits for the plant, and re-arms as often as it takes; at once when nothing is latched.
    pub fn attend(&mut self) -> Result<Rearms> {
        let (start, mut rearms, mut why) = (Instant::now(), Rearms::default(), None);
        while start.elapsed() < PATIENCE {
            let status = self.commander.status()?;
            match (status.plant, status.latched_fault) {
                (PLANT_ABSENT, _) => {}
                (_, 0) => return Ok(rearms),
                _ => match self.rearm()? {
                    Ok(()) => rearms.accepted += 1,
                    Err(reason) => {
                        rearms.refused += 1;
                        why = Some(reason);
                    }
                },
            }
            std::thread::sleep(AGAIN);
        }
        let why = why.unwrap_or_else(|| "no plant has come".into());
        bail!("the arm cannot be re-armed within {PATIENCE:?}: {why}")
    }

    /// As `skillet rearm` does; the reason when it is refused.
    fn rearm(&mut self) -> Result<Result<(), String>> {
        let reply =
            self.commander.ask(Command::new(COMMAND_REARM, 0)).context("re-arming the cell")?;
        Ok(if reply.accepted == 1 { Ok(()) } else { Err(reply.reason_text()) })
    }
}
