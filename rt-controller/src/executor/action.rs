//! Runs the controller of a world without an arm: actions in, measured values out.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use nalgebra::Vector3;
use physics::action::{ActionWorld, Measured};
use shm_types::cell::Role;
use shm_types::episode::{MAX_RECORDS, TickRecord};
use shm_types::measures::{Measure, Measures};
use shm_types::policy::PolicyMsg;

use crate::admit::admission::{Action, admit_action};
use crate::admit::posture::PostureError;
use crate::config::Pace;
use crate::exchange::boot_id;
use crate::exchange::setup::Setup;
use crate::executor::latch::Latch;
use crate::executor::recording::Recording;
use crate::fault::Fault;
use crate::hot::rollout::Phase;
use crate::rings::Applied;
use crate::rings::{Done, Ends, Job};
use crate::rt::now_ns;
use crate::run::Station;
use crate::serve::serve;
use crate::summary::{RunError, RunSummary};

/// How long the thread sleeps while there is nothing to do.
const IDLE_SLEEP: Duration = Duration::from_micros(100);
/// Time between two records of the tracked object.
pub const PERIOD_NS: u64 = 1_000_000;
const PERIOD_S: f64 = PERIOD_NS as f64 * 1e-9;

/// Runs until `stop` is set. Such a world has no clock of its own: every rollout is immediate.
pub fn run_action<W: ActionWorld + ?Sized>(
    station: Station<'_>,
    world: &W,
    stop: &AtomicBool,
) -> Result<RunSummary, RunError> {
    let admit = |message: &_| {
        let action = admit_action(message, world.dim())?;
        let path = world.path(&action.0[..world.dim()], PERIOD_S);
        let n_records = path.len().min(MAX_RECORDS);
        Ok(((action, path), n_records))
    };
    let (never, no_machine) = (AtomicBool::new(false), Latch::new());
    let setup = Setup {
        boot_id: boot_id(),
        admit: &admit,
        // There is no torque and no way to come to harm.
        admit_to_serve: &admit,
        admit_posture: &|_, _, _| Err(PostureError::NoArm),
        check_posture: &|_, _| Ok(()),
        period_ns: PERIOD_NS,
        record_ns: PERIOD_NS,
        pace: Pace::Max,
        equipment: station.equipment,
        plant_apart: None,
        privileged: &never,
        latch: &no_machine,
        n_joints: 0,
        can_swap: false,
        blend_ticks: 0,
        // An immediate world without a learner would repeat itself as fast as it can.
        alone_after: None,
        state: station.state,
    };
    let lock = station.cell.lock(Role::Controller)?;
    serve(&lock, setup, stop, |ends| execute(ends, world, stop))
}

/// An action and the path of the tracked object under it.
type Throw = (Action, Vec<Vector3<f64>>);

fn execute<W: ActionWorld + ?Sized>(mut ends: Ends<Throw>, world: &W, stop: &AtomicBool) {
    let mut tick = 0;
    while !stop.load(Ordering::Relaxed) {
        let Ok(Job { policy: throw, mut episode, swap, .. }) = ends.jobs.pop() else {
            std::thread::sleep(IDLE_SLEEP);
            continue;
        };
        let applied_ns = now_ns();
        let (Action(action), path) = &throw;
        let action = &action[..world.dim()];
        let n_records = record(path, tick, episode.payload_mut());
        let measures = measure(world, action);
        let recording = Recording::at_once(n_records, tick, applied_ns);
        if let Some(seq) = swap {
            let applied = Applied { seq, tick, at_ns: applied_ns, in_rollout: true, policy: throw };
            // Never full, as the ring below: one rollout is in flight at a time.
            let _ = ends.applied.push(applied);
        }
        let done = Done { episode, recording, fault: Fault::None, measures };
        tick += n_records.max(1) as u64;
        let _ = ends.done.push(done);
    }
}

/// One rollout in this process: what was measured, and the records of the tracked object. `None` when
/// the policy is not admitted.
pub fn replay<W: ActionWorld + ?Sized>(
    world: &W,
    policy: &PolicyMsg,
) -> Option<(Measures, Vec<TickRecord>)> {
    let Action(action) = admit_action(policy, world.dim()).ok()?;
    let action = &action[..world.dim()];
    let path = world.path(action, PERIOD_S);
    let mut records = vec![TickRecord::ZERO; path.len().min(MAX_RECORDS)];
    record(&path, 0, &mut records);
    Some((measure(world, action), records))
}

/// What the world measures; nothing of it that is not fit to be told.
pub fn measure<W: ActionWorld + ?Sized>(world: &W, action: &[f64]) -> Measures {
    let mut measures = Measures::NONE;
    for Measured { name, unit, value } in world.measure(action) {
        if let Err(error) = measures.push(Measure { name, unit, value }) {
            tracing::error!("{error}; it is not told");
        }
    }
    measures
}

/// Writes the path of the tracked object; returns the records in use.
fn record(path: &[Vector3<f64>], first_tick: u64, records: &mut [TickRecord]) -> usize {
    for (i, (record, position)) in records.iter_mut().zip(path).enumerate() {
        *record = TickRecord {
            tick: first_tick + i as u64,
            phase: Phase::Execute as u32,
            t_s: i as f64 * PERIOD_S,
            object_position: (*position).into(),
            object_quaternion: [1.0, 0.0, 0.0, 0.0],
            ..TickRecord::ZERO
        };
    }
    path.len().min(records.len())
}
