//! A swap: from which policy to which, how far it has come, why there is none.

use std::sync::Arc;

use shm_types::policy::{PolicyMsg, PolicyName};
use thiserror::Error;

/// A policy that passed admission and dry run.
#[derive(Debug)]
pub(crate) struct Served<P> {
    pub message: PolicyMsg,
    pub policy: P,
    pub n_records: usize,
}

impl<P> Served<P> {
    pub fn name(&self) -> PolicyName {
        self.message.name()
    }
}

/// Why a swap was refused.
#[derive(Debug, Error, PartialEq)]
pub(crate) enum SwapRefused {
    #[error("a swap to policy {0} is under way: wait for its acknowledgement and try again")]
    UnderWay(String),
    #[error(
        "there is no earlier policy to roll back to, and no good one yet: activate one by its id"
    )]
    NoWayBack,
    #[error("no policy is active and none is good yet: activate one first")]
    NothingToPin,
}

/// A commanded swap until it is complete.
#[derive(Debug)]
pub(crate) struct Swapping<P> {
    pub seq: u64,
    pub to: Arc<Served<P>>,
    pub now: bool,
    pub stage: Stage,
    /// A way back does not become a policy to go back to.
    pub is_rollback: bool,
}

#[derive(Debug, PartialEq)]
pub(crate) enum Stage {
    /// Not handed to the loop yet.
    Waiting,
    /// On its way to the loop.
    Sent,
    /// Acts, and the old policy fades out until this tick.
    Fading { until: u64 },
}
