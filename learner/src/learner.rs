//! One session: the parts of the learner, joined so that the loop around them reads
//! ask → publish → receive → reward → tell → checkpoint.
//!
//! ```text
//! while !learner.is_done() {
//!     let policy = learner.next_policy()?;              // durable, then publish it
//!     let report = learner.complete(cell, &header, &records)?; // durable, then acknowledge it
//! }
//! ```
//!
//! A trial and the proposal after it become durable in one transaction: a disk is waited for once a
//! rollout.
//!
//! Several rollouts may be in flight, in as many cells. Each trial keeps how many trials were known when it was
//! proposed and in which order trials were told, so a session is a function of configuration, seed and these.
//! What changes how trials are seen, a wish or what people say, is taken when nothing is in flight.

mod diary;
mod flights;
mod people;
mod unexecuted;

use std::collections::BTreeMap;
use std::path::Path;

use shm_types::episode::{
    EpisodeHeader, FAULT_POLICY_REFUSED, FAULT_SWAPPED, MACHINE_FAULTS, TickRecord,
};
use shm_types::equipment::Equipment;
use shm_types::policy::PolicyMsg;
use shm_types::text;

use crate::config::LearnerConfig;
use crate::demonstration::Demonstration;
use crate::encoding;
use crate::error::{CompleteError, LearnerError, not_executed};
use crate::history::History;
use crate::judge::{Judge, JudgeError};
use crate::mail::Mail;
use crate::modes::{ModeReport, assess, mode_policy_id};
use crate::parameters::PolicyIds;
use crate::path::{PathRow, decimate};
use crate::problem::Problem;
use crate::replay::{self, Replayed, Told, replay, told_anew};
use crate::store::{CellRecord, Event, SessionMeta, Step, Store, TrialRecord};
use crate::summary::{Summary, TrialReport};
use crate::wish::{Telling, Wish};
pub use diary::judged_by;
use flights::Flight;
pub use people::Taken;
use search::{AskTell, TellError};

/// The session file within its folder.
pub const SESSION_FILE: &str = "session.db";
/// Id of the policy the session starts from.
const INITIAL_POLICY_ID: u64 = 0;

/// A session in memory and on disk.
pub struct Learner {
    config: LearnerConfig,
    problem: Problem,
    search: AskTell,
    telling: Telling,
    history: History,
    judge: Judge,
    store: Store,
    mail: Mail,
    /// In the order in which they were told.
    trials: Vec<TrialRecord>,
    /// What was proposed, durably, and has no trial yet, by rollout.
    in_flight: BTreeMap<u64, Flight>,
    /// What the cells drive, in the order of the trials from which on they do.
    cells: Vec<CellRecord>,
}

impl Learner {
    /// Starts a session in the existing folder `directory`, from a demonstration, or from the
    /// action of the configuration when the task has no arm. Its measures are those of `judge`.
    pub fn create(
        directory: &Path,
        meta: SessionMeta,
        demonstrations: &[Demonstration],
        judge: Judge,
    ) -> Result<Self, LearnerError> {
        meta.learner.validate()?;
        let meta = SessionMeta { measures: judge.declared(), ..meta };
        let (policy, source) = match meta.learner.demonstrations_are.starts(demonstrations).next() {
            Some(shown) => (encoding::fit(&meta.learner.encoding(), shown)?, shown[0].file()),
            None => (PolicyMsg::of_action(&meta.learner.action.start).sealed(), "an action"),
        };
        let (session, policy_id) = (meta.session_id, INITIAL_POLICY_ID);
        let initial = PolicyMsg { session, policy_id, ..policy };
        let problem = Problem::around(&initial, &meta.learner, demonstrations)?
            .with_prediction(&meta.learner, judge.predictor());
        let config = meta.learner.clone();
        let mut store = Store::create(&directory.join(SESSION_FILE), meta, &initial)?;
        store.record_event("created", source)?;
        if config.n_components.number().is_none() {
            let said =
                format!("the Bayesian information criterion chose {} components", policy.n_systems);
            tracing::info!("{said}");
            store.record_event("components", &said)?;
        }
        let history = store.history()?;
        let (search, telling) = told_anew(&config, &problem, history.telling(1), &[])?;
        let (trials, in_flight) = (Vec::new(), Vec::new());
        let replayed = Replayed { problem, search, telling, history, trials, in_flight };
        let mut learner = Learner::of(directory, config, store, judge, replayed)?;
        learner.follow_wish()?;
        learner.follow_judge()?;
        Ok(learner)
    }

    /// Continues the session in `directory` as if it had never stopped: the stored trials are told
    /// again, and every stored proposal must come out bit for bit. Only `rollouts` may differ from
    /// the configuration the session was started with, and the demonstration must be its own.
    pub fn resume(
        directory: &Path,
        task: &str,
        config: &LearnerConfig,
        demonstrations: &[Demonstration],
        judge: Judge,
    ) -> Result<Self, LearnerError> {
        Learner::resume_showing(directory, task, config, demonstrations, judge, &mut |_| {})
    }

    /// The same for a session that may be long: `on_told` hears of every trial told again.
    pub fn resume_showing(
        directory: &Path,
        task: &str,
        config: &LearnerConfig,
        demonstrations: &[Demonstration],
        judge: Judge,
        on_told: &mut dyn FnMut(Told),
    ) -> Result<Self, LearnerError> {
        config.validate()?;
        let store = Store::resume(&directory.join(SESSION_FILE))?;
        store.expect_task(task)?;
        config.check_resumes(&store.meta().learner)?;
        let judge = judge.keeping(&store.meta().measures);
        let (found, expected) = (judge.declared(), store.meta().measures.clone());
        if found != expected {
            return Err(LearnerError::Judge(JudgeError::OtherMeasures { found, expected }));
        }
        let replayed = Replayed::of(&store, demonstrations, judge.predictor(), on_told)?;
        let asked = replayed.in_flight.clone();
        let mut learner = Learner::of(directory, config.clone(), store, judge, replayed)?;
        for asked in asked {
            learner.take_up(asked)?;
        }
        if learner.is_settled() {
            learner.follow_wish()?;
        }
        let text = format!("after {} trials", learner.trials.len());
        learner.store.record_event("resumed", &text)?;
        learner.follow_judge()?;
        Ok(learner)
    }

    /// The learner of the session in `directory`, whose trials have been replayed.
    fn of(
        directory: &Path,
        config: LearnerConfig,
        store: Store,
        judge: Judge,
        replayed: Replayed,
    ) -> Result<Learner, LearnerError> {
        let Replayed { problem, search, telling, history, trials, .. } = replayed;
        Ok(Learner {
            config,
            problem,
            search,
            telling,
            history,
            judge,
            cells: store.cells()?,
            store,
            mail: Mail::of(directory),
            trials,
            in_flight: BTreeMap::new(),
        })
    }

    /// The wish of the configuration is another one than that of the session so far.
    fn has_other_wish(&self) -> bool {
        self.history.wishes.last().map_or("", Wish::text) != self.config.wish
    }

    /// Takes the wish of the configuration, where it is another one than before: from here on the search is
    /// the one that knows the trials so far as they look under it. What was proposed before is taken back.
    fn follow_wish(&mut self) -> Result<(), LearnerError> {
        if !self.has_other_wish() {
            return Ok(());
        }
        let text = self.config.wish.clone();
        let wish = Wish::parse_any(&text, &self.store.meta().measures)
            .map_err(|error| LearnerError::Wish(Box::new(error)))?;
        let next = self.trials.len() as u64 + 1;
        let telling = Telling::new(wish.as_ref()).under(self.history.ratings.view(next));
        (self.search, self.telling) =
            told_anew(&self.config, &self.problem, telling, &self.trials)?;
        self.store.put_wish(&text, &self.search.snapshot(next))?;
        self.history.wishes = self.store.wishes()?;
        self.in_flight.clear();
        let said = if text.is_empty() { "nothing".into() } else { format!("`{text}`") };
        let said = format!("from rollout {next} on a success must meet: {said}");
        tracing::info!("{said}");
        Ok(self.store.record_event("wish", &said)?)
    }

    /// Takes an episode from `cell`: checks that it executed just what is in flight as its rollout, has it
    /// judged, stores it and tells the search. As long as its judge is at work
    /// ([`CompleteError::BeingJudged`]), hand the same episode in again.
    pub fn complete(
        &mut self,
        cell: &str,
        header: &EpisodeHeader,
        records: &[TickRecord],
    ) -> Result<TrialReport, CompleteError> {
        let flight = self.matching_flight(header)?;
        let records = header.validate(records)?;
        if header.fault == FAULT_SWAPPED {
            return Err(CompleteError::Swapped { rollout: header.rollout });
        }
        if MACHINE_FAULTS.contains(&header.fault) {
            return Err(CompleteError::MachineFault { rollout: header.rollout });
        }
        if header.fault == FAULT_POLICY_REFUSED {
            let reason = text::unpack(&header.reason);
            return Err(CompleteError::Refused { rollout: header.rollout, reason });
        }
        if let Some(reason) = not_executed(header.fault) {
            return Err(CompleteError::NotExecuted { rollout: header.rollout, reason });
        }
        let judged = self.judge.judge(&flight.policy, header, records);
        let (measures, success, reward) =
            judged.map_err(|error| CompleteError::not_judged(header.rollout, error))?;
        let trial = self.seen(TrialRecord {
            own_reward: reward,
            own_success: success,
            boot_id: header.boot_id,
            applied_tick: header.applied_tick,
            fault: header.fault,
            n_records: header.n_records,
            measures,
            ..self.unjudged(flight, cell)
        });
        self.tell(&trial)?;
        self.record(trial, Some(&header.equipment), &decimate(records), None)
    }

    /// A trial as what it counts for now.
    fn seen(&self, mut trial: TrialRecord) -> TrialRecord {
        self.history.show(std::slice::from_mut(&mut trial));
        trial
    }

    /// Tells the search, unless only a rating of it counts; says once which predictions it stopped to rely on.
    fn tell(&mut self, trial: &TrialRecord) -> Result<(), TellError> {
        let (targets, before) = (self.config.search.targets(), self.search.doubted());
        let Some(told) = self.telling.trial(trial, targets) else { return Ok(()) };
        self.search.tell(&told)?;
        self.telling.was_told(&told);
        for j in self.search.doubted().into_iter().filter(|j| !before.contains(j)) {
            tracing::warn!(
                "rollout {}: the prediction of {} is too inaccurate; the search now uses only \
                 its measured values",
                trial.rollout,
                targets[j].measure
            );
        }
        Ok(())
    }

    /// Makes a trial durable that the search knows, and what the search proposes after it.
    fn record(
        &mut self,
        trial: TrialRecord,
        equipment: Option<&Equipment>,
        path: &[PathRow],
        note: Option<&Event>,
    ) -> Result<TrialReport, CompleteError> {
        let report = TrialReport {
            rollout: trial.rollout,
            reward: trial.reward,
            success: trial.success,
            fault: trial.fault,
            set_aside: trial.set_aside,
            measures: trial.measures,
        };
        let news = equipment.and_then(|equipment| self.news_of_cell(&trial, equipment));
        let landed = self.in_flight.remove(&trial.rollout);
        let cell = trial.cell.clone();
        // The search is not told of every trial.
        self.search.withdraw(trial.rollout);
        self.trials.push(trial);
        let search = self.search.snapshot(self.next_rollout());
        // Its cell is free now.
        let next = self.may_ask().then(|| self.propose(&cell));
        let step = Step {
            trial: &self.trials[self.trials.len() - 1],
            cell: news.as_ref(),
            path,
            search: &search,
            durable_rollout: self.durable_rollout(),
            next: next.as_ref().map(|flight| (&flight.asked, &flight.policy)),
            note,
        };
        if let Err(error) = self.store.record_step(&step) {
            self.trials.pop();
            self.in_flight.extend(landed.map(|flight| (report.rollout, flight)));
            self.forget_what_is_not_durable();
            return Err(CompleteError::Learner(error.into()));
        }
        self.in_flight.extend(next.map(|flight| (flight.policy.rollout, flight)));
        self.cells.extend(news);
        Ok(report)
    }

    /// What is not durable was not learnt.
    fn forget_what_is_not_durable(&mut self) {
        let in_flight: Vec<_> =
            self.in_flight.values().map(|flight| flight.asked.clone()).collect();
        let (history, trials) = (&self.history, &self.trials);
        let session = replay::Session { history, trials, in_flight: &in_flight };
        (self.search, self.telling) = replay(&self.config, &self.problem, &session, &mut |_| {})
            .expect("these trials were reproduced before");
    }

    /// What the search has found so far, each with its policy; stored.
    pub fn modes(&mut self) -> Result<Vec<(ModeReport, PolicyMsg)>, LearnerError> {
        let reports = self.mode_reports()?;
        let trials = self.trials.len() as u64;
        let with_policy = |report: ModeReport| {
            let ids = self.ids(0, mode_policy_id(trials, report.number as u64));
            let policy = self.problem.decode(&report.mode.mean, ids);
            (report, policy)
        };
        let modes: Vec<_> = reports.into_iter().map(with_policy).collect();
        self.store.put_modes(&modes)?;
        Ok(modes)
    }

    /// What the search has found so far.
    pub fn mode_reports(&self) -> Result<Vec<ModeReport>, LearnerError> {
        let forbidden = self.store.forbidden()?;
        Ok(assess(
            &self.search.modes(),
            &self.telling.anew().all(&self.trials, self.config.search.targets()),
            &forbidden,
        ))
    }

    /// All rollouts of the configuration are stored.
    pub fn is_done(&self) -> bool {
        self.trials.len() as u64 >= self.config.rollouts
    }

    /// A success of this rollout had to be as wished.
    pub fn is_under_wish(&self, rollout: u64) -> bool {
        self.history.wishes.of_rollout(rollout).is_some()
    }

    /// Rollouts the session is to have.
    pub fn rollouts(&self) -> u64 {
        self.config.rollouts
    }

    pub fn session_id(&self) -> u64 {
        self.store.meta().session_id
    }

    pub fn summary(&self) -> Summary {
        Summary::of(&self.trials)
    }

    /// In the order in which they were told.
    pub fn trials(&self) -> &[TrialRecord] {
        &self.trials
    }

    pub fn store(&self) -> &Store {
        &self.store
    }

    fn ids(&self, rollout: u64, policy_id: u64) -> PolicyIds {
        PolicyIds { session: self.session_id(), rollout, policy_id }
    }
}
