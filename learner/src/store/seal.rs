//! A digest in every row, so that damage inside a value is seen: SQLite's own checks see that of pages.

use std::cell::OnceCell;

use rusqlite::functions::FunctionFlags;
use rusqlite::types::ValueRef;
use rusqlite::{Connection, Transaction};
use shm_types::Digest;

/// Every table; each has a column `seal` over all its others.
const TABLES: [&str; 9] = [
    "meta",
    "policies",
    "proposals",
    "trials",
    "measures",
    "searches",
    "modes",
    "forbidden",
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

/// Lets rows without a seal be found without looking at the others. Sessions of older programs have
/// no such index until they are gone on with.
pub(super) fn index(connection: &Connection) -> rusqlite::Result<()> {
    let index = |table| {
        format!("CREATE INDEX IF NOT EXISTS unsealed_{table} ON {table} (seal) WHERE seal IS NULL;")
    };
    connection.execute_batch(&TABLES.map(index).concat())
}

/// What seals the rows of each table. The names of the columns are asked of SQLite once, when the
/// tables are there.
#[derive(Default)]
pub(super) struct Seals(OnceCell<Vec<String>>);

impl Seals {
    /// Seals the rows that a transaction has written.
    pub fn seal(&self, transaction: &Transaction<'_>) -> rusqlite::Result<()> {
        for update in self.updates(transaction)? {
            transaction.prepare_cached(update)?.execute([])?;
        }
        Ok(())
    }

    fn updates(&self, connection: &Connection) -> rusqlite::Result<&[String]> {
        if let Some(updates) = self.0.get() {
            return Ok(updates);
        }
        let update = |table| {
            let columns = columns(connection, table)?;
            Ok(format!("UPDATE {table} SET seal = row_digest({columns}) WHERE seal IS NULL"))
        };
        let updates = TABLES.into_iter().map(update).collect::<rusqlite::Result<Vec<_>>>()?;
        Ok(self.0.get_or_init(|| updates))
    }
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
    fn unsealed_rows_are_found_without_a_scan() {
        let connection = Connection::open_in_memory().unwrap();
        teach(&connection).unwrap();
        connection.execute_batch(include_str!("schema.sql")).unwrap();
        let plans = |connection: &Connection| -> Vec<String> {
            let seals = Seals::default();
            let plan = |update: &String| {
                let sql = format!("EXPLAIN QUERY PLAN {update}");
                connection.query_row(&sql, [], |row| row.get(3)).unwrap()
            };
            seals.updates(connection).unwrap().iter().map(plan).collect()
        };
        assert!(plans(&connection).iter().all(|plan| plan.starts_with("SCAN")));
        index(&connection).unwrap();
        let plans = plans(&connection);
        assert!(
            plans.iter().all(|plan| plan.contains("USING") && plan.contains("unsealed_")),
            "{plans:?}"
        );
        index(&connection).unwrap();
    }
}
