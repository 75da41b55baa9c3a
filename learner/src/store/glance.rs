//! What a session holds, in a few numbers, read without a check of its rows and without a trace in its folder.

use std::ffi::OsString;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

use rusqlite::{Connection, OpenFlags};

use super::rows::integer;
use super::{BUSY_TIMEOUT, StoreError, check_format, meta};

/// A session at a glance.
#[derive(Clone, Debug, PartialEq)]
pub struct Glance {
    pub task: String,
    pub seed: u64,
    pub trials: u64,
    pub successes: u64,
    pub best_reward: Option<f64>,
}

impl Glance {
    /// Reads the session file `path`. `None` if ratings or wishes decide what its trials count for: then
    /// [`Store::open`](super::Store::open) tells.
    pub fn of(path: &Path) -> Result<Option<Glance>, StoreError> {
        if !path.exists() {
            return Err(StoreError::Missing { path: path.into() });
        }
        let sql = |error| StoreError::from_sql(path, error);
        let connection = connect(path).map_err(sql)?;
        check_format(&connection, path)?;
        let meta = meta::read(&connection, path)?;
        let has_history = "SELECT EXISTS (SELECT 1 FROM ratings) \
                           OR EXISTS (SELECT 1 FROM wishes WHERE text <> '')";
        let has_history: bool =
            connection.query_row(has_history, [], |row| row.get(0)).map_err(sql)?;
        if has_history || meta.learner.people.weight > 0.0 {
            return Ok(None);
        }
        let sums =
            "SELECT COUNT(*), TOTAL(success), MAX(reward) FILTER (WHERE NOT set_aside) FROM trials";
        let sums = connection.query_row(sums, [], |row| {
            let successes: f64 = row.get(1)?;
            Ok((row.get(0).map(integer)?, successes as u64, row.get(2)?))
        });
        let (trials, successes, best_reward) = sums.map_err(sql)?;
        let (task, seed) = (meta.task, meta.learner.seed);
        Ok(Some(Glance { task, seed, trials, successes, best_reward }))
    }
}

/// Without a log beside it nobody writes the file, and it is read without locks, which would leave files behind.
fn connect(path: &Path) -> rusqlite::Result<Connection> {
    let mut log = path.as_os_str().to_os_string();
    log.push("-wal");
    let mode = if Path::new(&log).exists() { "mode=ro" } else { "immutable=1" };
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_URI;
    let connection = Connection::open_with_flags(uri(path, mode), flags)?;
    connection.busy_timeout(BUSY_TIMEOUT)?;
    Ok(connection)
}

fn uri(path: &Path, mode: &str) -> OsString {
    let escaped = path.as_os_str().as_bytes().iter().map(|byte| match byte {
        b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'.' | b'-' | b'_' => {
            char::from(*byte).to_string()
        }
        other => format!("%{other:02x}"),
    });
    format!("file:{}?{mode}", escaped.collect::<String>()).into()
}
