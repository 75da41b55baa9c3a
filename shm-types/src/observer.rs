//! An observer's end of a cell, which does not affect the others.

use std::sync::Arc;
use std::time::Duration;

use iceoryx2::port::subscriber::Subscriber;

use crate::cell::Cell;
use crate::channel::*;
use crate::episode::EpisodeHeader;
use crate::news::{MeasuresNews, TrialNews};
use crate::policy::PolicyMsg;
use crate::ports::with_retry;
use crate::telemetry::Telemetry;

/// Everything a cell tells without being asked. All of it is lossy: who is late loses the oldest.
pub struct ObserverPorts {
    pub telemetry: Subscriber<Ipc, Telemetry, ()>,
    /// Every policy that goes into the loop, before it does.
    pub in_loop: Subscriber<Ipc, PolicyMsg, ()>,
    /// The header of every rollout that has ended.
    pub outcomes: Subscriber<Ipc, EpisodeHeader, ()>,
    /// What a learner has learnt, the last [`crate::news::TRIAL_HISTORY`] trials from before, too.
    pub trials: Subscriber<Ipc, TrialNews, ()>,
    /// What was measured of each, from now on.
    pub measures: Subscriber<Ipc, MeasuresNews, ()>,
    member: Arc<Member>,
}

impl ObserverPorts {
    pub fn open(cell: &Cell, timeout: Duration) -> Result<ObserverPorts, ChannelError> {
        with_retry(cell, timeout, &|| false, |member| {
            let (node, door) = (&member.node, Door::Open);
            Ok(ObserverPorts {
                telemetry: subscriber(&latest(node, TELEMETRY, &TELEMETRY_QOS, door)?, TELEMETRY)?,
                in_loop: subscriber(&latest(node, IN_LOOP, &IN_LOOP_QOS, door)?, IN_LOOP)?,
                outcomes: subscriber(&latest(node, OUTCOME, &OUTCOME_QOS, door)?, OUTCOME)?,
                trials: subscriber(&latest(node, TRIAL, &TRIAL_QOS, door)?, TRIAL)?,
                measures: subscriber(&latest(node, MEASURES, &MEASURES_QOS, door)?, MEASURES)?,
                member: member.clone(),
            })
        })
    }

    /// The controller that it listens to has not been followed by another one.
    pub fn is_current(&self) -> bool {
        self.member.generation.is_current()
    }
}
