//! Why a session cannot start or go on, and why an episode is refused.

use shm_types::episode::EpisodeError;
#[cfg(feature = "session")]
use shm_types::episode::{FAULT_APPROACH_TIMEOUT, FAULT_OVERRUN};
use thiserror::Error;

use crate::encoding::FitError;
use crate::exploration::ExplorationError;
use crate::expression::ParseError;
#[cfg(feature = "session")]
use crate::judge::AssessError;
use crate::judge::JudgeError;
use crate::parameters::ParameterError;
#[cfg(feature = "session")]
use crate::store::StoreError;
use search::range::ConfigError;
use search::{DirectionsError, TellError};

/// Why a session cannot start or go on.
#[derive(Debug, Error)]
pub enum LearnerError {
    #[error(transparent)]
    Config(#[from] ConfigError),
    #[error(transparent)]
    Parameters(#[from] ParameterError),
    #[error(transparent)]
    Fit(#[from] FitError),
    #[error(transparent)]
    Directions(#[from] DirectionsError),
    #[error(transparent)]
    Exploration(#[from] ExplorationError),
    #[cfg(feature = "session")]
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The plant or the task is another one than this session's, or its judge is broken.
    #[error(transparent)]
    Judge(JudgeError),
    /// No other rollout would fare better: the session cannot go on.
    #[error("{0}; the settings of a session cannot change: start a new one with --out")]
    Reward(TellError),
    #[error("learner.where: {0}")]
    Wish(Box<ParseError>),
    #[error("the demonstration {file} that was added to this session does not fit it: {reason}")]
    Added { file: String, reason: String },
    #[error(
        "rollout {rollout} cannot be reproduced from the stored session: resume it with the program \
         that wrote it, or start another one with --out"
    )]
    NotReproduced { rollout: u64 },
}

/// Why an episode was refused. Except for `Learner` the caller ignores the episode and goes on; in
/// no case has anything changed.
#[derive(Debug, Error)]
pub enum CompleteError {
    #[error(transparent)]
    Invalid(#[from] EpisodeError),
    #[error("episode of session {found:016x} instead of {expected:016x}; ignored")]
    ForeignSession { found: u64, expected: u64 },
    #[error("episode of rollout {rollout}, which is stored already; ignored")]
    Duplicate { rollout: u64 },
    #[error("episode of rollout {rollout}, which was not requested; ignored")]
    NotAsked { rollout: u64 },
    #[error("episode of rollout {rollout} executed another policy than requested; ignored")]
    OtherPolicy { rollout: u64 },
    #[error("the controller did not execute rollout {rollout}: {reason}")]
    NotExecuted { rollout: u64, reason: &'static str },
    #[error("the controller refused the policy of rollout {rollout}: {reason}")]
    Refused { rollout: u64, reason: String },
    #[error("another policy was swapped into rollout {rollout}")]
    Swapped { rollout: u64 },
    #[error("rollout {rollout} was cut short by a hardware fault")]
    MachineFault { rollout: u64 },
    #[error("rollout {rollout} was executed by {found} instead of {wanted}")]
    OtherWorld { rollout: u64, found: String, wanted: String },
    /// Hand the same episode in again: its judge takes its time.
    #[error("rollout {rollout} is being judged")]
    BeingJudged { rollout: u64 },
    #[error("rollout {rollout} was not judged: {error}")]
    NotJudged { rollout: u64, error: JudgeError },
    #[error(transparent)]
    Tell(TellError),
    #[error(transparent)]
    Learner(LearnerError),
}

#[cfg(feature = "session")]
impl CompleteError {
    /// What becomes of a rollout that has no verdict.
    pub(crate) fn not_judged(rollout: u64, error: JudgeError) -> CompleteError {
        match error {
            JudgeError::Assess(AssessError::NotYet) => CompleteError::BeingJudged { rollout },
            // As anything else that the disk refuses: it is waited for.
            JudgeError::Assess(AssessError::NotWritten { path, detail }) => {
                CompleteError::Learner(StoreError::Disk { path, detail }.into())
            }
            JudgeError::OtherMeasures { .. } | JudgeError::Assess(AssessError::Broken(_)) => {
                CompleteError::Learner(LearnerError::Judge(error))
            }
            error => CompleteError::NotJudged { rollout, error },
        }
    }
}

impl From<TellError> for CompleteError {
    fn from(error: TellError) -> CompleteError {
        match error {
            TellError::Reward { .. } => CompleteError::Learner(LearnerError::Reward(error)),
            other => CompleteError::Tell(other),
        }
    }
}

/// Why an episode with this fault is no trial: the policy was never tried. Other faults during the
/// rollout are the policy's doing and are rewarded like anything else it does.
#[cfg(feature = "session")]
pub(crate) fn not_executed(fault: u64) -> Option<&'static str> {
    match fault {
        FAULT_APPROACH_TIMEOUT => Some(
            "the arm did not reach the start posture in time; if it carries a load that its model \
             lacks, raise controller.posture_stiffness and controller.posture_damping",
        ),
        FAULT_OVERRUN => Some("its host could not hold the period; see `skillet doctor`"),
        _ => None,
    }
}
