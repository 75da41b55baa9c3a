//! The search of a stored session, from its trials: the same search as when it ran.

use nalgebra::DVector;

use crate::config::LearnerConfig;
use crate::encoding::Encoding;
use crate::error::LearnerError;
use crate::search::{self, AskTell, Space};
use crate::store::{Store, TrialRecord};

/// A session brought back.
pub struct Replayed {
    pub encoding: Encoding,
    pub space: Space,
    pub search: AskTell,
    pub trials: Vec<TrialRecord>,
}

impl Replayed {
    /// Tells the stored trials again; every one must come out as it was proposed, bit for bit.
    pub fn of(store: &Store) -> Result<Replayed, LearnerError> {
        let config = &store.meta().learner;
        let (encoding, space) = Encoding::new(&store.initial_policy()?, config)?;
        let trials = store.trials()?;
        let search = replay(config, &space, &trials)?;
        Ok(Replayed { encoding, space, search, trials })
    }
}

/// The search after `trials`, each of which it must have proposed itself.
pub fn replay(
    config: &LearnerConfig,
    space: &Space,
    trials: &[TrialRecord],
) -> Result<AskTell, LearnerError> {
    let mut search = AskTell::new(search::build(&config.search, config.seed, space.clone()));
    for (trial, rollout) in trials.iter().zip(1..) {
        if trial.rollout != rollout || !same_bits(&search.ask(rollout).theta, &trial.theta) {
            return Err(LearnerError::NotReproduced { rollout });
        }
        if !trial.set_aside {
            let told = search.tell(&trial.trial());
            told.map_err(|_| LearnerError::NotReproduced { rollout })?;
        }
    }
    Ok(search)
}

pub fn same_bits(a: &DVector<f64>, b: &DVector<f64>) -> bool {
    a.len() == b.len() && a.iter().zip(b.iter()).all(|(x, y)| x.to_bits() == y.to_bits())
}
