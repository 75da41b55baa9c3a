//! Sessions of formats 3 to 7. In 3 the pancake's thirteen measures were columns of every task; in 4 there
//! were no wishes; in 5 people said nothing; in 6 one rollout was in flight at a time; in 7 cells had but a name.

use std::path::{Path, PathBuf};

use rusqlite::{Connection, Transaction, params};
use shm_types::episode::FAULT_POLICY_REFUSED;

use super::copy::replace;
use super::rows::signed;
use super::seal;
use super::{APPLICATION_ID, FORMAT_VERSION, StoreError, meta};
use crate::judge::Declared;

const FORMAT: i64 = 3;
/// Formats since then, each with the tables that came with the next one.
const SINCE: [(i64, &[&str]); 4] = [
    (4, &["wishes"]),
    (5, &["ratings", "demonstrations"]),
    (6, &["asked", "told"]),
    (7, &["given", "cells"]),
];
/// Columns that are gone: the one that held a world's own number, and the pancake's.
const VALUE: &str = "value";
const FLAGS: &str = "outcome_flags";
/// Measures of a pancake session: name, unit, and the expression that yields it.
const PANCAKE: [(&str, &str, &str); 16] = [
    ("tossed", "bool", "(outcome_flags & 1) != 0"),
    ("caught", "bool", "(outcome_flags & 2) != 0"),
    ("dropped", "bool", "(outcome_flags & 4) != 0"),
    ("exploit", "bool", "(outcome_flags & 8) != 0"),
    ("release_time_s", "s", "release_time_s"),
    ("release_speed_m_s", "m/s", "release_speed_m_s"),
    ("release_spin_rad_s", "rad/s", "release_spin_rad_s"),
    ("release_pitch_rate_rad_s", "rad/s", "release_pitch_rate_rad_s"),
    ("apex_m", "m", "apex_m"),
    ("crossing_time_s", "s", "crossing_time_s"),
    ("flip_angle_rad", "rad", "flip_angle_rad"),
    ("distance_m", "m", "distance_m"),
    ("lateral_m", "m", "lateral_m"),
    ("final_lateral_m", "m", "final_lateral_m"),
    ("bounce_s", "s", "bounce_s"),
    ("clipped_share", "1", "clipped_share"),
];

/// Converts the session at `path` if it is of a format before this one.
pub(super) fn to_this_format(connection: &mut Connection, path: &Path) -> Result<(), StoreError> {
    let pragma = |name| connection.pragma_query_value(None, name, |row| row.get::<_, i64>(0));
    // A file that is no session at all is refused when it is opened.
    match (pragma("application_id"), pragma("user_version")) {
        (Ok(APPLICATION_ID), Ok(FORMAT)) => from_format_3(connection, path),
        (Ok(APPLICATION_ID), Ok(found)) if SINCE.iter().any(|(format, _)| *format == found) => {
            with_tables(connection, found).map_err(|error| StoreError::from_sql(path, error))
        }
        _ => Ok(()),
    }
}

/// Nothing is taken away, so nothing needs to be kept.
fn with_tables(connection: &mut Connection, found: i64) -> rusqlite::Result<()> {
    let transaction = connection.transaction()?;
    create_since(&transaction, found)?;
    transaction.pragma_update(None, "user_version", FORMAT_VERSION)?;
    transaction.commit()
}

/// The tables that a session of the format `found` lacks.
fn create_since(transaction: &Transaction<'_>, found: i64) -> rusqlite::Result<()> {
    let missing = SINCE.iter().filter(|(format, _)| *format >= found);
    missing
        .flat_map(|(_, names)| *names)
        .try_for_each(|name| transaction.execute_batch(table(name)))
}

/// How the schema creates a table.
fn table(name: &str) -> &'static str {
    let schema = include_str!("schema.sql");
    let begin = schema.find(&format!("CREATE TABLE {name}")).unwrap_or_default();
    schema[begin..].split_inclusive(';').next().unwrap_or_default()
}

/// The file as it was is kept beside it, and the diary says so.
fn from_format_3(connection: &mut Connection, path: &Path) -> Result<(), StoreError> {
    let sql = |error| StoreError::from_sql(path, error);
    let kept = kept_path(path);
    if !kept.exists() {
        replace(connection, &kept).map_err(sql)?;
    }
    // References hold again at the end: a column cannot leave a table that is referred to.
    connection.pragma_update(None, "foreign_keys", "OFF").map_err(sql)?;
    let transaction = connection.transaction().map_err(sql)?;
    if let Some(detail) = convert(&transaction, &kept).map_err(sql)? {
        return Err(StoreError::Corrupt { path: path.into(), detail });
    }
    transaction.commit().map_err(sql)?;
    connection.pragma_update(None, "foreign_keys", "ON").map_err(sql)?;
    tracing::info!("{}: converted from format {FORMAT}", path.display());
    Ok(())
}

/// Where the file stays as it was.
fn kept_path(path: &Path) -> PathBuf {
    path.with_extension(format!("format-{FORMAT}.db"))
}

/// `Some` says what is damaged, and nothing was converted.
fn convert(transaction: &Transaction<'_>, kept: &Path) -> rusqlite::Result<Option<String>> {
    transaction.execute_batch(table("measures"))?;
    create_since(transaction, FORMAT)?;
    if let Some(detail) = seal::find_damage(transaction)? {
        return Ok(Some(detail));
    }
    let measures = measures_of(meta::value(transaction, "task")?.as_deref());
    for (name, _, expression) in &measures {
        let query = format!(
            "INSERT INTO measures (rollout, name, value) SELECT rollout, ?1, {expression} FROM trials \
             WHERE set_aside = 0 AND fault != ?2"
        );
        transaction.execute(&query, params![name, signed(FAULT_POLICY_REFUSED)])?;
    }
    let numbers = PANCAKE.iter().filter(|(_, unit, _)| *unit != "bool").map(|(name, ..)| *name);
    for column in numbers.chain([VALUE, FLAGS]) {
        transaction.execute_batch(&format!("ALTER TABLE trials DROP COLUMN {column}"))?;
    }
    let declared: Declared =
        measures.iter().map(|(name, unit, _)| (name.to_string(), unit.to_string())).collect();
    let query = "INSERT INTO meta (key, value) VALUES ('measures', ?1)";
    transaction.execute(query, [meta::measures_text(&declared)])?;
    let text = format!("from format {FORMAT}; as it was: {}", kept.display());
    transaction.execute("INSERT INTO events (kind, text) VALUES ('converted', ?1)", [&text])?;
    seal::seal_all(transaction)?;
    transaction.pragma_update(None, "user_version", FORMAT_VERSION)?;
    Ok(None)
}

/// What the tasks of format 3 measured.
fn measures_of(task: Option<&str>) -> Vec<(&'static str, &'static str, &'static str)> {
    match task {
        Some("landscape") => vec![("height", "1", VALUE)],
        Some("skittles") => vec![("distance_m", "m", VALUE)],
        _ => PANCAKE.to_vec(),
    }
}

#[cfg(test)]
mod tests;
