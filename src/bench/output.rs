//! Rows as a table, as JSON and as files.

use std::path::Path;

use anyhow::{Context, Result};
use serde_json::{Value, json};

use super::table::table;
use super::{Bench, Row, page};
use crate::fields;
use crate::host::Host;

pub fn as_json(bench: &Bench, host: &Host, rows: &[Row]) -> Value {
    let rows: Vec<Value> = rows.iter().map(Row::to_json).collect();
    json!({ "bench": bench.name, "host": host, "rows": rows })
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

/// Writes `<bench>.json` and `<bench>.html` into `folder`, which is created.
pub fn write(folder: &Path, bench: &Bench, host: &Host, rows: &[Row]) -> Result<()> {
    std::fs::create_dir_all(folder)
        .with_context(|| format!("{}: cannot create the folder", folder.display()))?;
    let json = format!("{:#}\n", fields::versioned(&fields::short(as_json(bench, host, rows)))?);
    for (extension, text) in [("json", json), ("html", page::html(bench, host, rows))] {
        let path = folder.join(format!("{}.{extension}", bench.name));
        std::fs::write(&path, text)
            .with_context(|| format!("{}: cannot write; check space and rights", path.display()))?;
    }
    Ok(())
}
