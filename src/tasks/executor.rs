//! Rollouts of a task in this process, bit for bit those of a session: for studies and replays.

use anyhow::{Context, Result};
use physics::plant::Plant;
use rt_controller::ControllerConfig;
use rt_controller::executor::action;
use rt_controller::hot::posture::PostureMove;
use rt_controller::run::Controlled;
use rt_controller::simulate::{Simulated, simulate_moved};
use shm_types::episode::{EpisodeHeader, MAX_RECORDS, TickRecord};
use shm_types::policy::PolicyMsg;

use super::{ArmWorld, World};
use crate::config::Config;
use crate::external::Started;

/// Executes a policy: what an episode tells of it.
pub type Executor = dyn FnMut(&PolicyMsg) -> Result<(EpisodeHeader, Vec<TickRecord>)>;

pub fn executor(config: &Config) -> Result<Box<Executor>> {
    Ok(match config.task()?.world {
        World::Action(world) => {
            let (world, period_ns) = (world(config), action::PERIOD_NS);
            Box::new(move |policy| {
                let (measures, records) =
                    action::replay(world.as_ref(), policy).with_context(|| {
                        format!("policy {} is no longer admitted", policy.policy_id)
                    })?;
                Ok((EpisodeHeader { measures, period_ns, ..EpisodeHeader::default() }, records))
            })
        }
        World::Arm(arm) => {
            let ArmWorld { model, q0, mut plant, referee, .. } = (arm.world)(config)?;
            let controller = config.controller.clone();
            if config.plant.is_external() {
                let mut plant = Started::new(config, &model)?;
                return Ok(Box::new(move |policy| {
                    let mut controlled =
                        Controlled { model: &model, plant: &mut plant, q0, referee };
                    let (header, records) = episode(&mut controlled, &controller, policy)?;
                    Ok((EpisodeHeader { measures: plant.take_outcome(), ..header }, records))
                }));
            }
            Box::new(move |policy| {
                let mut controlled = Controlled { model: &model, plant: &mut plant, q0, referee };
                episode(&mut controlled, &controller, policy)
            })
        }
    })
}

/// One rollout of an arm: what an episode tells of it.
pub fn episode<P: Plant>(
    controlled: &mut Controlled<P>,
    config: &ControllerConfig,
    policy: &PolicyMsg,
) -> Result<(EpisodeHeader, Vec<TickRecord>)> {
    episode_moved(controlled, config, policy, &PostureMove::NONE)
}

/// The same with the posture moved.
pub fn episode_moved<P: Plant>(
    controlled: &mut Controlled<P>,
    config: &ControllerConfig,
    policy: &PolicyMsg,
    posture: &PostureMove,
) -> Result<(EpisodeHeader, Vec<TickRecord>)> {
    let period_ns = config.period_ns() * config.record_stride() as u64;
    let mut records = vec![TickRecord::ZERO; MAX_RECORDS];
    let Simulated { fault, n_records } =
        simulate_moved(controlled, config, policy, posture, &mut records)?;
    records.truncate(n_records);
    Ok((EpisodeHeader { fault, period_ns, ..EpisodeHeader::default() }, records))
}
