//! Rows as a table, as JSON and as files.

use std::path::Path;

use anyhow::{Context, Result};
use serde_json::{Value, json};

use super::{Bench, Row, page};
use crate::host::Host;

pub fn as_json(bench: &Bench, host: &Host, rows: &[Row]) -> Value {
    let rows: Vec<Value> = rows.iter().map(Row::to_json).collect();
    json!({ "bench": bench.name, "host": host, "rows": rows })
}

/// Names of the columns, and each row's cells: text first, then numbers.
pub fn table(rows: &[Row]) -> ([&'static str; 9], Vec<[String; 9]>) {
    let head = ["name", "scenario", "unit", "n", "p50", "p99", "p99.9", "max", "misses"];
    let cells = |row: &Row| {
        [
            row.name.clone(),
            row.scenario.clone(),
            // Times are in us for programs, and in µs for people.
            if row.is_time() { "µs".into() } else { row.unit.into() },
            row.n().to_string(),
            significant(row.quantile(0.5)),
            significant(row.quantile(0.99)),
            significant(row.quantile(0.999)),
            significant(row.max()),
            row.misses.map_or("–".into(), |misses| misses.to_string()),
        ]
    };
    (head, rows.iter().map(cells).collect())
}

pub fn as_text(host: &Host, rows: &[Row]) -> String {
    let mut text = String::new();
    for (name, value) in host.lines() {
        text += &format!("{name:<14}{value}\n");
    }
    text.push('\n');
    let (head, cells) = table(rows);
    let lines: Vec<[String; 9]> = std::iter::once(head.map(str::to_owned)).chain(cells).collect();
    let width =
        |column: usize| lines.iter().map(|line| line[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..head.len()).map(width).collect();
    for line in &lines {
        let mut written = String::new();
        for (column, (cell, width)) in line.iter().zip(&widths).enumerate() {
            if column < 3 {
                written += &format!("{cell:<width$}  ");
            } else {
                written += &format!("{cell:>width$}  ");
            }
        }
        text += written.trim_end();
        text.push('\n');
    }
    text
}

/// Three significant digits, without exponent.
fn significant(value: f64) -> String {
    if value <= 0.0 {
        return "0".into();
    }
    let decimals = (2.0 - value.log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{value:.decimals$}")
}

/// Writes `<bench>.json` and `<bench>.html` into `folder`, which is created.
pub fn write(folder: &Path, bench: &Bench, host: &Host, rows: &[Row]) -> Result<()> {
    std::fs::create_dir_all(folder)
        .with_context(|| format!("{}: cannot create the folder", folder.display()))?;
    let json = serde_json::to_string_pretty(&as_json(bench, host, rows))? + "\n";
    for (extension, text) in [("json", json), ("html", page::html(bench, host, rows))] {
        let path = folder.join(format!("{}.{extension}", bench.name));
        std::fs::write(&path, text)
            .with_context(|| format!("{}: cannot write; check space and rights", path.display()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::significant;

    #[test]
    fn numbers_have_three_digits() {
        let found = [0.0, 0.01234, 1.0, 56.78, 123.4, 98765.0].map(significant);
        assert_eq!(found, ["0", "0.0123", "1.00", "56.8", "123", "98765"]);
    }
}
