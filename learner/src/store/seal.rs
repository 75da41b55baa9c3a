//! A digest in every row, so that damage inside a value is seen: SQLite's own checks see that of pages.

use rusqlite::Connection;
use rusqlite::functions::FunctionFlags;
use rusqlite::types::ValueRef;
use shm_types::Digest;

/// Every table; each has a column `seal` over all its others.
const TABLES: [&str; 16] = [
    "meta",
    "policies",
    "proposals",
    "trials",
    "measures",
    "searches",
    "modes",
    "forbidden",
    "wishes",
    "ratings",
    "demonstrations",
    "asked",
    "told",
    "given",
    "cells",
    "events",
];

/// Teaches a connection the SQL function `row_digest(value, …)`.
pub(super) fn teach(connection: &Connection) -> rusqlite::Result<()> {
    let flags = FunctionFlags::SQLITE_DETERMINISTIC | FunctionFlags::SQLITE_UTF8;
    connection.create_scalar_function("row_digest", -1, flags, |row| {
        let mut digest = Digest::new();
        for i in 0..row.len() {
            digest = match row.get_raw(i) {
                ValueRef::Null => digest.bytes(b"n"),
                ValueRef::Integer(value) => digest.bytes(b"i").bytes(&value.to_le_bytes()),
                ValueRef::Real(value) => digest.bytes(b"r").bytes(&value.to_le_bytes()),
                ValueRef::Text(text) => sized(digest.bytes(b"t"), text),
                ValueRef::Blob(blob) => sized(digest.bytes(b"b"), blob),
            };
        }
        Ok(digest.finish().cast_signed())
    })
}

/// With its length, so that what belongs to the next value is not this one's.
fn sized(digest: Digest, bytes: &[u8]) -> Digest {
    digest.bytes(&bytes.len().to_le_bytes()).bytes(bytes)
}

/// Has every row sealed that this connection inserts, in the same transaction.
pub(super) fn seal_inserts(connection: &Connection) -> rusqlite::Result<()> {
    for table in TABLES {
        let update = update(connection, table)?;
        connection.execute_batch(&format!(
            "CREATE TEMP TRIGGER seal_{table} AFTER INSERT ON main.{table} \
             BEGIN {update} WHERE rowid = NEW.rowid; END"
        ))?;
    }
    Ok(())
}

/// Seals every row as it is now.
pub(super) fn seal_all(connection: &Connection) -> rusqlite::Result<()> {
    TABLES.iter().try_for_each(|table| connection.execute_batch(&update(connection, table)?))
}

fn update(connection: &Connection, table: &str) -> rusqlite::Result<String> {
    let columns = columns(connection, table)?;
    Ok(format!("UPDATE {table} SET seal = row_digest({columns})"))
}

/// The first table with a row that is not as it was written, and how many there are.
pub(super) fn find_damage(connection: &Connection) -> rusqlite::Result<Option<String>> {
    for table in TABLES {
        let columns = columns(connection, table)?;
        let sql = format!("SELECT count(*) FROM {table} WHERE seal IS NOT row_digest({columns})");
        let damaged: i64 = connection.query_row(&sql, [], |row| row.get(0))?;
        if damaged > 0 {
            return Ok(Some(format!("{damaged} rows of `{table}` do not match their seals")));
        }
    }
    Ok(None)
}

/// Digest of all rows of all tables.
pub(super) fn contents(connection: &Connection) -> rusqlite::Result<u64> {
    let mut all = Digest::new();
    for table in TABLES {
        let sql = format!("SELECT seal FROM {table} ORDER BY 1");
        let mut statement = connection.prepare(&sql)?;
        for seal in statement.query_map([], |row| row.get::<_, i64>(0))? {
            all = all.bytes(&seal?.to_le_bytes());
        }
        all = sized(all, table.as_bytes());
    }
    Ok(all.finish())
}

/// All columns but the seal, in their order.
fn columns(connection: &Connection, table: &str) -> rusqlite::Result<String> {
    let sql = "SELECT group_concat(name) FROM pragma_table_info(?1) WHERE name <> 'seal'";
    connection.query_row(sql, [table], |row| row.get(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_sealed_when_it_is_inserted_and_only_there() {
        let connection = Connection::open_in_memory().unwrap();
        teach(&connection).unwrap();
        connection.execute_batch(include_str!("schema.sql")).unwrap();
        seal_inserts(&connection).unwrap();
        let insert = "INSERT OR REPLACE INTO meta (key, value) VALUES (?1, ?2)";
        for (key, value) in [("a", "1"), ("b", "2"), ("a", "3")] {
            connection.execute(insert, [key, value]).unwrap();
        }
        assert_eq!(find_damage(&connection).unwrap(), None);
        let before = contents(&connection).unwrap();
        connection.execute_batch("UPDATE meta SET value = '4' WHERE key = 'a'").unwrap();
        let damage = find_damage(&connection).unwrap().unwrap();
        assert!(damage.contains("1 rows of `meta`"), "{damage}");
        seal_all(&connection).unwrap();
        assert_eq!(find_damage(&connection).unwrap(), None);
        assert_ne!(contents(&connection).unwrap(), before);
    }
}
