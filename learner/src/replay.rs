//! The search of a stored session, from its trials: the same search as when it ran.

use std::collections::BTreeMap;

use nalgebra::DVector;

use crate::config::LearnerConfig;
use crate::demonstration::Demonstration;
use crate::error::LearnerError;
use crate::history::History;
use crate::prediction::Predictor;
use crate::problem::Problem;
use crate::repertoire::serve;
use crate::store::{Asked, Store, TrialRecord};
use crate::wish::Telling;
use search::AskTell;
use search::trial::Proposal;

/// A session brought back.
pub struct Replayed {
    pub problem: Problem,
    pub search: AskTell,
    pub telling: Telling,
    pub history: History,
    /// In the order in which they were told.
    pub trials: Vec<TrialRecord>,
    /// What was proposed and has no trial.
    pub in_flight: Vec<Asked>,
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
            .with_added(config, &store.added()?)?
            .with_prediction(config, predictor);
        let (history, mut trials, in_flight) =
            (store.history()?, store.trials()?, store.in_flight()?);
        trials.sort_by_key(|trial| trial.told);
        let asked = Session { history: &history, trials: &trials, in_flight: &in_flight };
        let (search, telling) = replay(config, &problem, &asked, on_told)?;
        Ok(Replayed { problem, search, telling, history, trials, in_flight })
    }
}

/// How far a replay is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Told {
    pub trials: usize,
    pub of: usize,
}

/// What a search was told, and what it was asked.
#[derive(Clone, Copy)]
pub struct Session<'a> {
    pub history: &'a History,
    /// In the order in which they were told.
    pub trials: &'a [TrialRecord],
    pub in_flight: &'a [Asked],
}

impl Session<'_> {
    /// Rollout and θ of what was asked, by the number of trials that were known then; in the order of asking.
    fn asked(&self) -> BTreeMap<u64, BTreeMap<u64, &DVector<f64>>> {
        let told = self.trials.iter().map(|trial| (trial.asked_after, trial.rollout, &trial.theta));
        let in_flight = self.in_flight.iter();
        let in_flight = in_flight
            .map(|Asked { proposal, after, .. }| (*after, proposal.rollout, &proposal.theta));
        let mut asked: BTreeMap<u64, BTreeMap<u64, &DVector<f64>>> = BTreeMap::new();
        for (after, rollout, theta) in told.chain(in_flight) {
            asked.entry(after).or_default().insert(rollout, theta);
        }
        asked
    }
}

/// The search of a session, all of whose proposals it must have made itself, from what it knew then.
pub fn replay(
    config: &LearnerConfig,
    problem: &Problem,
    session: &Session<'_>,
    on_told: &mut dyn FnMut(Told),
) -> Result<(AskTell, Telling), LearnerError> {
    let Session { history, trials, .. } = *session;
    let (mut search, mut telling) = told_anew(config, problem, history.telling(1), &[])?;
    let mut asked = session.asked();
    // Every trial so far was told before the next one was asked.
    let mut is_serial = true;
    for place in 1..=trials.len() as u64 + 1 {
        let known = &trials[..place as usize - 1];
        for (rollout, theta) in asked.remove(&(place - 1)).into_iter().flatten() {
            let again = ask(&mut search, problem, history, known, rollout);
            if !same_bits(&again.theta, theta) {
                return Err(LearnerError::NotReproduced { rollout });
            }
        }
        let Some(trial) = trials.get(place as usize - 1) else { break };
        if trial.told != place || trial.asked_after >= place {
            return Err(LearnerError::NotReproduced { rollout: trial.rollout });
        }
        let (next, known) = (place + 1, &trials[..place as usize]);
        is_serial &= trial.asked_after + 1 == place;
        let is_newest = is_serial && history.changes_only_at(next, trial.rollout);
        if problem.grows_at(next) || (history.changes_at(next) && !is_newest) {
            (search, telling) = told_anew(config, problem, history.telling(next), known)?;
        } else {
            if history.ratings.changes_at(next) {
                // Told once, as the next proposal sees it: the same as all of them anew.
                telling = telling.under(history.ratings.view(next));
            }
            tell(&mut search, &mut telling, trial, config)?;
        }
        on_told(Told { trials: place as usize, of: trials.len() });
    }
    // What was asked when more was known than there is.
    match asked.into_values().flatten().next() {
        Some((rollout, _)) => Err(LearnerError::NotReproduced { rollout }),
        None => Ok((search, telling)),
    }
}

/// What is executed as `rollout` after `trials`: a proposal of the search, but first of all under a new wish
/// what the repertoire has for it.
///
/// Wishes, ratings and demonstrations count trials: they come when nothing is in flight, so that the first
/// rollout asked after n trials is n + 1.
pub fn ask(
    search: &mut AskTell,
    problem: &Problem,
    history: &History,
    trials: &[TrialRecord],
    rollout: u64,
) -> Proposal {
    let proposal = search.ask(rollout);
    let (wishes, next) = (&history.wishes, trials.len() as u64 + 1);
    let wish = wishes.of_rollout(rollout).filter(|_| rollout == next && wishes.changes_at(rollout));
    match wish.map(|wish| serve(&problem.spaces[0], &history.seen(trials, rollout), wish)) {
        Some(Ok(served)) => Proposal { theta: served.theta, ..proposal },
        _ => proposal,
    }
}

/// A search of its own that is told `trials` in another way than when they were proposed.
pub fn told_anew(
    config: &LearnerConfig,
    problem: &Problem,
    mut telling: Telling,
    trials: &[TrialRecord],
) -> Result<(AskTell, Telling), LearnerError> {
    let mut search = AskTell::new(problem.search_for(config, trials.len() as u64 + 1));
    for trial in trials {
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
    let rollout = record.rollout;
    let Some(trial) = telling.trial(record, config.search.targets()) else {
        search.withdraw(rollout);
        return Ok(());
    };
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
    use crate::people::PeopleConfig;
    use crate::ratings::{Rating, Ratings};
    use search::trial::Trial;
    use search::{Method, SearchConfig};
    use shm_types::measures::Measures;
    use shm_types::policy::PolicyMsg;

    fn told<'a>(history: &'a History, trials: &'a [TrialRecord]) -> Session<'a> {
        Session { history, trials, in_flight: &[] }
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
            trials.push(TrialRecord::of(trial, Measures::NONE));
        }
        let (mut heard, none) = (Vec::new(), History::default());
        assert!(
            replay(&config, &problem, &told(&none, &trials), &mut |told| heard.push(told)).is_ok()
        );
        assert_eq!(heard.len(), 40);
        assert_eq!(heard[39], Told { trials: 40, of: 40 });
        let astray = |change: &dyn Fn(&mut TrialRecord)| {
            let mut trials = trials.clone();
            change(&mut trials[5]);
            match replay(&config, &problem, &told(&none, &trials), &mut |_| {}).err() {
                Some(LearnerError::NotReproduced { rollout }) => rollout,
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(astray(&|trial| trial.theta[0] += 1e-9), 6);
        assert_eq!(astray(&|trial| trial.rollout = 7), 7);
        assert_eq!(astray(&|trial| trial.told = 7), 6);
        assert_eq!(astray(&|trial| trial.asked_after = 6), 6, "before it was asked");
        assert!(
            astray(&|trial| trial.own_reward += 1.0) > 6,
            "another reward leads elsewhere, later"
        );
    }

    /// A made-up session that is rated now and then: at once, late, otherwise, and not any more.
    #[test]
    fn ratings_are_told_again_from_where_they_took_effect() {
        let people = PeopleConfig { weight: 1.0, ..PeopleConfig::default() };
        let mut config = LearnerConfig { people, ..Default::default() };
        config.search.power.n_initial = 5;
        config.action.start = vec![1.0, 2.0];
        let initial = PolicyMsg::of_action(&config.action.start).sealed();
        let problem = Problem::around(&initial, &config, &[]).unwrap();
        let (mut history, mut trials) = (History::default(), Vec::new());
        history.ratings = Ratings::of(people, Vec::new());
        let (mut search, mut telling) =
            told_anew(&config, &problem, history.telling(1), &[]).unwrap();
        for rollout in 1..=30 {
            let theta = ask(&mut search, &problem, &history, &trials, rollout).theta;
            let reward = (-theta.norm_squared()).exp();
            let trial = Trial { rollout, theta, reward, success: false, measured: Vec::new() };
            let record = TrialRecord::of(trial, Measures::NONE);
            tell(&mut search, &mut telling, &record, &config).unwrap();
            let worth = (10.0 * reward).round();
            trials.push(record);
            let said =
                |rollout, rating| Rating { letter: 0, after: trials.len() as u64, rollout, rating };
            let new = match rollout % 4 {
                0 => vec![],
                1 => vec![said(rollout, Some(worth))],
                2 if rollout > 2 => vec![said(rollout - 1, Some(2.0)), said(rollout, Some(worth))],
                3 => vec![said(rollout - 1, None), said(rollout, Some(3.0))],
                _ => vec![said(rollout, Some(worth))],
            };
            history.ratings = history.ratings.with(new.clone());
            if !new.is_empty() {
                let anew = history.telling(rollout + 1);
                (search, telling) = told_anew(&config, &problem, anew, &trials).unwrap();
            }
        }
        let (again, _) = replay(&config, &problem, &told(&history, &trials), &mut |_| {}).unwrap();
        assert_eq!(again.snapshot(31), search.snapshot(31));
        let mut forgotten = history.clone();
        forgotten.ratings = Ratings::of(people, history.ratings.all()[1..].to_vec());
        assert!(replay(&config, &problem, &told(&forgotten, &trials), &mut |_| {}).is_err());
    }
}
