//! A judge that takes its time, declines a rollout or breaks: what becomes of the episode, and what the diary
//! says of it.

mod common;

use std::cell::RefCell;
use std::collections::VecDeque;
use std::path::Path;

use common::{episode, meta};
use learner::config::LearnerConfig;
use learner::judge::{AssessError, Assessor, Declared, Judge};
use learner::learner::judged_by;
use learner::reward::{RewardConfig, RewardKind};
use learner::{CompleteError, Learner, LearnerError};
use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::measures::Measures;
use shm_types::policy::PolicyMsg;
use tempfile::TempDir;

/// Answers what it is told to, in turn; then 1.
struct Scripted {
    identity: &'static str,
    answers: RefCell<VecDeque<Result<f64, AssessError>>>,
}

impl Assessor for Scripted {
    fn declared(&self) -> Declared {
        vec![("gap".into(), "1".into())]
    }

    fn identity(&self) -> Option<String> {
        Some(self.identity.into())
    }

    fn assess(
        &self,
        _: &EpisodeHeader,
        _: &[TickRecord],
        measures: &Measures,
    ) -> Result<Vec<f64>, AssessError> {
        assert!(measures.get("height").is_some());
        let answer = self.answers.borrow_mut().pop_front().unwrap_or(Ok(1.0));
        answer.map(|gap| vec![gap])
    }
}

fn judge(identity: &'static str, answers: Vec<Result<f64, AssessError>>) -> Judge {
    let reward = RewardConfig { kind: RewardKind::Value, ..Default::default() };
    let scripted = Scripted { identity, answers: RefCell::new(answers.into()) };
    Judge::of_plant(&[("height", "1")], reward).with_assessor(Some(Box::new(scripted)))
}

fn config() -> LearnerConfig {
    let mut config = LearnerConfig::default();
    config.action.start = vec![1.0, 2.0];
    config.reward.kind = RewardKind::Value;
    config
}

fn session(directory: &Path, answers: Vec<Result<f64, AssessError>>) -> Learner {
    let meta = meta("landscape", 7, config());
    Learner::create(directory, meta, &[], judge("a", answers)).expect("a new session")
}

fn execute(policy: &PolicyMsg) -> (EpisodeHeader, Vec<TickRecord>) {
    episode(policy, policy.action[0])
}

#[test]
fn an_episode_is_handed_in_until_its_judge_has_answered() {
    let directory = TempDir::new().unwrap();
    let not_yet = || Err(AssessError::NotYet);
    let mut learner = session(directory.path(), vec![not_yet(), not_yet(), Ok(0.25)]);
    let policy = learner.next_policy().unwrap();
    let (header, records) = execute(&policy);
    for _ in 0..2 {
        let error = learner.complete("", &header, &records).unwrap_err();
        assert!(matches!(error, CompleteError::BeingJudged { rollout: 1 }), "{error:?}");
        assert_eq!(learner.durable_rollout(), 0);
    }
    let report = learner.complete("", &header, &records).unwrap();
    assert_eq!((report.rollout, report.measures.get("gap")), (1, Some(0.25)));
    assert_eq!(learner.trials()[0].measures.declared(), learner.store().meta().measures);
}

#[test]
fn a_broken_judge_loses_nothing_and_a_full_disk_is_waited_for() {
    let directory = TempDir::new().unwrap();
    let broken = Err(AssessError::Broken("it is broken".into()));
    let refused =
        Err(AssessError::NotWritten { path: "rollout.npy".into(), detail: "no space".into() });
    let mut learner = session(directory.path(), vec![broken, refused]);
    let policy = learner.next_policy().unwrap();
    let (header, records) = execute(&policy);
    let error = learner.complete("", &header, &records).unwrap_err();
    assert!(matches!(error, CompleteError::Learner(LearnerError::Judge(_))), "{error:?}");
    assert_eq!(error.to_string(), "it is broken");
    match learner.complete("", &header, &records).unwrap_err() {
        CompleteError::Learner(LearnerError::Store(error)) => {
            assert!(error.may_pass() && error.to_string().contains("rollout.npy"), "{error}");
        }
        other => panic!("{other:?}"),
    }
    assert_eq!((learner.durable_rollout(), learner.next_policy().unwrap()), (0, policy));
    learner.complete("", &header, &records).expect("the same episode, judged at last");
}

#[test]
fn a_rollout_that_is_declined_is_set_aside_and_the_diary_knows_every_judge() {
    let directory = TempDir::new().unwrap();
    let declined = Err(AssessError::Declined("the camera was covered".into()));
    let mut learner = session(directory.path(), vec![Ok(0.5), declined]);
    for rollout in 1..=3 {
        let policy = learner.next_policy().unwrap();
        let (header, records) = execute(&policy);
        match learner.complete("", &header, &records) {
            Err(CompleteError::NotJudged { rollout: 2, error }) => {
                let report = learner.not_judged("", &header, &records, &error).unwrap();
                assert!(report.set_aside && report.measures.is_empty());
            }
            completed => assert_eq!(completed.unwrap().rollout, rollout),
        }
    }
    drop(learner);
    let resume = |identity| {
        let judge = judge(identity, Vec::new());
        Learner::resume(directory.path(), "landscape", &config(), &[], judge).unwrap()
    };
    assert_eq!(judged_by(resume("a").store()).unwrap().as_deref(), Some("a"));
    let learner = resume("b: another one");
    assert_eq!(judged_by(learner.store()).unwrap().as_deref(), Some("b: another one"));
    let events = learner.store().events().unwrap();
    let judges = events.iter().filter(|event| event.kind == "judge");
    let judges: Vec<&str> = judges.map(|event| event.text.as_str()).collect();
    assert_eq!(judges, ["from rollout 1 on: a", "from rollout 4 on: b: another one"]);
    assert!(events.iter().any(|event| event.text == "rollout 2: the camera was covered"));
}
