//! Identity and configuration of a session: the table `meta`.

use std::path::Path;

use rusqlite::{Connection, OptionalExtension, Transaction};

use super::StoreError;
use super::rows::{from_hex, hex};
use crate::config::LearnerConfig;
use crate::judge::Declared;

/// Identity and configuration of a session.
#[derive(Clone, Debug, PartialEq)]
pub struct SessionMeta {
    pub task: String,
    /// Names the session in every message; chosen when it is started.
    pub session_id: u64,
    /// The effective configuration file, for people.
    pub config_toml: String,
    /// Names and units of what is measured of every trial, in order.
    pub measures: Declared,
    /// The learner's part of it, which decides what may be resumed.
    pub learner: LearnerConfig,
}

/// Writes the identity; seed and shape once more on their own, for people with an SQLite tool.
pub(super) fn write(transaction: &Transaction<'_>, meta: &SessionMeta) -> rusqlite::Result<()> {
    let learner = serde_json::to_string(&meta.learner).expect("a configuration is plain data");
    for (key, value) in [
        ("task", meta.task.clone()),
        ("session_id", hex(meta.session_id)),
        ("seed", meta.learner.seed.to_string()),
        ("task_dim", meta.learner.task_dim.to_string()),
        ("n_components", meta.learner.n_components.to_string()),
        ("config_toml", meta.config_toml.clone()),
        ("measures", measures_text(&meta.measures)),
        ("learner", learner),
    ] {
        transaction.execute("INSERT INTO meta (key, value) VALUES (?1, ?2)", [key, &value])?;
    }
    Ok(())
}

/// As it stands in `meta`: `[["apex_m", "m"], …]`.
pub(super) fn measures_text(declared: &Declared) -> String {
    serde_json::to_string(declared).expect("names and units are plain data")
}

/// Reads the identity of the session in the file `path`.
pub(super) fn read(connection: &Connection, path: &Path) -> Result<SessionMeta, StoreError> {
    let corrupt = |detail: String| StoreError::Corrupt { path: path.into(), detail };
    let text = |key| match value(connection, key) {
        Ok(Some(text)) => Ok(text),
        Ok(None) => Err(corrupt(format!("meta lacks `{key}`"))),
        Err(error) => Err(StoreError::from_sql(path, error)),
    };
    let session_id = text("session_id")?;
    Ok(SessionMeta {
        task: text("task")?,
        session_id: from_hex(&session_id)
            .ok_or_else(|| corrupt(format!("session_id is `{session_id}`")))?,
        config_toml: text("config_toml")?,
        measures: serde_json::from_str(&text("measures")?)
            .map_err(|error| corrupt(format!("meta `measures`: {error}")))?,
        learner: serde_json::from_str(&text("learner")?)
            .map_err(|error| corrupt(format!("meta `learner`: {error}")))?,
    })
}

pub(super) fn value(connection: &Connection, key: &str) -> rusqlite::Result<Option<String>> {
    let query = "SELECT value FROM meta WHERE key = ?1";
    connection.query_row(query, [key], |row| row.get(0)).optional()
}
