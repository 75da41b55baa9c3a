//! Rewards below zero: stored as they are, learnt from, mapped, or refused with what to set.

mod common;

use std::path::Path;

use common::{episode, meta, value_judge as judge};
use learner::config::LearnerConfig;
use learner::reward::RewardKind;
use learner::{CompleteError, Learner, LearnerError};
use search::{Method, RewardMap, SearchConfig};
use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::policy::PolicyMsg;
use tempfile::TempDir;

const SESSION: u64 = 0xfeed_0000_0000_0001;

/// A session of a world without arm, judged by what the world measures.
fn action_session(directory: &Path, search: SearchConfig) -> Learner {
    let mut config = LearnerConfig { search, ..Default::default() };
    config.action.start = vec![1.0, 2.0];
    config.reward.kind = RewardKind::Value;
    let meta = meta("landscape", SESSION, config);
    Learner::create(directory, meta, &[], judge()).expect("a new session")
}

/// Tells the pending rollout a value that is always negative.
fn complete_with_a_cost(learner: &mut Learner) -> Result<f64, CompleteError> {
    let policy = learner.next_policy().expect("the disk has space");
    let (header, records) = execute_action(&policy);
    learner.complete("", &header, &records).map(|report| report.reward)
}

fn execute_action(policy: &PolicyMsg) -> (EpisodeHeader, Vec<TickRecord>) {
    let [x, y] = [policy.action[0], policy.action[1]];
    let value = -1.0 - x * x - y * y;
    episode(policy, value)
}

#[test]
fn negative_rewards_are_stored_and_learnt_from() {
    let directory = TempDir::new().unwrap();
    let power = SearchConfig { method: Method::Power, ..Default::default() };
    let mut learner = action_session(directory.path(), power);
    let rewards: Vec<f64> = (0..80).map(|_| complete_with_a_cost(&mut learner).unwrap()).collect();
    assert!(rewards.iter().all(|reward| *reward <= -1.0));
    let late = rewards[60..].iter().sum::<f64>() / 20.0;
    assert!(late > 0.5 * rewards[0], "{late} from {}", rewards[0]);
    assert_eq!(learner.summary().best_reward, rewards.iter().copied().fold(f64::MIN, f64::max));
    let config = learner.store().meta().learner.clone();
    drop(learner);
    let mut again = Learner::resume(directory.path(), "landscape", &config, &[], judge()).unwrap();
    assert_eq!(again.trials().iter().map(|trial| trial.reward).collect::<Vec<_>>(), rewards);

    again.next_policy().unwrap();
    let refused = again.refused("", 81, "a test").unwrap();
    let worst = rewards.iter().copied().fold(0.0, f64::min);
    assert_eq!(refused.reward, worst, "a policy that was refused is no better than the worst");
    again.next_policy().unwrap();
    again.set_aside("", 82, "a test").unwrap();
    assert!(again.summary().best_reward <= -1.0, "what was set aside is not the best");
}

#[test]
fn a_reward_the_search_cannot_learn_from_ends_the_session_with_what_to_set() {
    let directory = TempDir::new().unwrap();
    let tempered = || SearchConfig { method: Method::Tempered, ..Default::default() };
    let mut learner = action_session(directory.path(), tempered());
    let error = complete_with_a_cost(&mut learner).unwrap_err();
    assert!(matches!(error, CompleteError::Learner(LearnerError::Reward(_))), "{error:?}");
    for part in ["trial 1", "tempered", "learner.search.reward_map", "--out"] {
        assert!(error.to_string().contains(part), "{part}: {error}");
    }
    assert_eq!(learner.durable_rollout(), 0);

    let mapped = SearchConfig { reward_map: RewardMap::Exp(5.0), ..tempered() };
    let directory = TempDir::new().unwrap();
    let mut learner = action_session(directory.path(), mapped);
    assert!(complete_with_a_cost(&mut learner).unwrap() <= -1.0, "the session keeps it as it is");
}
