//! A session file that something damaged: single values, or bytes of the file.
#![no_main]

use std::fs;
use std::sync::LazyLock;

use learner::Learner;
use learner::learner::SESSION_FILE;
use learner::replay::Replayed;
use learner::store::Store;
use libfuzzer_sys::fuzz_target;
use rusqlite::Connection;
use rusqlite::types::Value;
use skillet_fuzz::{action_session, folder, judge, session, split};
use tempfile::TempDir;

/// Tables with their columns; damage names one by its place.
const COLUMNS: [(&str, &[&str]); 6] = [
    ("meta", &["key", "value"]),
    ("policies", &["policy_id", "kind", "rollout", "digest", "message"]),
    ("proposals", &["rollout", "theta"]),
    (
        "trials",
        &[
            "rollout",
            "theta",
            "reward",
            "set_aside",
            "policy_digest",
            "boot_id",
            "fault",
            "n_records",
            "success",
            "path",
        ],
    ),
    ("measures", &["rollout", "name", "value"]),
    ("searches", &["rollout", "mean", "std", "floor"]),
];

static FOLDER: LazyLock<TempDir> = LazyLock::new(folder);
static SOUND: LazyLock<Vec<u8>> = LazyLock::new(sound);

/// A session of four trials with a fifth proposal pending.
fn sound() -> Vec<u8> {
    let folder = folder();
    let mut learner = session(folder.path(), action_session(), &[0.5, 0.1, 0.9, 0.4]);
    learner.next_policy().expect("there is space");
    drop(learner);
    fs::read(folder.path().join(SESSION_FILE)).expect("it was written")
}

fn damage_values(changes: &[u8]) {
    let connection = Connection::open(FOLDER.path().join(SESSION_FILE)).expect("it is sound");
    let _ = connection.execute_batch(
        "PRAGMA synchronous = OFF; PRAGMA foreign_keys = OFF; PRAGMA ignore_check_constraints = ON",
    );
    for change in changes.split(|byte| *byte == b'|').filter(|change| change.len() > 3) {
        let (table, columns) = COLUMNS[usize::from(change[0]) % COLUMNS.len()];
        let column = columns[usize::from(change[1]) % columns.len()];
        let row = i64::from(change[2] % 16);
        let (kind, rest) = split(&change[3..]);
        let word: [u8; 8] = std::array::from_fn(|i| rest.get(i).copied().unwrap_or(0));
        let value = match kind % 5 {
            0 => Value::Null,
            1 => Value::Integer(i64::from_le_bytes(word)),
            2 => Value::Real(f64::from_le_bytes(word)),
            3 => Value::Text(String::from_utf8_lossy(rest).into_owned()),
            _ => Value::Blob(rest.to_vec()),
        };
        // What the table does not take, it does not hold.
        let sql = format!("UPDATE {table} SET {column} = ?1 WHERE rowid = ?2");
        let _ = connection.execute(&sql, (value, row));
    }
}

fuzz_target!(|data: &[u8]| {
    let (mode, rest) = split(data);
    let path = FOLDER.path().join(SESSION_FILE);
    for leftover in ["session.db-wal", "session.db-shm"] {
        let _ = fs::remove_file(FOLDER.path().join(leftover));
    }
    let mut bytes = SOUND.clone();
    if mode & 1 == 0 {
        for change in rest.chunks_exact(4) {
            let at = usize::from(u16::from_le_bytes([change[0], change[1]])) * 2;
            let len = bytes.len();
            bytes[at % len] = change[2];
            bytes[(at + 1) % len] = change[3];
        }
    }
    fs::write(&path, bytes).expect("there is space");
    if mode & 1 == 1 {
        damage_values(rest);
    }
    if let Ok(store) = Store::open(&path) {
        let _ = (store.trials(), store.searches(), store.events(), store.in_flight());
        let _ = (store.mode_reports(), store.has_current_modes());
        let _ = (store.trial_count(), store.durable_rollout(), store.initial_policy());
        for id in 0..4 {
            let _ = (store.path(id), store.policy(id));
        }
        if let Ok(Replayed { search, .. }) = Replayed::of(&store, &[], None, &mut |_| {}) {
            let _ = search.modes();
        }
    }
    if let Ok(mut learner) =
        Learner::resume(FOLDER.path(), "landscape", &action_session(), &[], judge())
    {
        let _ = learner.next_policy();
        let _ = (learner.modes(), learner.summary());
    }
});
