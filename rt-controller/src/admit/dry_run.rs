//! The dry run: a policy on an ideal arm, before it may be served on the real one.

use physics::arm::{ArmModel, JointVector};
use physics::ideal::IdealArm;
use shm_types::episode::{FLAG_TORQUE_CLIPPED, TickRecord};

use crate::admit::admission::AdmissionError;
use crate::config::ControllerConfig;
use crate::fault::Fault;
use crate::hot::policy::Policy;
use crate::hot::rollout::Phase;
use crate::hot::tick::Controller;
use physics::plant::Plant;
use physics::referee::Referee;

/// A pancake that lies still; what it does is not this run's question.
const OBJECT_HEIGHT_M: f64 = 0.01;

/// Executes `policy` once from `q0` under the controller's own law and limits.
///
/// # Errors
/// [`AdmissionError::DryRunFault`] when a tick had to fall back to the hold,
/// [`AdmissionError::DryRunTorque`] when more than `config.dry_run_clipped` of the ticks wanted
/// more torque than a joint has.
pub(crate) fn dry_run(
    policy: &Policy,
    model: &ArmModel,
    q0: &JointVector,
    config: &ControllerConfig,
) -> Result<(), AdmissionError> {
    let mut arm = IdealArm::new(model, q0, config.period_s(), OBJECT_HEIGHT_M);
    let mut controller = Controller::new(model, q0, config, &Referee::Clock);
    let mut record = TickRecord::ZERO;
    let mut first_clip: Option<(usize, f64)> = None;
    let (mut n_executed, mut n_clipped) = (0_u32, 0_u32);
    controller.start(policy);
    while controller.phase() != Phase::Idle {
        let tau = controller.tick(&arm.measure(), &mut record);
        let is_clipped = record.flags & FLAG_TORQUE_CLIPPED != 0;
        if record.phase == Phase::Execute as u32 || record.phase == Phase::Settle as u32 {
            n_executed += 1;
            n_clipped += u32::from(is_clipped);
        }
        if is_clipped && first_clip.is_none() {
            let used = |i: &usize| tau[*i].abs() / model.limits().tau_max[*i];
            let joint = (0..model.n_joints()).max_by(|a, b| used(a).total_cmp(&used(b)));
            first_clip = Some((joint.unwrap_or(0), record.t_s));
        }
        arm.apply(&tau);
        arm.advance();
    }
    if controller.fault() != Fault::None {
        let fault = Fault::describe(controller.fault() as u32);
        return Err(AdmissionError::DryRunFault { fault, t_s: record.t_s });
    }
    let share = f64::from(n_clipped) / f64::from(n_executed.max(1));
    match first_clip {
        Some((joint, t_s)) if share > config.dry_run_clipped => Err(AdmissionError::DryRunTorque {
            joint: model.joint_names()[joint].to_string(),
            limit: model.limits().tau_max[joint],
            t_s,
            percent: 100.0 * share,
            allowed: 100.0 * config.dry_run_clipped,
        }),
        _ => Ok(()),
    }
}
