//! Wishes of a session: from which trial on its successes must be like what.

use super::rows::{integer, see_anew, signed};
use super::{Store, StoreError};
use crate::wish::{Wish, Wishes};
use search::SearchSnapshot;

impl Store {
    /// All of them, the oldest first.
    pub fn wishes(&self) -> Result<Wishes, StoreError> {
        let query = "SELECT after, text FROM wishes ORDER BY after";
        let mut statement = self.sql(self.connection.prepare(query))?;
        let rows = self.sql(
            statement.query_map([], |row| Ok((integer(row.get(0)?), row.get::<_, String>(1)?))),
        )?;
        let parse = |row: rusqlite::Result<(u64, String)>| {
            let (after, text) = self.sql(row)?;
            Wish::parse_any(&text, &self.meta.measures)
                .map(|wish| (after, wish))
                .map_err(|error| self.corrupt(format!("wish `{text}`: {error}")))
        };
        rows.map(parse).collect::<Result<_, StoreError>>().map(Wishes::of)
    }

    /// From the next trial on. A proposal that waits was made for another wish and is forgotten; `search` is
    /// what the stored trials say to this one.
    pub fn put_wish(&mut self, text: &str, search: &SearchSnapshot) -> Result<(), StoreError> {
        let after = self.trial_count()?;
        self.transaction(|transaction| {
            see_anew(transaction, after, search)?;
            transaction.execute("DELETE FROM wishes WHERE after = ?1", [signed(after)])?;
            let query = "INSERT INTO wishes (after, text) VALUES (?1, ?2)";
            transaction.execute(query, (signed(after), text))?;
            Ok(())
        })
    }
}
