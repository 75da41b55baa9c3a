//! The search of a stored session, from its trials: the same search as when it ran.

use nalgebra::DVector;

use crate::config::LearnerConfig;
use crate::demonstration::Demonstration;
use crate::error::LearnerError;
use crate::prediction::Predictor;
use crate::problem::Problem;
use crate::store::{Store, TrialRecord};
use search::AskTell;

/// A session brought back.
pub struct Replayed {
    pub problem: Problem,
    pub search: AskTell,
    pub trials: Vec<TrialRecord>,
}

impl Replayed {
    /// Tells the stored trials again; every one must come out as it was proposed, bit for bit.
    pub fn of(
        store: &Store,
        demonstrations: &[Demonstration],
        predictor: Option<Predictor>,
        on_told: &mut dyn FnMut(Told),
    ) -> Result<Replayed, LearnerError> {
        let config = &store.meta().learner;
        let problem = Problem::around(&store.initial_policy()?, config, demonstrations)?
            .with_prediction(config, predictor);
        let trials = store.trials()?;
        let search = replay(config, &problem, &trials, on_told)?;
        Ok(Replayed { problem, search, trials })
    }
}

/// How far a replay is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Told {
    pub trials: usize,
    pub of: usize,
}

/// The search after `trials`, each of which it must have proposed itself.
pub fn replay(
    config: &LearnerConfig,
    problem: &Problem,
    trials: &[TrialRecord],
    on_told: &mut dyn FnMut(Told),
) -> Result<AskTell, LearnerError> {
    let mut search = AskTell::new(problem.search(config));
    for (trial, rollout) in trials.iter().zip(1..) {
        if trial.rollout != rollout || !same_bits(&search.ask(rollout).theta, &trial.theta) {
            return Err(LearnerError::NotReproduced { rollout });
        }
        if !trial.set_aside {
            let told = search.tell(&trial.trial(config.search.targets()));
            told.map_err(|_| LearnerError::NotReproduced { rollout })?;
        }
        on_told(Told { trials: rollout as usize, of: trials.len() });
    }
    Ok(search)
}

pub fn same_bits(a: &DVector<f64>, b: &DVector<f64>) -> bool {
    a.len() == b.len() && a.iter().zip(b.iter()).all(|(x, y)| x.to_bits() == y.to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;
    use search::trial::Trial;
    use search::{Method, SearchConfig};
    use shm_types::measures::Measures;
    use shm_types::policy::PolicyMsg;

    fn record(trial: Trial) -> TrialRecord {
        TrialRecord {
            rollout: trial.rollout,
            theta: trial.theta,
            reward: trial.reward,
            success: trial.success,
            policy_id: trial.rollout,
            policy_digest: 0,
            boot_id: 0,
            applied_tick: 0,
            fault: 0,
            n_records: 0,
            set_aside: false,
            is_mean: false,
            measures: Measures::NONE,
        }
    }

    #[test]
    fn a_history_that_does_not_lead_here_is_refused_where_it_goes_astray() {
        let search = SearchConfig { method: Method::Tempered, ..Default::default() };
        let mut config = LearnerConfig { search, ..Default::default() };
        config.action.start = vec![8.0, 2.0];
        let initial = PolicyMsg::of_action(&config.action.start).sealed();
        let problem = Problem::around(&initial, &config, &[]).unwrap();
        let mut search = AskTell::new(problem.search(&config));
        let mut trials = Vec::new();
        for rollout in 1..=40 {
            let theta = search.ask(rollout).theta;
            let reward = (-theta.norm_squared()).exp();
            let trial = Trial { rollout, theta, reward, success: false, measured: Vec::new() };
            search.tell(&trial).unwrap();
            trials.push(record(trial));
        }
        let mut heard = Vec::new();
        assert!(replay(&config, &problem, &trials, &mut |told| heard.push(told)).is_ok());
        assert_eq!(heard.len(), 40);
        assert_eq!(heard[39], Told { trials: 40, of: 40 });
        let astray = |change: &dyn Fn(&mut TrialRecord)| {
            let mut trials = trials.clone();
            change(&mut trials[5]);
            match replay(&config, &problem, &trials, &mut |_| {}).err() {
                Some(LearnerError::NotReproduced { rollout }) => rollout,
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(astray(&|trial| trial.theta[0] += 1e-9), 6);
        assert_eq!(astray(&|trial| trial.rollout = 7), 6);
        assert!(astray(&|trial| trial.reward += 1.0) > 6, "another reward leads elsewhere, later");
    }
}
