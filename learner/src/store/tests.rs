//! What is written comes back bit for bit, and every file that is not a sound session is refused
//! with a message that says what to do.

use nalgebra::DVector;
use shm_types::measures::{Measure, Measures, TRUTH};
use tempfile::TempDir;

use super::*;
use crate::config::LearnerConfig;
use crate::path::{PathRow, decimate};
use search::SearchSnapshot;
use search::trial::Proposal;

fn meta() -> SessionMeta {
    SessionMeta {
        task: "pancake".into(),
        session_id: u64::MAX - 1,
        config_toml: "[learner]\nseed = 3\n".into(),
        measures: measures().declared(),
        learner: LearnerConfig { seed: 3, kappa_p: 0.1 + 0.2 + 200.0, ..Default::default() },
    }
}

fn measures() -> Measures {
    let caught = Measure { name: "caught", unit: TRUTH, value: 1.0 };
    let lateral = Measure { name: "lateral_m", unit: "m", value: -0.1 };
    Measures::of([caught, lateral, Measure { name: "apex_m", unit: "m", value: 0.7 }]).unwrap()
}

pub(super) fn policy(policy_id: u64) -> PolicyMsg {
    let mut policy =
        PolicyMsg { n_components: 1, policy_id, rollout: policy_id, ..PolicyMsg::EMPTY };
    policy.session = meta().session_id;
    policy.components[0].attractor[0] = 1.0 / 3.0 + policy_id as f64;
    policy.sealed()
}

pub(super) fn proposal(rollout: u64) -> Proposal {
    Proposal { rollout, theta: DVector::from_vec(vec![0.1 * rollout as f64, -0.0, 1e-300]) }
}

/// Asked when all rollouts before it were told.
pub(super) fn asked(rollout: u64) -> Asked {
    let cell = "kitchen-1".to_string();
    Asked { proposal: proposal(rollout), after: rollout - 1, is_mean: false, cell }
}

pub(super) fn record(rollout: u64) -> TrialRecord {
    TrialRecord {
        rollout,
        asked_after: rollout - 1,
        told: rollout,
        cell: "kitchen-1".into(),
        theta: proposal(rollout).theta,
        reward: 1.0 / 3.0,
        success: true,
        judged_success: true,
        own_reward: 1.0 / 3.0,
        own_success: true,
        rating: None,
        unrated: false,
        policy_id: rollout,
        policy_digest: policy(rollout).digest,
        boot_id: u64::MAX,
        applied_tick: u64::MAX,
        fault: 2,
        n_records: 25,
        set_aside: false,
        is_mean: false,
        measures: measures(),
    }
}

/// What the first trial tells of its cell.
fn cell() -> CellRecord {
    let (cell, arm) = ("kitchen-1".into(), "wam7".into());
    CellRecord { cell, since: 1, arm, urdf_sha256: "ab".repeat(32), plant: "mujoco".into() }
}

pub(super) fn snapshot() -> SearchSnapshot {
    let mean = DVector::from_vec(vec![1.0, 0.1, -3.0]);
    SearchSnapshot { std: mean.map(f64::abs), mean, floor: 0.2 }
}

pub(super) fn rows() -> Vec<PathRow> {
    decimate(&[shm_types::episode::TickRecord::ZERO; 25])
}

pub(super) fn session(directory: &TempDir) -> (PathBuf, Store) {
    let path = directory.path().join("session.db");
    let store = Store::create(&path, meta(), &policy(0)).expect("an empty folder");
    (path, store)
}

/// Stores the trial `rollout`; with a note and the proposal `next`, if there is one.
pub(super) fn store_trial(
    store: &mut Store,
    rollout: u64,
    next: Option<u64>,
) -> Result<(), StoreError> {
    let (trial, path, search) = (record(rollout), rows(), snapshot());
    let next = next.map(|rollout| (asked(rollout), policy(rollout)));
    let note = Event { kind: "noted".into(), text: format!("rollout {rollout}") };
    let cell = (rollout == 1).then(cell);
    let (trial, cell, path, search) = (&trial, cell.as_ref(), &path, &search);
    let next = next.as_ref().map(|(asked, policy)| (asked, policy));
    let note = next.map(|_| &note);
    store.record_step(&Step { trial, cell, path, search, durable_rollout: rollout, next, note })
}

fn refusal(path: &Path) -> String {
    match Store::open(path) {
        Ok(_) => panic!("{path:?} must be refused"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn everything_comes_back_bit_for_bit_after_reopening() {
    let directory = TempDir::new().unwrap();
    let (path, mut store) = session(&directory);
    assert_eq!((store.trial_count().unwrap(), store.durable_rollout().unwrap()), (0, 0));
    for rollout in 1..=2 {
        store.put_proposal(&asked(rollout), &policy(rollout)).unwrap();
        assert_eq!(store.in_flight().unwrap(), [asked(rollout)]);
        store_trial(&mut store, rollout, None).unwrap();
        assert_eq!(store.in_flight().unwrap(), []);
    }
    store.record_event("created", "with seed 3").unwrap();
    drop(store);

    let store = Store::open(&path).unwrap();
    assert_eq!(store.meta(), &meta());
    assert_eq!(store.trials().unwrap(), [record(1), record(2)]);
    assert_eq!(store.cells().unwrap(), [cell()]);
    assert_eq!((store.trial_count().unwrap(), store.durable_rollout().unwrap()), (2, 2));
    assert_eq!(store.path(2).unwrap(), Some(rows()));
    assert_eq!(store.path(3).unwrap(), None);
    assert_eq!(store.policy(2).unwrap(), Some(policy(2)));
    assert_eq!(store.policy(7).unwrap(), None);
    assert_eq!(store.initial_policy().unwrap(), policy(0));
    assert_eq!(store.searches().unwrap(), [(1, snapshot()), (2, snapshot())]);
    let event = Event { kind: "created".into(), text: "with seed 3".into() };
    assert_eq!(store.events().unwrap(), [event]);
}

#[test]
fn a_failed_write_leaves_nothing_behind() {
    let directory = TempDir::new().unwrap();
    let (_, mut store) = session(&directory);
    store.put_proposal(&asked(1), &policy(1)).unwrap();
    // The second statement of the transaction fails: a search snapshot is there already.
    store.connection.execute_batch("PRAGMA foreign_keys = OFF").unwrap();
    let blocker = "INSERT INTO searches VALUES (1, 0, x'', x'', 0)";
    store.connection.execute_batch(blocker).unwrap();
    assert!(store_trial(&mut store, 1, None).is_err());
    assert_eq!((store.trial_count().unwrap(), store.durable_rollout().unwrap()), (0, 0));
    assert_eq!(store.in_flight().unwrap(), [asked(1)]);
}

#[test]
fn a_trial_its_note_and_the_next_proposal_are_stored_together_or_not_at_all() {
    let directory = TempDir::new().unwrap();
    let (path, mut store) = session(&directory);
    store.put_proposal(&asked(1), &policy(1)).unwrap();
    // The last statement fails: the proposal's policy is there already.
    store.put_policy(PolicyKind::Mode, &policy(2)).unwrap();
    assert!(store_trial(&mut store, 1, Some(2)).is_err());
    for file in [path.clone(), copy_path(&path)] {
        let there = Store::open(&file).unwrap();
        assert_eq!((there.trial_count().unwrap(), there.durable_rollout().unwrap()), (0, 0));
        assert_eq!(there.in_flight().unwrap(), [asked(1)]);
        assert_eq!((there.events().unwrap(), there.searches().unwrap()), (vec![], vec![]));
    }
    store_trial(&mut store, 1, Some(3)).unwrap();
    for file in [path.clone(), copy_path(&path)] {
        let there = Store::open(&file).unwrap();
        assert_eq!(
            (there.trials().unwrap(), there.durable_rollout().unwrap()),
            (vec![record(1)], 1)
        );
        assert_eq!(there.in_flight().unwrap(), [asked(3)]);
        assert_eq!(there.policy(3).unwrap(), Some(policy(3)));
        assert_eq!(there.events().unwrap()[0].text, "rollout 1");
    }
}

#[test]
fn a_trial_is_stored_once_and_only_for_a_proposal() {
    let directory = TempDir::new().unwrap();
    let (_, mut store) = session(&directory);
    assert!(store_trial(&mut store, 1, None).is_err());
    store.put_proposal(&asked(1), &policy(1)).unwrap();
    store_trial(&mut store, 1, None).unwrap();
    assert!(store_trial(&mut store, 1, None).is_err());
    assert_eq!(store.trial_count().unwrap(), 1);
}

#[test]
fn is_durable_and_checked() {
    let directory = TempDir::new().unwrap();
    let (path, store) = session(&directory);
    drop(store);
    let store = Store::open(&path).unwrap();
    let number = |name| -> i64 {
        store.connection.pragma_query_value(None, name, |row| row.get(0)).unwrap()
    };
    assert_eq!((number("synchronous"), number("foreign_keys")), (2, 1));
    let mode: String =
        store.connection.pragma_query_value(None, "journal_mode", |row| row.get(0)).unwrap();
    assert_eq!(mode, "wal");
}

#[test]
fn never_overwrites_and_never_invents_a_session() {
    let directory = TempDir::new().unwrap();
    let (path, store) = session(&directory);
    let error = Store::create(&path, meta(), &policy(0)).err().unwrap().to_string();
    assert!(error.contains("already exists") && error.contains("--out"), "{error}");
    drop(store);
    assert!(refusal(&directory.path().join("other.db")).contains("does not exist"));
    let nowhere = directory.path().join("no/such/folder.db");
    let error = Store::create(&nowhere, meta(), &policy(0)).err().unwrap().to_string();
    assert!(error.contains("check that its folder exists"), "{error}");
}

#[test]
fn refuses_what_is_not_a_skillet_session() {
    let directory = TempDir::new().unwrap();
    let foreign = directory.path().join("foreign.db");
    Connection::open(&foreign).unwrap().execute_batch("CREATE TABLE photos (x)").unwrap();
    let text = directory.path().join("text.db");
    std::fs::write(&text, "Dear diary, today I flipped a pancake.".repeat(100)).unwrap();
    let empty = directory.path().join("empty.db");
    std::fs::write(&empty, "").unwrap();
    for path in [foreign, text, empty] {
        let message = refusal(&path);
        assert!(message.contains("is not a Skillet session"), "{message}");
        assert!(message.contains("move it away"), "{message}");
    }
}

#[test]
fn refuses_another_format_and_another_task() {
    let directory = TempDir::new().unwrap();
    let (path, store) = session(&directory);
    assert!(store.expect_task("pancake").is_ok());
    let error = store.expect_task("skittles").unwrap_err().to_string();
    assert!(error.contains("of the task `pancake`, not `skittles`"), "{error}");
    store.connection.pragma_update(None, "user_version", 99).unwrap();
    drop(store);
    assert!(refusal(&path).contains("session format 99, this program writes 8"));
}

#[test]
fn refuses_damaged_files() {
    let directory = TempDir::new().unwrap();
    let (path, mut store) = session(&directory);
    store.put_proposal(&asked(1), &policy(1)).unwrap();
    store_trial(&mut store, 1, None).unwrap();
    let damage = |sql: &str| store.connection.execute_batch(sql).unwrap();
    damage("UPDATE trials SET theta = x'00'");
    assert!(store.trials().unwrap_err().to_string().contains("trial 1: theta"));
    damage("UPDATE trials SET path = x'00'");
    assert!(store.path(1).unwrap_err().to_string().contains("trial 1: path has 1 bytes"));
    damage("UPDATE policies SET digest = 'beef'");
    assert!(store.policy(1).unwrap_err().to_string().contains("policy 1 does not match"));
    damage("DELETE FROM policies WHERE kind = 'initial'");
    assert!(store.initial_policy().unwrap_err().to_string().contains("no initial policy"));
    drop(store);

    let sound = std::fs::read(&path).unwrap();
    let mut bytes = sound.clone();
    bytes[4096..].fill(0xa5);
    std::fs::write(&path, bytes).unwrap();
    let message = refusal(&path);
    assert!(message.contains("corrupted") && message.contains("second copy"), "{message}");
    std::fs::write(&path, &sound[..sound.len() / 2]).unwrap();
    assert!(refusal(&path).contains("corrupted"), "{}", refusal(&path));
}

#[test]
fn says_so_when_the_disk_is_full_or_read_only() {
    let directory = TempDir::new().unwrap();
    let (_, mut store) = session(&directory);
    let pages: i64 =
        store.connection.pragma_query_value(None, "page_count", |row| row.get(0)).unwrap();
    store.connection.pragma_update(None, "max_page_count", pages).unwrap();
    let error = store.record_event("long", &"x".repeat(100_000)).unwrap_err();
    assert!(matches!(error, StoreError::DiskFull { .. }), "{error}");
    assert!(store.events().unwrap().is_empty());

    store.connection.pragma_update(None, "query_only", true).unwrap();
    let error = store.record_event("a", "b").unwrap_err();
    assert!(matches!(error, StoreError::ReadOnly { .. }), "{error}");
}

#[test]
fn says_so_when_another_program_holds_the_file() {
    let directory = TempDir::new().unwrap();
    let (path, mut store) = session(&directory);
    let other = Connection::open(&path).unwrap();
    other.execute_batch("BEGIN IMMEDIATE").unwrap();
    store.connection.busy_timeout(Duration::ZERO).unwrap();
    let error = store.record_event("a", "b").unwrap_err();
    assert!(matches!(error, StoreError::Busy { .. }), "{error}");
}
