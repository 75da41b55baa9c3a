//! Whatever happens to one of the two files, the session is what it was.

use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tempfile::TempDir;

use super::super::tests::{asked, policy, record, rows, session, store_trial};
use super::*;

const TRIALS: u64 = 12;

/// A session of [`TRIALS`] trials and a pending proposal, closed.
fn stored(directory: &TempDir) -> PathBuf {
    let (path, mut store) = session(directory);
    for rollout in 1..=TRIALS {
        store.put_proposal(&asked(rollout), &policy(rollout)).unwrap();
        store_trial(&mut store, rollout, None).unwrap();
    }
    store.put_proposal(&asked(TRIALS + 1), &policy(TRIALS + 1)).unwrap();
    path
}

/// Goes on with the session, which must hold everything.
fn expect_all(path: &Path, what: &str) -> Store {
    let store = Store::resume(path).unwrap_or_else(|error| panic!("{what}: {error}"));
    let expected: Vec<_> = (1..=TRIALS).map(record).collect();
    assert_eq!(store.trials().unwrap(), expected, "{what}");
    assert_eq!(store.path(TRIALS).unwrap(), Some(rows()), "{what}");
    assert_eq!(store.in_flight().unwrap(), [asked(TRIALS + 1)], "{what}");
    assert_eq!(store.policy(TRIALS + 1).unwrap(), Some(policy(TRIALS + 1)), "{what}");
    store
}

fn is_restored(store: &Store) -> bool {
    store.events().unwrap().iter().any(|event| event.kind == "restored")
}

/// Changes up to 64 bytes at a random place.
fn damage(path: &Path, rng: &mut ChaCha8Rng) -> usize {
    let mut bytes = fs::read(path).unwrap();
    let at = rng.random_range(0..bytes.len());
    let end = bytes.len().min(at + rng.random_range(1..=64));
    let before = bytes[at..end].to_vec();
    rng.fill_bytes(&mut bytes[at..end]);
    // The same bytes would be no damage.
    bytes[at] = !before[0];
    fs::write(path, bytes).unwrap();
    at
}

#[test]
fn damage_at_random_places_of_either_file_loses_nothing() {
    let directory = TempDir::new().unwrap();
    let path = stored(&directory);
    let sound = fs::read(&path).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut restored = 0;
    for round in 0..100 {
        fs::write(&path, &sound).unwrap();
        fs::write(copy_path(&path), &sound).unwrap();
        let target = if round % 2 == 0 { path.clone() } else { copy_path(&path) };
        let at = damage(&target, &mut rng);
        let store = expect_all(&path, &format!("round {round}: {} at byte {at}", target.display()));
        restored += usize::from(is_restored(&store));
        drop(store);
        assert!(Store::open(&path).is_ok() && Store::open(&copy_path(&path)).is_ok(), "both whole");
    }
    // Most bytes of a small session are unused: damage there needs no restoring.
    assert!(restored >= 10, "{restored} of 50");
}

#[test]
fn what_is_cut_off_gone_or_behind_comes_back() {
    let directory = TempDir::new().unwrap();
    let path = stored(&directory);
    let sound = fs::read(&path).unwrap();
    for len in [0, 1, 100, 4096, sound.len() / 2, sound.len() - 1] {
        fs::write(&path, &sound[..len]).unwrap();
        drop(expect_all(&path, &format!("cut at {len}")));
    }
    fs::remove_file(&path).unwrap();
    assert!(Store::exists(&path));
    drop(expect_all(&path, "gone"));
    fs::remove_file(copy_path(&path)).unwrap();
    drop(expect_all(&path, "copy gone"));
    assert!(copy_path(&path).exists());

    // A log of changes that was cut off: SQLite goes on without what it held, and says nothing.
    let younger = TempDir::new().unwrap();
    let (behind, store) = session(&younger);
    drop(store);
    fs::copy(&behind, &path).unwrap();
    assert!(is_restored(&expect_all(&path, "behind")));
}

#[test]
fn two_damaged_files_are_refused_and_left_as_they_are() {
    let directory = TempDir::new().unwrap();
    let path = stored(&directory);
    for file in [&path, &copy_path(&path)] {
        let mut bytes = fs::read(file).unwrap();
        bytes[4096..8192].fill(7);
        fs::write(file, bytes).unwrap();
    }
    let before = fs::read(&path).unwrap();
    let message = Store::resume(&path).err().unwrap().to_string();
    assert!(message.contains("corrupted") && message.contains("session.db"), "{message}");
    assert_eq!(fs::read(&path).unwrap(), before);
}

#[test]
fn a_value_that_was_changed_behind_sqlites_back_is_noticed() {
    let directory = TempDir::new().unwrap();
    let path = stored(&directory);
    let tool = Connection::open(&path).unwrap();
    tool.execute("UPDATE trials SET reward = 9.0 WHERE rollout = 3", []).unwrap();
    drop(tool);
    let message = Store::open(&path).err().unwrap().to_string();
    assert!(message.contains("1 rows of `trials`"), "{message}");
    assert!(is_restored(&expect_all(&path, "changed")));
}

#[test]
fn a_copy_that_cannot_be_written_is_made_anew_later() {
    let directory = TempDir::new().unwrap();
    let (path, mut store) = session(&directory);
    let copy = store.copy.as_mut().unwrap();
    copy.connection.as_ref().unwrap().execute_batch("DROP TABLE events").unwrap();
    store.record_event("first", "only in the session").unwrap();
    assert!(store.copy.as_ref().unwrap().connection.is_none(), "it lags");
    store.record_event("second", "in both again").unwrap();
    let copied = Store::open(&copy_path(&path)).unwrap().events().unwrap();
    assert_eq!(copied, store.events().unwrap());
}

#[test]
fn only_the_session_waits_for_the_disk() {
    let directory = TempDir::new().unwrap();
    let path = stored(&directory);
    let synchronous = |connection: &Connection| -> i64 {
        connection.pragma_query_value(None, "synchronous", |row| row.get(0)).unwrap()
    };
    // A copy that is taken up, and one that is made anew.
    for _ in 0..2 {
        let store = Store::resume(&path).unwrap();
        let copy = store.copy.as_ref().unwrap().connection.as_ref().unwrap();
        assert_eq!((synchronous(&store.connection), synchronous(copy)), (2, 1));
        drop(store);
        fs::remove_file(copy_path(&path)).unwrap();
    }
}

/// As a power cut may leave it.
#[test]
fn a_copy_that_is_behind_catches_up() {
    let directory = TempDir::new().unwrap();
    let path = stored(&directory);
    let younger = TempDir::new().unwrap();
    let (behind, store) = session(&younger);
    drop(store);
    fs::copy(&behind, copy_path(&path)).unwrap();
    assert!(!is_restored(&expect_all(&path, "a copy behind")));
    fs::remove_file(&path).unwrap();
    assert!(is_restored(&expect_all(&path, "from the copy")));
}
