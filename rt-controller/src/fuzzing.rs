//! What a fuzzer may reach of the crate's inside; compiled for it alone (`cfg(fuzzing)`).

use physics::arm::{ArmModel, JointVector};
use shm_types::episode::{EpisodeHeader, TickRecord};

use crate::admit::admission::AdmissionError;
use crate::admit::dry_run;
use crate::config::ControllerConfig;
use crate::disk::spool;
use crate::hot::policy::Policy;

/// The content of a file of the spool.
pub fn decode_spooled(bytes: &[u8]) -> Option<(EpisodeHeader, Vec<TickRecord>)> {
    spool::decode(bytes).ok()
}

/// What an import goes through after admission.
pub fn dry_run(
    policy: &Policy,
    model: &ArmModel,
    q0: &JointVector,
    config: &ControllerConfig,
) -> Result<(), AdmissionError> {
    dry_run::dry_run(policy, model, q0, config)
}
