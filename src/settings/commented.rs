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
        let mut described = HashSet::new();
        // Tables at the top are all there, so nothing is missing above the first of them.
        for line in text.lines().filter(|line| !line.is_empty()) {
            if line.starts_with('[') {
                out += &self.missing(&path);
                path = header(line)?;
                let node = self.node(&path).filter(|_| described.insert(path.clone()));
                out += "\n";
                out += &node.map(comment).unwrap_or_default();
            } else {
                let key = line.split(" = ").next().unwrap_or_default();
                let inner: Vec<String> = path.iter().cloned().chain([key.to_string()]).collect();
                let is_setting = self.node(&path).is_some_and(is_table);
                let node =
                    self.node(&inner).filter(|_| is_setting && described.insert(inner.clone()));
                out += &node.map(comment).unwrap_or_default();
            }
            out += line;
            out += "\n";
        }
        out += &self.missing(&path);
        Ok(out)
    }

    fn node(&self, path: &[String]) -> Option<&Value> {
        at(&self.schema, &path.iter().map(String::as_str).collect::<Vec<_>>())
    }

    /// The settings of a table that are not set, as comments with an example.
    fn missing(&self, path: &[String]) -> String {
        let properties = self.node(path).and_then(|node| node.get("properties")?.as_object());
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

/// The table at `path`.
fn inner<'a>(table: &'a Table, path: &[String]) -> Option<&'a Table> {
    path.iter().try_fold(table, |table, step| table.get(step)?.as_table())
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
