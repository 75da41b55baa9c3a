//! One session: the parts of the learner, joined so that the loop around them reads
//! ask → publish → receive → reward → tell → checkpoint.
//!
//! ```text
//! while !learner.is_done() {
//!     let policy = learner.next_policy()?;              // durable, then publish it
//!     let report = learner.complete(&policy, &header, &records)?; // durable, then acknowledge it
//! }
//! ```

use std::path::Path;

use nalgebra::DVector;
use shm_types::episode::{
    EpisodeError, EpisodeHeader, FAULT_APPROACH_TIMEOUT, FAULT_POLICY_REFUSED, TickRecord,
};
use shm_types::policy::PolicyMsg;
use thiserror::Error;

use crate::config::{ConfigError, LearnerConfig};
use crate::demonstration::Demonstration;
use crate::initial_policy::initial_policy;
use crate::parameters::{ParameterError, PolicyIds};
use crate::path::decimate;
use crate::problem::Problem;
use crate::search::{DirectionsError, Search};
use crate::store::{PolicyKind, SessionMeta, Store, StoreError, TrialRecord};
use crate::summary::{Summary, TrialReport};
use crate::trial::Proposal;

/// The session file within its folder.
pub const SESSION_FILE: &str = "session.db";
/// The policy of rollout n has the id n; the mean after n trials has the id n plus this.
pub const MEAN_POLICY_ID: u64 = 1_000_000;
/// Id of the policy fitted to the demonstration.
const INITIAL_POLICY_ID: u64 = 0;

/// Why a session cannot start or go on.
#[derive(Debug, Error)]
pub enum LearnerError {
    #[error(transparent)]
    Config(#[from] ConfigError),
    #[error(transparent)]
    Parameters(#[from] ParameterError),
    #[error(transparent)]
    Directions(#[from] DirectionsError),
    #[error(transparent)]
    Store(#[from] StoreError),
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
    #[error("episode of rollout {rollout}, which was not asked for; ignored")]
    NotAsked { rollout: u64 },
    #[error("episode of rollout {rollout} executed another policy than the one asked for; ignored")]
    OtherPolicy { rollout: u64 },
    #[error("the controller did not execute rollout {rollout}: {reason}")]
    NotExecuted { rollout: u64, reason: &'static str },
    #[error(transparent)]
    Learner(LearnerError),
}

/// A session in memory and on disk.
pub struct Learner {
    config: LearnerConfig,
    problem: Problem,
    search: Box<dyn Search>,
    store: Store,
    trials: Vec<TrialRecord>,
    pending: Option<(Proposal, PolicyMsg)>,
}

impl Learner {
    /// Starts a session in the existing folder `directory`, from a demonstration.
    pub fn create(
        directory: &Path,
        meta: SessionMeta,
        demonstration: &Demonstration,
    ) -> Result<Self, LearnerError> {
        meta.learner.validate()?;
        let initial = PolicyMsg {
            session: meta.session_id,
            policy_id: INITIAL_POLICY_ID,
            ..initial_policy(demonstration, &meta.learner.initial_policy())
        };
        let problem = Problem::around(&initial, &meta.learner, demonstration)?;
        let config = meta.learner.clone();
        let mut store = Store::create(&directory.join(SESSION_FILE), meta, &initial)?;
        store.record_event("created", demonstration.file())?;
        let search = problem.search(&config);
        Ok(Learner { config, problem, search, store, trials: Vec::new(), pending: None })
    }

    /// Continues the session in `directory` as if it had never stopped: the stored trials are told
    /// again, and every stored proposal must come out bit for bit. Only `rollouts` may differ from
    /// the configuration the session was started with, and the demonstration must be its own.
    pub fn resume(
        directory: &Path,
        task: &str,
        config: &LearnerConfig,
        demonstration: &Demonstration,
    ) -> Result<Self, LearnerError> {
        config.validate()?;
        let store = Store::open(&directory.join(SESSION_FILE))?;
        store.expect_task(task)?;
        config.check_resumes(&store.meta().learner)?;
        let problem = Problem::around(&store.initial_policy()?, config, demonstration)?;
        let trials = store.trials()?;
        let search = replay(config, &problem, &trials)?;
        let config = config.clone();
        let mut learner = Learner { config, problem, search, store, trials, pending: None };
        if let Some(stored) = learner.store.pending_proposal()? {
            learner.pending = Some(learner.reproduce(&stored)?);
        }
        let text = format!("after {} trials", learner.trials.len());
        learner.store.record_event("resumed", &text)?;
        Ok(learner)
    }

    /// The policy to publish next, durable and sealed. Asking again before the rollout is completed
    /// returns the same one.
    pub fn next_policy(&mut self) -> Result<PolicyMsg, LearnerError> {
        if let Some((_, policy)) = &self.pending {
            return Ok(*policy);
        }
        let (proposal, policy) = self.propose();
        self.store.put_proposal(&proposal, &policy)?;
        self.pending = Some((proposal, policy));
        Ok(policy)
    }

    /// Takes the episode of `policy`, the one [`Learner::next_policy`] returned: checks that it
    /// executed just that, rewards it, stores it and tells the search.
    pub fn complete(
        &mut self,
        policy: &PolicyMsg,
        header: &EpisodeHeader,
        records: &[TickRecord],
    ) -> Result<TrialReport, CompleteError> {
        let proposal = self.matching_proposal(policy, header)?;
        let records = header.validate(records)?;
        if let Some(reason) = not_executed(header.fault) {
            return Err(CompleteError::NotExecuted { rollout: header.rollout, reason });
        }
        let trial = TrialRecord {
            rollout: header.rollout,
            theta: proposal.theta.clone(),
            reward: self.config.reward.reward(&header.outcome),
            policy_id: header.policy_id,
            policy_digest: header.policy_digest,
            boot_id: header.boot_id,
            applied_tick: header.applied_tick,
            fault: header.fault,
            n_records: header.n_records,
            outcome: header.outcome,
        };
        self.search.tell(&trial.trial());
        let snapshot = self.search.snapshot(trial.rollout + 1);
        if let Err(error) = self.store.record_trial(&trial, &snapshot, &decimate(records)) {
            // What is not durable was not learnt.
            self.search = replay(&self.config, &self.problem, &self.trials)
                .expect("these trials were reproduced before");
            return Err(CompleteError::Learner(error.into()));
        }
        self.pending = None;
        let report = TrialReport {
            rollout: trial.rollout,
            reward: trial.reward,
            success: trial.success(),
            fault: trial.fault,
            outcome: trial.outcome,
        };
        self.trials.push(trial);
        Ok(report)
    }

    /// The mean of the search as a policy of no rollout, stored under `MEAN_POLICY_ID` + trials.
    pub fn mean_policy(&mut self) -> Result<PolicyMsg, LearnerError> {
        let policy_id = MEAN_POLICY_ID + self.trials.len() as u64;
        let policy = self.problem.map.decode(self.search.mean(), self.ids(0, policy_id));
        if self.store.policy(policy_id)?.is_none() {
            self.store.put_policy(PolicyKind::Mean, &policy)?;
        }
        Ok(policy)
    }

    /// All rollouts of the configuration are stored.
    pub fn is_done(&self) -> bool {
        self.trials.len() as u64 >= self.config.rollouts
    }

    /// Every rollout up to this one is durable and may be acknowledged.
    pub fn durable_rollout(&self) -> u64 {
        self.trials.len() as u64
    }

    pub fn session_id(&self) -> u64 {
        self.store.meta().session_id
    }

    pub fn summary(&self) -> Summary {
        Summary::of(&self.trials)
    }

    pub fn trials(&self) -> &[TrialRecord] {
        &self.trials
    }

    pub fn store(&self) -> &Store {
        &self.store
    }

    fn ids(&self, rollout: u64, policy_id: u64) -> PolicyIds {
        PolicyIds { session: self.session_id(), rollout, policy_id }
    }

    fn propose(&self) -> (Proposal, PolicyMsg) {
        let rollout = self.trials.len() as u64 + 1;
        let proposal = self.search.ask(rollout);
        let policy = self.problem.map.decode(&proposal.theta, self.ids(rollout, rollout));
        (proposal, policy)
    }

    /// The pending proposal again, and that it is what was stored before it was published.
    fn reproduce(&self, stored: &Proposal) -> Result<(Proposal, PolicyMsg), LearnerError> {
        let (proposal, policy) = self.propose();
        let same = proposal.rollout == stored.rollout
            && same_bits(&proposal.theta, &stored.theta)
            && self.store.policy(policy.policy_id)? == Some(policy);
        if same {
            Ok((proposal, policy))
        } else {
            Err(LearnerError::NotReproduced { rollout: stored.rollout })
        }
    }

    /// The pending proposal, if `policy` is it and the episode echoes it.
    fn matching_proposal(
        &self,
        policy: &PolicyMsg,
        header: &EpisodeHeader,
    ) -> Result<&Proposal, CompleteError> {
        let (rollout, expected) = (header.rollout, self.session_id());
        if header.session != expected {
            return Err(CompleteError::ForeignSession { found: header.session, expected });
        }
        if (1..=self.durable_rollout()).contains(&rollout) {
            return Err(CompleteError::Duplicate { rollout });
        }
        let Some((proposal, pending)) =
            self.pending.as_ref().filter(|(_, pending)| pending.rollout == rollout)
        else {
            return Err(CompleteError::NotAsked { rollout });
        };
        let echo = (header.policy_id, header.policy_digest);
        if pending != policy || echo != (policy.policy_id, policy.digest) {
            return Err(CompleteError::OtherPolicy { rollout });
        }
        Ok(proposal)
    }
}

/// Why an episode with this fault is no trial: the policy was never tried. Faults during the
/// rollout are the policy's doing and are rewarded like anything else it does.
fn not_executed(fault: u64) -> Option<&'static str> {
    match fault {
        FAULT_POLICY_REFUSED => Some("it refused the policy; its log names the reason"),
        FAULT_APPROACH_TIMEOUT => Some("the arm did not reach the start posture in time"),
        _ => None,
    }
}

/// The search after `trials`, each of which it must have proposed itself.
fn replay(
    config: &LearnerConfig,
    problem: &Problem,
    trials: &[TrialRecord],
) -> Result<Box<dyn Search>, LearnerError> {
    let mut search = problem.search(config);
    for (trial, rollout) in trials.iter().zip(1..) {
        if trial.rollout != rollout || !same_bits(&search.ask(rollout).theta, &trial.theta) {
            return Err(LearnerError::NotReproduced { rollout });
        }
        search.tell(&trial.trial());
    }
    Ok(search)
}

fn same_bits(a: &DVector<f64>, b: &DVector<f64>) -> bool {
    a.len() == b.len() && a.iter().zip(b.iter()).all(|(x, y)| x.to_bits() == y.to_bits())
}
