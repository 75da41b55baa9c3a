//! What the targets share: messages that are nearly right, the parts of a cell, folders in memory.

use std::path::Path;

use learner::Learner;
use learner::config::LearnerConfig;
use learner::judge::Judge;
use learner::reward::RewardKind;
use learner::store::SessionMeta;
use physics::arm::ArmModel;
use search::Method;
use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::measures::{Measure, Measures};
use shm_types::policy::{ACTIVATION_STATE, OUTPUT_VELOCITY, PolicyMsg, packed_index};
use tempfile::TempDir;
use zerocopy::{FromBytes, Immutable, IntoBytes};

/// Numbers that a bound may have forgotten.
const SPECIAL: [f64; 16] = [
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    0.0,
    -0.0,
    5e-324,
    f64::MIN_POSITIVE,
    f64::MAX,
    -f64::MAX,
    f64::EPSILON,
    1e-3,
    1.0,
    -1.0,
    100.0,
    5e4,
    1e6,
];

/// Every message as bytes: the fuzzer rarely finds one that is right as a whole, so its input is a
/// list of changes to `base`, each offset (2 bytes), kind (1 byte) and word (8 bytes).
pub fn patched<T: FromBytes + IntoBytes + Immutable>(base: &T, changes: &[u8]) -> T {
    let mut bytes = base.as_bytes().to_vec();
    for change in changes.chunks_exact(11) {
        let at = usize::from(u16::from_le_bytes([change[0], change[1]])) * 4 % (bytes.len() - 7);
        let at = at - at % 4;
        let word = match SPECIAL.get(usize::from(change[2])) {
            Some(special) => special.to_le_bytes(),
            None => change[3..11].try_into().expect("8 bytes"),
        };
        bytes[at..at + 8].copy_from_slice(&word);
    }
    T::read_from_bytes(&bytes).expect("as many bytes as before")
}

/// The first byte says how the rest is to be read.
pub fn split(data: &[u8]) -> (u8, &[u8]) {
    data.split_first().map_or((0, data), |(first, rest)| (*first, rest))
}

pub const WAM7_URDF: &str = include_str!("../../robots/wam7/wam7_pan.urdf");

pub fn wam() -> ArmModel {
    ArmModel::from_urdf(WAM7_URDF, "pan").expect("the project's own")
}

/// The judge of a session of actions.
pub fn judge() -> Judge {
    Judge::of_plant(&[("height", "1")], action_session().reward)
}

/// What its world measured.
pub fn measured(value: f64) -> Measures {
    Measures::of([Measure { name: "height", unit: "1", value }]).expect("it is fit to be told")
}

/// Three soft springs around the start posture's pan: admitted.
pub fn springs() -> PolicyMsg {
    let mut policy = PolicyMsg { task_dim: 4, n_components: 3, ..PolicyMsg::EMPTY };
    policy.duration_s = 0.1;
    policy.damping = 28.0;
    policy.orientation_stiffness = 400.0;
    policy.orientation_damping = 40.0;
    for (i, component) in policy.components.iter_mut().take(3).enumerate() {
        component.center = 0.05 * i as f64;
        component.width = 0.03;
        component.attractor = [0.78, 0.0, 0.7, 0.1, 0.0, 0.0];
        (0..4).for_each(|row| component.stiffness[packed_index(row, row)] = 200.0);
    }
    policy.sealed()
}

/// Three systems of the state that lead to a target beside the start posture's pan: admitted.
pub fn field() -> PolicyMsg {
    let mut policy = PolicyMsg { task_dim: 6, n_systems: 3, ..PolicyMsg::EMPTY };
    (policy.activation, policy.output, policy.following) =
        (ACTIVATION_STATE, OUTPUT_VELOCITY, 50.0);
    policy.duration_s = 0.1;
    policy.orientation_stiffness = 400.0;
    policy.orientation_damping = 40.0;
    policy.target = [0.76, 0.02, 0.74, 0.1, 0.0, 0.0];
    (0..6).for_each(|i| policy.certificate[packed_index(i, i)] = 1.0);
    for (k, system) in policy.systems.iter_mut().take(3).enumerate() {
        system.center = [0.78, 0.01 * k as f64, 0.72, 0.0, 0.0, 0.0];
        for i in 0..6 {
            let rate = 2.0 + k as f64;
            system.covariance[packed_index(i, i)] = 0.01;
            system.of_position[7 * i] = -rate;
            system.offset[i] = rate * policy.target[i];
        }
    }
    policy.sealed()
}

/// A session of a world without arm: cheap to create and to resume.
pub fn action_session() -> LearnerConfig {
    let mut config = LearnerConfig { rollouts: 1000, ..LearnerConfig::default() };
    config.action.start = vec![8.0, 2.0];
    config.search.method = Method::Tempered;
    config.reward.kind = RewardKind::Value;
    config
}

/// A session of `config` in `folder`, with a trial for each of `values`.
pub fn session(folder: &Path, config: LearnerConfig, values: &[f64]) -> Learner {
    let meta = SessionMeta {
        task: "landscape".into(),
        session_id: 7,
        config_toml: String::new(),
        measures: Vec::new(),
        learner: config,
    };
    let mut learner = Learner::create(folder, meta, &[], judge()).expect("a new session");
    for value in values {
        let policy = learner.next_policy().expect("there is space");
        let header = echo(&policy, 12, *value);
        learner.complete("", &header, &[TickRecord::ZERO; 12]).expect("asked for");
    }
    learner
}

/// The header of an episode of `policy`, in whose world `value` was measured.
pub fn echo(policy: &PolicyMsg, n_records: u64, value: f64) -> EpisodeHeader {
    EpisodeHeader {
        session: policy.session,
        rollout: policy.rollout,
        policy_id: policy.policy_id,
        policy_digest: policy.digest,
        n_records,
        measures: measured(value),
        ..Default::default()
    }
}

/// In memory, where there is such a place: the disk is not under test.
pub fn folder() -> TempDir {
    let builder = |place: &str| tempfile::Builder::new().prefix("sk-fuzz").tempdir_in(place);
    builder("/dev/shm").or_else(|_| TempDir::new()).expect("a folder")
}
