//! The search of a stored session, from its trials: the same search as when it ran.

use nalgebra::DVector;

use crate::config::LearnerConfig;
use crate::demonstration::Demonstration;
use crate::error::LearnerError;
use crate::prediction::Predictor;
use crate::problem::Problem;
use crate::repertoire::serve;
use crate::store::{Store, TrialRecord};
use crate::wish::{Telling, Wish, Wishes};
use search::AskTell;
use search::trial::Proposal;

/// A session brought back.
pub struct Replayed {
    pub problem: Problem,
    pub search: AskTell,
    pub telling: Telling,
    pub wishes: Wishes,
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
        let (wishes, trials) = (store.wishes()?, store.trials()?);
        let (search, telling) = replay(config, &problem, &wishes, &trials, on_told)?;
        Ok(Replayed { problem, search, telling, wishes, trials })
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
    wishes: &Wishes,
    trials: &[TrialRecord],
    on_told: &mut dyn FnMut(Told),
) -> Result<(AskTell, Telling), LearnerError> {
    let mut search = AskTell::new(problem.search(config));
    let mut telling = Telling::new(wishes.of_rollout(1));
    for (trial, rollout) in trials.iter().zip(1..) {
        let before = &trials[..rollout as usize - 1];
        if wishes.changes_at(rollout) {
            (search, telling) = told_anew(config, problem, wishes.of_rollout(rollout), before)?;
        }
        let asked = ask(&mut search, problem, wishes, before, rollout).theta;
        if trial.rollout != rollout || !same_bits(&asked, &trial.theta) {
            return Err(LearnerError::NotReproduced { rollout });
        }
        if !trial.set_aside {
            tell(&mut search, &mut telling, trial, config)?;
        }
        on_told(Told { trials: rollout as usize, of: trials.len() });
    }
    if wishes.changes_at(trials.len() as u64 + 1) {
        return told_anew(config, problem, wishes.last(), trials);
    }
    Ok((search, telling))
}

/// What is executed as `rollout` after `trials`: a proposal of the search, but first of all under a new wish
/// what the repertoire has for it.
pub fn ask(
    search: &mut AskTell,
    problem: &Problem,
    wishes: &Wishes,
    trials: &[TrialRecord],
    rollout: u64,
) -> Proposal {
    let proposal = search.ask(rollout);
    let wish = wishes.of_rollout(rollout).filter(|_| wishes.changes_at(rollout));
    match wish.map(|wish| serve(&problem.spaces[0], trials, wish)) {
        Some(Ok(served)) => Proposal { theta: served.theta, ..proposal },
        _ => proposal,
    }
}

/// A search of its own that is told `trials` under another `wish` than the one they were proposed for.
pub fn told_anew(
    config: &LearnerConfig,
    problem: &Problem,
    wish: Option<&Wish>,
    trials: &[TrialRecord],
) -> Result<(AskTell, Telling), LearnerError> {
    let (mut search, mut telling) = (AskTell::new(problem.search(config)), Telling::new(wish));
    for trial in trials.iter().filter(|trial| !trial.set_aside) {
        search.ask(trial.rollout);
        tell(&mut search, &mut telling, trial, config)?;
    }
    Ok((search, telling))
}

fn tell(
    search: &mut AskTell,
    telling: &mut Telling,
    record: &TrialRecord,
    config: &LearnerConfig,
) -> Result<(), LearnerError> {
    let (trial, rollout) = (telling.trial(record, config.search.targets()), record.rollout);
    search.tell(&trial).map_err(|_| LearnerError::NotReproduced { rollout })?;
    telling.was_told(&trial);
    Ok(())
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
            trials.push(TrialRecord::of(trial, Measures::NONE));
        }
        let (mut heard, none) = (Vec::new(), Wishes::default());
        assert!(replay(&config, &problem, &none, &trials, &mut |told| heard.push(told)).is_ok());
        assert_eq!(heard.len(), 40);
        assert_eq!(heard[39], Told { trials: 40, of: 40 });
        let astray = |change: &dyn Fn(&mut TrialRecord)| {
            let mut trials = trials.clone();
            change(&mut trials[5]);
            match replay(&config, &problem, &none, &trials, &mut |_| {}).err() {
                Some(LearnerError::NotReproduced { rollout }) => rollout,
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(astray(&|trial| trial.theta[0] += 1e-9), 6);
        assert_eq!(astray(&|trial| trial.rollout = 7), 6);
        assert!(astray(&|trial| trial.reward += 1.0) > 6, "another reward leads elsewhere, later");
    }
}
