//! Sessions as formats 3 to 7 wrote them, opened.

use rusqlite::{Connection, OpenFlags};
use shm_types::policy::PolicyMsg;
use shm_types::policy_json;
use tempfile::TempDir;

use super::super::rows::{blob, hex, signed};
use super::super::tests::{policy, proposal};
use super::super::{APPLICATION_ID, Store, connect};
use super::*;

/// Columns of the pancake's measures with what stands in them, in order of the table.
const VALUES: &str =
    "0.25, 0.1, 3.0, 5.0, 0.5, 1.2, 2.75, 0.125, 0.0625, 0.03125, -5.0, 0.015, 0.2";

/// A session of `task` with an executed trial, one that was set aside, one that was refused.
fn session(directory: &TempDir, task: &str) -> PathBuf {
    let path = directory.path().join("session.db");
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_CREATE;
    let connection = connect(&path, flags).unwrap();
    connection.execute_batch(include_str!("format-3.sql")).unwrap();
    let learner = serde_json::to_string(&crate::LearnerConfig::default()).unwrap();
    for (key, value) in [
        ("task", task),
        ("session_id", &hex(7)),
        ("config_toml", ""),
        ("learner", &learner),
        ("durable_rollout", "3"),
    ] {
        connection.execute("INSERT INTO meta (key, value) VALUES (?1, ?2)", [key, value]).unwrap();
    }
    for id in 0..=3 {
        let kind = if id == 0 { "initial" } else { "trial" };
        let PolicyMsg { rollout, digest, .. } = policy(id);
        let text = policy_json::to_json(&policy(id)).unwrap();
        let query = "INSERT INTO policies (policy_id, kind, rollout, digest, message) VALUES (?1, ?2, ?3, ?4, ?5)";
        let row = params![signed(id), kind, signed(rollout), hex(digest), text];
        connection.execute(query, row).unwrap();
    }
    for (rollout, set_aside, fault) in [(1, 0, 2), (2, 1, 0), (3, 0, FAULT_POLICY_REFUSED)] {
        let theta = blob(&proposal(rollout).theta);
        let query = "INSERT INTO proposals (rollout, theta) VALUES (?1, ?2)";
        connection.execute(query, params![signed(rollout), theta]).unwrap();
        let query = format!(
            "INSERT INTO trials (rollout, theta, reward, success, set_aside, policy_id, policy_digest, \
             boot_id, applied_tick, fault, n_records, outcome_flags, value, release_time_s, \
             release_speed_m_s, release_spin_rad_s, apex_m, crossing_time_s, flip_angle_rad, distance_m, \
             lateral_m, final_lateral_m, release_pitch_rate_rad_s, bounce_s, clipped_share, path) \
             VALUES (?1, ?2, 1.5, 1, ?3, ?1, ?4, ?4, 9, ?5, 25, 3, {VALUES}, x'')"
        );
        let row = params![signed(rollout), theta, set_aside, hex(5), signed(fault)];
        connection.execute(&query, row).unwrap();
    }
    for table in ["meta", "policies", "proposals", "trials"] {
        let columns = "SELECT group_concat(name) FROM pragma_table_info(?1) WHERE name <> 'seal'";
        let columns: String = connection.query_row(columns, [table], |row| row.get(0)).unwrap();
        connection
            .execute(&format!("UPDATE {table} SET seal = row_digest({columns})"), [])
            .unwrap();
    }
    connection.pragma_update(None, "user_version", FORMAT).unwrap();
    connection.pragma_update(None, "application_id", APPLICATION_ID).unwrap();
    path
}

fn format(path: &Path) -> i64 {
    let connection = Connection::open(path).unwrap();
    connection.pragma_query_value(None, "user_version", |row| row.get(0)).unwrap()
}

#[test]
fn a_session_of_format_3_is_converted_when_it_is_opened_and_kept_as_it_was() {
    let directory = TempDir::new().unwrap();
    let path = session(&directory, "pancake");
    let store = Store::open(&path).unwrap();
    assert_eq!(store.meta().measures.len(), 16);
    let trials = store.trials().unwrap();
    let first = &trials[0];
    assert!(first.success && first.reward == 1.5 && first.n_records == 25 && first.fault == 2);
    for (name, value) in [
        ("tossed", 1.0),
        ("caught", 1.0),
        ("dropped", 0.0),
        ("release_time_s", 0.1),
        ("apex_m", 0.5),
        ("flip_angle_rad", 2.75),
        ("final_lateral_m", 0.03125),
        ("release_pitch_rate_rad_s", -5.0),
        ("clipped_share", 0.2),
    ] {
        assert_eq!(first.measures.get(name), Some(value), "{name}");
    }
    // Nothing was executed, so nothing was measured.
    assert!(trials[1].set_aside && trials[1].measures.is_empty() && trials[2].measures.is_empty());
    assert_eq!(store.policy(2).unwrap(), Some(PolicyMsg { session: 7, ..policy(2) }));
    let events = store.events().unwrap();
    assert!(events.iter().any(|event| event.kind == "converted"), "{events:?}");
    drop(store);

    assert_eq!((format(&path), format(&kept_path(&path))), (FORMAT_VERSION, FORMAT));
    assert_eq!(Store::resume(&path).unwrap().trials().unwrap(), trials, "and it goes on");
}

#[test]
fn a_world_without_an_arm_keeps_its_number_under_its_name() {
    for (task, name) in [("landscape", "height"), ("skittles", "distance_m")] {
        let directory = TempDir::new().unwrap();
        let store = Store::open(&session(&directory, task)).unwrap();
        let first = &store.trials().unwrap()[0];
        assert_eq!((first.measures.len(), first.measures.get(name)), (1, Some(0.25)));
    }
}

#[test]
fn a_session_of_a_later_format_gets_the_tables_that_it_lacks() {
    let directory = TempDir::new().unwrap();
    let path = session(&directory, "pancake");
    let trials = Store::open(&path).unwrap().trials().unwrap();
    for (before, lacks) in [
        (4, "wishes, ratings, demonstrations, asked, told, given, cells"),
        (5, "ratings, demonstrations, asked, told, given, cells"),
        (6, "asked, told, given, cells"),
        (7, "given, cells"),
    ] {
        let connection = Connection::open(&path).unwrap();
        for name in lacks.split(", ") {
            connection.execute_batch(&format!("DROP TABLE {name}")).unwrap();
        }
        connection.pragma_update(None, "user_version", before).unwrap();
        drop(connection);
        let store = Store::open(&path).unwrap();
        assert_eq!(format(&path), FORMAT_VERSION);
        let history = store.history().unwrap();
        assert!(history.wishes.last().is_none() && history.ratings.all().is_empty());
        assert!(store.added().unwrap().is_empty() && store.cells().unwrap().is_empty());
        assert_eq!(store.trials().unwrap(), trials);
    }
}

#[test]
fn one_that_is_damaged_is_not_converted() {
    let directory = TempDir::new().unwrap();
    let path = session(&directory, "pancake");
    let connection = Connection::open(&path).unwrap();
    connection.execute("UPDATE trials SET apex_m = 7 WHERE rollout = 1", []).unwrap();
    drop(connection);
    let error = Store::open(&path).err().unwrap().to_string();
    assert!(error.contains("trials"), "{error}");
    assert_eq!(format(&path), FORMAT);
}
