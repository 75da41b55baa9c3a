//! Runs the controller of a world without an arm: actions in, measured values out.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use physics::action::ActionWorld;
use shm_types::cell::Cell;
use shm_types::episode::{MAX_RECORDS, OutcomeMsg, TickRecord};

use crate::admission::{Action, admit_action};
use crate::config::Pace;
use crate::exchange::Setup;
use crate::rollout::Phase;
use crate::run::{RunError, RunSummary};
use crate::serve::{Done, Ends, Job, serve};

/// How long the thread sleeps while there is nothing to do.
const IDLE_SLEEP: Duration = Duration::from_micros(100);
/// Time between two records of the tracked object.
const PERIOD_NS: u64 = 1_000_000;
const PERIOD_S: f64 = PERIOD_NS as f64 * 1e-9;

/// Runs until `stop` is set. Such a world has no clock of its own: every rollout is immediate.
pub fn run_action<W: ActionWorld>(
    cell: &Cell,
    world: &W,
    stop: &AtomicBool,
) -> Result<RunSummary, RunError> {
    let n_records = (world.duration_s() / PERIOD_S).ceil() as usize;
    let admit = |message: &_| Ok((admit_action(message, world.dim())?, n_records.min(MAX_RECORDS)));
    let never = AtomicBool::new(false);
    let setup = Setup { admit: &admit, period_ns: PERIOD_NS, pace: Pace::Max, privileged: &never };
    serve(cell, setup, stop, |ends| execute(ends, world, stop))
}

fn execute<W: ActionWorld>(mut ends: Ends<Action>, world: &W, stop: &AtomicBool) {
    let mut tick = 0;
    while !stop.load(Ordering::Relaxed) {
        let Ok(Job { policy, mut episode }) = ends.jobs.pop() else {
            std::thread::sleep(IDLE_SLEEP);
            continue;
        };
        let action = &policy.0[..world.dim()];
        let n_records = record(world, action, tick, episode.payload_mut());
        let outcome = OutcomeMsg { value: world.measure(action), ..OutcomeMsg::ZERO };
        let done = Done { episode, n_records, applied_tick: tick, fault: 0, outcome };
        tick += n_records.max(1) as u64;
        // Never full: the ring has a place for every loan.
        let _ = ends.done.push(done);
    }
}

/// Writes the way of the tracked object; returns the records in use.
fn record<W: ActionWorld>(
    world: &W,
    action: &[f64],
    first_tick: u64,
    records: &mut [TickRecord],
) -> usize {
    for (i, record) in records.iter_mut().enumerate() {
        let t_s = i as f64 * PERIOD_S;
        let Some(position) = world.object_at(action, t_s) else { return i };
        *record = TickRecord {
            tick: first_tick + i as u64,
            phase: Phase::Execute as u32,
            t_s,
            object_position: position.into(),
            object_quaternion: [1.0, 0.0, 0.0, 0.0],
            ..TickRecord::ZERO
        };
    }
    records.len()
}
