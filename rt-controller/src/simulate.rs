//! One whole rollout in this process, without transport, pace or threads: for studies.
//!
//! It ticks as the rt thread does, so that its numbers are those of a session, bit for bit.

use physics::plant::{Plant, Presence};
use shm_types::episode::TickRecord;
use shm_types::policy::PolicyMsg;
use thiserror::Error;

use crate::admit::admission::{AdmissionError, admit};
use crate::config::ControllerConfig;
use crate::executor::recording::Recording;
use crate::hot::posture::PostureMove;
use crate::hot::rollout::Phase;
use crate::hot::tick::Controller;
use crate::run::Controlled;

/// An executed rollout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Simulated {
    /// First fault, or 0.
    pub fault: u64,
    /// Records written, from the start of the slice.
    pub n_records: usize,
}

/// Why there is no rollout.
#[derive(Debug, Error)]
pub enum SimulateError {
    #[error(transparent)]
    Refused(#[from] AdmissionError),
    #[error("the external plant is gone; see its output for the reason")]
    PlantGone,
}

/// Waits for a plant in another process to do what it was asked for; every other one has.
fn finish<P: Plant>(plant: &mut P) -> Result<(), SimulateError> {
    loop {
        match plant.presence() {
            Presence::There => return Ok(()),
            Presence::Busy => {}
            Presence::Absent | Presence::Lost => return Err(SimulateError::PlantGone),
        }
    }
}

/// Runs `policy` from a fresh world to its end, if it is admitted. As many of its ticks as fit are
/// written to `records`.
pub fn simulate<P: Plant>(
    controlled: &mut Controlled<P>,
    config: &ControllerConfig,
    policy: &PolicyMsg,
    records: &mut [TickRecord],
) -> Result<Simulated, SimulateError> {
    simulate_moved(controlled, config, policy, &PostureMove::NONE, records)
}

/// The same with an offset of the posture that the null space is pulled to, as `skillet posture` sets in
/// served rollouts.
pub fn simulate_moved<P: Plant>(
    controlled: &mut Controlled<P>,
    config: &ControllerConfig,
    policy: &PolicyMsg,
    posture: &PostureMove,
    records: &mut [TickRecord],
) -> Result<Simulated, SimulateError> {
    let rollout = policy.rollout;
    let policy = admit(policy, controlled.model, config)?;
    let mut controller =
        Controller::new(controlled.model, &controlled.q0, config, &controlled.referee);
    let (mut recording, mut scratch) = (Recording::new(config.record_stride()), TickRecord::ZERO);
    controlled.plant.announce(rollout);
    controlled.plant.begin_reset();
    finish(controlled.plant)?;
    controller.move_posture(posture);
    controller.start(&policy);
    while controller.phase() != Phase::Idle {
        let measured = controlled.plant.measure();
        let record = recording.next(&controller, records).unwrap_or(&mut scratch);
        let tau = controller.tick(&measured, record);
        controlled.plant.apply(&tau);
        controlled.plant.advance();
        finish(controlled.plant)?;
    }
    Ok(Simulated { fault: controller.fault() as u64, n_records: recording.n_records })
}
