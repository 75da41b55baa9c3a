//! The search of a stored session, from its trials: the same search as when it ran.

use nalgebra::DVector;

use crate::config::LearnerConfig;
use crate::demonstration::Demonstration;
use crate::error::LearnerError;
use crate::problem::Problem;
use crate::search::AskTell;
use crate::store::{Store, TrialRecord};

/// A session brought back.
pub struct Replayed {
    pub problem: Problem,
    pub search: AskTell,
    pub trials: Vec<TrialRecord>,
}

impl Replayed {
    /// Tells the stored trials again; every one must come out as it was proposed, bit for bit.
    pub fn of(store: &Store, demonstrations: &[Demonstration]) -> Result<Replayed, LearnerError> {
        let config = &store.meta().learner;
        let problem = Problem::around(&store.initial_policy()?, config, demonstrations)?;
        let trials = store.trials()?;
        let search = replay(config, &problem, &trials)?;
        Ok(Replayed { problem, search, trials })
    }
}

/// The search after `trials`, each of which it must have proposed itself.
pub fn replay(
    config: &LearnerConfig,
    problem: &Problem,
    trials: &[TrialRecord],
) -> Result<AskTell, LearnerError> {
    let mut search = AskTell::new(problem.search(config));
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
