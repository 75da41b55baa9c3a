//! What the tests of a session share: sessions without arm, and made-up controllers.

// Each test takes what it needs.
#![allow(dead_code)]

use learner::LearnerConfig;
use learner::judge::Judge;
use learner::reward::{RewardConfig, RewardKind};
use learner::store::SessionMeta;
use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::measures::{Measure, Measures};
use shm_types::policy::PolicyMsg;

/// Metadata of a session of `task`; its measures are those of its judge.
pub fn meta(task: &str, session_id: u64, learner: LearnerConfig) -> SessionMeta {
    let (config_toml, measures) = (String::new(), Vec::new());
    SessionMeta { task: task.into(), session_id, config_toml, measures, learner }
}

/// The judge of a world that measures its own value.
pub fn value_judge() -> Judge {
    let reward = RewardConfig { kind: RewardKind::Value, ..Default::default() };
    Judge::of_plant(&[("height", "1")], reward)
}

/// The episode of `policy` in such a world.
pub fn episode(policy: &PolicyMsg, value: f64) -> (EpisodeHeader, Vec<TickRecord>) {
    let header = EpisodeHeader {
        session: policy.session,
        rollout: policy.rollout,
        policy_id: policy.policy_id,
        policy_digest: policy.digest,
        n_records: 12,
        measures: Measures::of([Measure { name: "height", unit: "1", value }]).unwrap(),
        ..Default::default()
    };
    (header, vec![TickRecord::ZERO; 12])
}
