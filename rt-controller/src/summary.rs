//! How a controller ended.

use shm_types::cell::CellError;
use shm_types::channel::ChannelError;
use shm_types::plant::socket::SocketError;
use thiserror::Error;

use crate::config::ControllerConfigError;
use crate::disk::state_file::StateError;
use crate::disk::timing_file::LoopTiming;
use crate::exchange::timing::Percentiles;

/// Why a controller ended with an error.
#[derive(Debug, Error)]
pub enum RunError {
    #[error(transparent)]
    Config(#[from] ControllerConfigError),
    #[error(transparent)]
    Cell(#[from] CellError),
    #[error(transparent)]
    Channel(#[from] ChannelError),
    #[error(transparent)]
    State(#[from] StateError),
    #[error(transparent)]
    Door(#[from] SocketError),
    #[error(
        "controller.period_us is {period_us}, but a tick and a step of the plant take {needed_us:.0} \
         µs on this host: use at least {enough_us:.0}"
    )]
    Period { period_us: u32, needed_us: f64, enough_us: f64 },
    #[error("the rt thread panicked: {0}; this is a bug, please report it")]
    Panic(String),
}

/// What a controller did until it was stopped.
#[derive(Clone, Debug, PartialEq)]
pub struct RunSummary {
    /// That a learner asked for.
    pub rollouts: u64,
    pub policies_refused: u64,
    pub swaps: u64,
    pub ticks: u64,
    pub deadline_misses: u64,
    /// Only meaningful when paced by the wall clock.
    pub wakeup: Percentiles,
    pub tick: Percentiles,
    pub timing: LoopTiming,
}
