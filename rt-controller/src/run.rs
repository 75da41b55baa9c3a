//! Runs the controller of an arm.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use physics::arm::{ArmModel, JointVector};
use physics::plant::{Plant, Presence};
use physics::referee::Referee;
use shm_types::cell::{Cell, CellLock, Role};
use shm_types::episode::TickRecord;
use shm_types::equipment::Equipment;
use shm_types::measures::Measures;
use shm_types::policy::PolicyMsg;

use crate::admit::admission::{admit, records_needed};
use crate::admit::disturbance::check_under;
use crate::admit::dry_run::dry_run;
use crate::admit::posture::admit_posture;
use crate::config::{Alone, ControllerConfig, Pace};
use crate::exchange::boot_id;
use crate::exchange::setup::Setup;
use crate::executor::arm::RtLoop;
use crate::executor::latch::Latch;
use crate::hot::policy::Policy;
use crate::hot::posture::PostureMove;
use crate::hot::tick::Controller;
use crate::remote::PlantName;
use crate::remote::expected::External;
use crate::remote::plant::RemotePlant;
use crate::rt::{self, Clock};
use crate::serve::serve;
use crate::summary::{RunError, RunSummary};

/// Ticks by which a host is asked whether it can hold the period, and the share of it that they may
/// take.
const TRIAL_TICKS: usize = 200;
const PERIOD_SHARE: f64 = 0.8;

/// What a controller drives, and how.
pub struct Controlled<'a, P: Plant> {
    pub model: &'a ArmModel,
    pub plant: &'a mut P,
    /// Start posture, rad.
    pub q0: JointVector,
    pub referee: Referee,
}

/// Where a controller serves, and what it tells of itself there.
#[derive(Clone, Copy)]
pub struct Station<'a> {
    pub cell: &'a Cell,
    /// Imported policies and what was served last live in this folder, or in memory only.
    pub state: Option<&'a Path>,
    pub equipment: Equipment,
}

/// Runs until `stop` is set, by a signal or by a stop command. Holds the cell's controller lock.
pub fn run<P: Plant>(
    station: Station<'_>,
    config: &ControllerConfig,
    pace: Pace,
    controlled: Controlled<P>,
    stop: &AtomicBool,
) -> Result<RunSummary, RunError> {
    Start::new(station, config, pace)?.run(controlled, |_| Measures::NONE, stop)
}

/// The same, of a plant that another process is. It may come, go and come again.
pub fn run_external(
    station: Station<'_>,
    config: &ControllerConfig,
    pace: Pace,
    arm: (&ArmModel, JointVector, Referee),
    external: External,
    stop: &AtomicBool,
) -> Result<RunSummary, RunError> {
    let mut start = Start::new(station, config, pace)?;
    let (model, q0, referee) = arm;
    let mut plant = RemotePlant::open(external, &q0, start.boot_id)?;
    start.plant_apart = Some(plant.name());
    let controlled = Controlled { model, plant: &mut plant, q0, referee };
    start.run(controlled, RemotePlant::take_outcome, stop)
}

/// A controller that may start: its settings are good, and the cell is its own.
struct Start<'a> {
    lock: CellLock,
    config: &'a ControllerConfig,
    pace: Pace,
    state: Option<&'a Path>,
    equipment: Equipment,
    boot_id: u64,
    /// The plant is another process.
    plant_apart: Option<PlantName>,
}

impl<'a> Start<'a> {
    fn new(
        station: Station<'a>,
        config: &'a ControllerConfig,
        pace: Pace,
    ) -> Result<Start<'a>, RunError> {
        config.validate()?;
        let Station { cell, state, equipment } = station;
        let lock = cell.lock(Role::Controller)?;
        let boot_id = boot_id();
        Ok(Start { lock, config, pace, state, equipment, boot_id, plant_apart: None })
    }

    fn run<P: Plant>(
        &self,
        controlled: Controlled<P>,
        outcome: fn(&mut P) -> Measures,
        stop: &AtomicBool,
    ) -> Result<RunSummary, RunError> {
        let Start { ref lock, config, pace, state, equipment, boot_id, .. } = *self;
        let Controlled { model, plant, q0, referee } = controlled;
        if pace == Pace::Realtime && plant.presence() == Presence::There {
            check_period(Controller::new(model, &q0, config, &referee), plant, config.period_us)?;
        }
        let admit = |message: &PolicyMsg| {
            let policy = admit(message, model, config)?;
            Ok((policy, records_needed(message.duration_s, config)))
        };
        let admit_to_serve = |message: &PolicyMsg| {
            let (policy, n_records) = admit(message)?;
            dry_run(&policy, model, &q0, config)?;
            Ok((policy, n_records))
        };
        let admit_posture = |offset: &JointVector, duration_s, before: &JointVector| {
            admit_posture(offset, duration_s, before, model, &q0, config)
        };
        let check_posture =
            |policy: &Policy, to: &PostureMove| check_under(policy, to, model, &q0, config);
        let privileged = AtomicBool::new(false);
        let latch = Latch::new();
        let alone_after = Duration::from_secs_f64(config.alone_after_s);
        let setup = Setup {
            boot_id,
            admit: &admit,
            admit_to_serve: &admit_to_serve,
            admit_posture: &admit_posture,
            check_posture: &check_posture,
            period_ns: config.period_ns(),
            record_ns: config.period_ns() * config.record_stride() as u64,
            pace,
            equipment,
            plant_apart: self.plant_apart.clone(),
            privileged: &privileged,
            latch: &latch,
            n_joints: model.n_joints(),
            can_swap: true,
            blend_ticks: config.blend_ticks().into(),
            alone_after: (config.alone == Alone::Serve).then_some(alone_after),
            state,
        };
        serve(lock, setup, stop, |ends| {
            let controller = Controller::new(model, &q0, config, &referee);
            let rt_loop = RtLoop::new(controller, plant, ends, &latch, config, outcome);
            match pace {
                Pace::Realtime | Pace::Plant => {
                    let granted = rt::acquire(config.priority, rt::loop_core(config.cpu));
                    for missing in &granted.missing {
                        tracing::warn!("real time is degraded: {missing}");
                    }
                    if cfg!(debug_assertions) {
                        tracing::warn!("this is a development build: its timings are meaningless");
                    }
                    privileged.store(granted.fifo, Ordering::Relaxed);
                    if pace == Pace::Plant {
                        return rt_loop.run_by_plant(stop);
                    }
                    let spin_ns = u64::from(config.spin_us) * 1000;
                    rt_loop.run_paced(Clock::new(config.period_ns(), 0, spin_ns), stop);
                }
                Pace::Max => rt_loop.run_unpaced(stop),
            }
        })
    }
}

/// A period that the host cannot hold is better refused than overrun: the median cost of a tick and
/// of a simulated plant's step. On a real arm nothing is commanded: the loop does not run yet.
fn check_period<P: Plant>(
    mut controller: Controller,
    plant: &mut P,
    period_us: u32,
) -> Result<(), RunError> {
    let mut record = TickRecord::ZERO;
    let is_simulated = plant.is_simulated();
    let mut cost = || {
        let start = Instant::now();
        let tau = controller.tick(&plant.measure(), &mut record);
        if is_simulated {
            plant.apply(&tau);
            plant.advance();
        }
        start.elapsed()
    };
    let mut costs: Vec<Duration> = (0..TRIAL_TICKS).map(|_| cost()).collect();
    costs.sort_unstable();
    if is_simulated {
        plant.begin_reset();
    }
    let needed_us = costs[TRIAL_TICKS / 2].as_secs_f64() * 1e6;
    let enough_us = needed_us / PERIOD_SHARE;
    if enough_us > f64::from(period_us) {
        return Err(RunError::Period { period_us, needed_us, enough_us });
    }
    Ok(())
}
