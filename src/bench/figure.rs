//! A figure of a group of rows: the distributions of their times.

use super::Row;
use crate::draw::distribution::{self, Distribution};
use crate::draw::svg::Panel;

/// The times of `rows`, µs.
pub fn panel(title: &str, rows: &[&Row]) -> Panel {
    let distribution =
        |row: &&Row| Distribution { label: label(row, rows), counts: row.counts().collect() };
    distribution::panel(title, &rows.iter().map(distribution).collect::<Vec<_>>())
}

/// What tells a row from the others of its figure.
fn label(row: &Row, rows: &[&Row]) -> String {
    if rows.iter().any(|other| other.name != row.name) {
        return row.name.clone();
    }
    // The end that all have in common is in the title.
    let parts =
        |row: &Row| row.scenario.rsplit_once(", ").map(|(a, b)| (a.to_owned(), b.to_owned()));
    match parts(row) {
        Some((own, end)) if rows.iter().all(|other| parts(other).is_some_and(|p| p.1 == end)) => {
            own
        }
        _ => row.scenario.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_told_apart_by_what_they_do_not_share() {
        let rows = ["idle, 1 kHz", "storm, 1 kHz"].map(|scenario| Row::time("g", "n", scenario));
        let rows: Vec<&Row> = rows.iter().collect();
        assert_eq!(label(rows[0], &rows), "idle");
        let other = Row::time("g", "m", "idle, 1 kHz");
        assert_eq!(label(&other, &[rows[0], &other]), "m");
        assert!(panel("times", &rows).inline().contains(">storm</text>"));
    }
}
