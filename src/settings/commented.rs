//! A configuration as TOML with a comment above every setting: its sentence, unit and range.

use std::collections::HashSet;

use anyhow::{Context, Result};
use serde_json::Value;
use toml::Table;

use super::complete::complete;
use super::describe::{facts, is_table, sentence};
use super::header::header;
use super::schema::{at, schema};
use crate::config::Config;

/// Columns of a comment.
const WIDTH: usize = 110;
const HEAD: &str = "\
# Every setting with its unit and its range. Anything you omit uses the default of its task.
# Lines such as `# cpu = 3` are examples of settings that are not set.
# Completion in an editor: docs/settings.md
";

/// `config` as a file that reads back as it.
pub fn commented(config: &Config) -> Result<String> {
    let text = config.to_toml()?;
    let table = |config: &Config| Table::try_from(config).context("the configuration as a table");
    let page = Page { schema: schema(), given: table(config)?, examples: table(&complete())? };
    page.write(&text)
}

struct Page {
    schema: Value,
    given: Table,
    examples: Table,
}

impl Page {
    fn write(&self, text: &str) -> Result<String> {
        let (mut out, mut path) = (HEAD.to_string(), Vec::new());
        // A list of tables is described once.
        let (mut described, mut is_new_table) = (HashSet::new(), false);
        for line in text.lines().filter(|line| !line.is_empty()) {
            let is_header = line.starts_with('[');
            let key = if is_header { header(line)? } else { inside(&path, line) };
            if is_header {
                // Tables at the top are all there, so nothing is missing above the first of them.
                out += &if is_new_table { self.missing(&path) } else { String::new() };
                out += "\n";
            }
            let is_new = described.insert(key.clone());
            // What a table of names holds are no settings.
            let is_setting = is_header || self.node(&path).is_some_and(is_table);
            let node = self.node(&key).filter(|_| is_setting && is_new);
            out += &node.map(comment).unwrap_or_default();
            out += &format!("{line}\n");
            if is_header {
                (path, is_new_table) = (key, is_new);
            }
        }
        Ok(out + &self.missing(&path))
    }

    fn node(&self, path: &[String]) -> Option<&Value> {
        at(&self.schema, &path.iter().map(String::as_str).collect::<Vec<_>>())
    }

    /// The settings of a table that are not set, as comments with an example.
    fn missing(&self, path: &[String]) -> String {
        let node = self.node(path);
        let table = node.map(|node| if node["items"].is_object() { &node["items"] } else { node });
        let properties = table.and_then(|table| table.get("properties")?.as_object());
        let given = inner(&self.given, path);
        let examples = inner(&self.examples, path);
        let mut out = String::new();
        for (name, node) in properties.into_iter().flatten() {
            if given.is_none_or(|table| table.contains_key(name)) {
                continue;
            }
            if let Some(example) = examples.and_then(|table| table.get(name)) {
                out += &format!("{}# {name} = {example}\n", comment(node));
            }
        }
        out
    }
}

/// The table at `path`; of a list of tables, the first.
fn inner<'a>(table: &'a Table, path: &[String]) -> Option<&'a Table> {
    path.iter().try_fold(table, |table, step| match table.get(step)? {
        toml::Value::Array(list) => list.first()?.as_table(),
        value => value.as_table(),
    })
}

/// The path of the setting in `line` of the table `path`.
fn inside(path: &[String], line: &str) -> Vec<String> {
    let key = line.split(" = ").next().unwrap_or_default();
    [path, &[key.to_string()]].concat()
}

/// Sentence, unit and range as comment lines.
fn comment(node: &Value) -> String {
    let facts = facts(node);
    let mut text = sentence(node).to_string();
    if !facts.is_empty() && !is_table(node) {
        text += &format!(" {}.", capital(&facts));
    }
    wrapped(&text)
}

/// Units keep their letters: `s` and `m` are not `S` and `M`.
fn capital(facts: &str) -> String {
    let word = facts.split([' ', ',']).next().unwrap_or_default();
    let is_word =
        ["integer", "dimensionless", "one", "any", "true", "list", "table", "unit", "units"];
    match facts.chars().next().filter(|_| is_word.contains(&word)) {
        Some(first) => first.to_uppercase().collect::<String>() + &facts[first.len_utf8()..],
        None => facts.into(),
    }
}

fn wrapped(text: &str) -> String {
    let (mut out, mut line) = (String::new(), String::from("#"));
    for word in text.split_whitespace() {
        if line.chars().count() + 1 + word.chars().count() > WIDTH {
            out += &format!("{line}\n");
            line = "#".into();
        }
        line += &format!(" {word}");
    }
    if line.len() > 1 { out + &line + "\n" } else { out }
}
