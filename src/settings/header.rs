//! The header of a table in TOML.

use anyhow::{Context, Result};
use toml::{Table, Value};

/// The names in `[a.b]` or `[[a.b]]`.
pub fn header(line: &str) -> Result<Vec<String>> {
    let mut table: Table = toml::from_str(line).with_context(|| format!("the header {line}"))?;
    let mut path = Vec::new();
    while let Some((name, value)) = table.into_iter().next() {
        path.push(name);
        table = match value {
            Value::Table(inner) => inner,
            _ => Table::new(),
        };
    }
    Ok(path)
}
