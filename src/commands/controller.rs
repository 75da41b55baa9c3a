//! `skillet controller`: the controller service of a cell.

use std::sync::atomic::AtomicBool;

use anyhow::{Result, bail};
use rt_controller::disk::timing_file::TimingFile;
use rt_controller::rt::{leave_core, loop_core};
use rt_controller::run::Controlled;
use rt_controller::{ControllerConfig, Pace, RunSummary, Station, run_external};
use shm_types::cell::Cell;

use crate::Verdict;
use crate::cell::state_dir;
use crate::cli::{ControllerArgs, PaceArg};
use crate::config::Config;
use crate::metrics::Endpoint;
use crate::signals::{Who, stop_flag};
use crate::tasks::{ArmWorld, World};
use crate::{background, external, holding, log, reload, setup};

pub fn run(args: &ControllerArgs) -> Result<Verdict> {
    if let Some(parent) = args.child {
        setup::end_with_parent(parent)?;
    }
    if let Some(log) = &args.background {
        background::enter(log)?;
    }
    let written = Config::load(args.config.as_deref())?;
    let mut config = written.clone();
    config.plant.kind = args.plant.map_or(config.plant.kind, Into::into);
    config.validate()?;
    let core = loop_core(config.controller.cpu);
    if args.pace != PaceArg::Max {
        leave_core(core); // before a thread starts; the loop's goes back there
    }
    let stop = stop_flag(Who::service(args.child))?;
    let set_level = log::start(&config.log);
    // The command line overrides the file, which counts as unchanged.
    reload::on_hangup(args.config.as_deref(), &written, set_level)?;
    let cell = Cell::new(args.cell.as_deref().unwrap_or(&config.cell.name))?;

    let _metrics =
        config.metrics.listen.map(|address| Endpoint::start(address, &cell)).transpose()?;
    // The cell of a single `learn` is gone with it.
    let state = (!args.private).then(|| state_dir(&config, &cell));
    let state = state.as_deref();
    let station = Station { cell: &cell, state, equipment: setup::equipment(&config)? };
    let summary = match config.task()?.world {
        World::Arm(arm) => {
            run_arm(station, &config, (arm.world)(&config)?, core, args.pace.into(), &stop)?
        }
        World::Action(world) => rt_controller::run_action(station, world(&config).as_ref(), &stop)?,
    };
    if let Some(path) = args.timing.as_deref().filter(|_| summary.ticks > 0)
        && let Err(error) = TimingFile::add(path, summary.timing)
    {
        tracing::warn!("{}: {error}; the timing of this run is lost", path.display());
    }
    tracing::info!(
        rollouts = summary.rollouts,
        policies_refused = summary.policies_refused,
        swaps = summary.swaps,
        ticks = summary.ticks,
        deadline_misses = summary.deadline_misses,
        "controller ended cleanly"
    );
    Ok(Verdict::Done)
}

fn run_arm(
    station: Station<'_>,
    config: &Config,
    world: ArmWorld,
    core: usize,
    pace: Pace,
    stop: &AtomicBool,
) -> Result<RunSummary> {
    let ArmWorld { model, q0, mut plant, referee, .. } = world;
    holding::check_start(config, &model)?;
    setup::arm_notes(config)?.iter().for_each(|note| tracing::warn!("{note}"));
    let controller = ControllerConfig { cpu: Some(core), ..config.controller.clone() };
    if config.plant.is_external() {
        let external = external::of(config, station.cell, &model, pace)?;
        let arm = (&model, q0, referee);
        return Ok(run_external(station, &controller, pace, arm, external, stop)?);
    }
    if pace == Pace::Plant {
        bail!(
            "--pace plant: the built-in simulation has no clock of its own; use --plant external, or \
             --pace realtime or max"
        );
    }
    let controlled = Controlled { model: &model, plant: &mut plant, q0, referee };
    Ok(rt_controller::run(station, &controller, pace, controlled, stop)?)
}
