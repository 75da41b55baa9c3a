//! The reference page of the settings: a section a table, a row a setting.

use anyhow::{Context, Result};
use serde_json::Value;
use toml::Table;

use super::complete::complete;
use super::describe::{choices, is_table, kind, range, sentence, unit};
use super::header::header;
use super::schema::schema;
use crate::config::Config;

const HEAD: &str = "\
# Settings

Every setting of a configuration file, with its unit, its range and its default. This page is generated from the
doc comments in the code and from the ranges that the loader checks: `skillet config --markdown` prints it.

`skillet config > my.toml` writes the same as a file: keep what you change and delete the rest. Anything you omit uses
the default of its task; the defaults below are those of `pancake`, and `skillet config landscape` prints those of another
task. `skillet config --check my.toml` checks a file and everything it names.

## Completion in an editor

Editors that use [Taplo](https://taplo.tamasfe.dev), such as VS Code with Even Better TOML, complete and check a file that
names a schema in its first line. No network is needed:

```sh
skillet config --schema > skillet.schema.json
```

Then begin `my.toml` in the same folder with `#:schema ./skillet.schema.json`. In the schema, the unit of a setting is
`x-unit`.
";

/// The page, as Markdown.
pub fn reference() -> Result<String> {
    let schema = schema();
    let table = |config: &Config| Table::try_from(config).context("the configuration as a table");
    let defaults = table(&Config::of_task("pancake"))?;
    let order = order(&complete().to_toml()?)?;
    let mut out = HEAD.to_string();
    section(&schema, &defaults, &order, &mut Vec::new(), &mut out);
    Ok(out)
}

/// The path of every setting, as a configuration is written.
fn order(text: &str) -> Result<Vec<Vec<String>>> {
    let (mut all, mut table) = (Vec::new(), Vec::new());
    for line in text.lines().filter(|line| !line.is_empty()) {
        match line.split_once(" = ") {
            Some((name, _)) => all.push([table.clone(), vec![name.to_string()]].concat()),
            None => {
                table = header(line)?;
                all.push(table.clone());
            }
        }
    }
    Ok(all)
}

fn section(
    node: &Value,
    defaults: &Table,
    order: &[Vec<String>],
    path: &mut Vec<String>,
    out: &mut String,
) {
    let table = if node.get("properties").is_some() { node } else { &node["items"] };
    let all = table["properties"].as_object();
    let mut names: Vec<String> = all.into_iter().flatten().map(|(name, _)| name.clone()).collect();
    let place = |name: &String| {
        let inner: Vec<String> = path.iter().chain([name]).cloned().collect();
        order.iter().position(|other| other.starts_with(&inner))
    };
    names.sort_by_key(place);
    let is_setting = |name: &&String| !is_table(&table["properties"][name.as_str()]);
    if names.iter().any(|name| is_setting(&name)) {
        let is_list = node.get("items").is_some();
        let name = path.join(".");
        let name = if is_list { format!("[[{name}]]") } else { format!("[{name}]") };
        *out += &format!("\n## `{name}`\n\n{}\n\n", sentence(node));
        *out += "| setting | meaning | unit | range | default |\n|---|---|---|---|---|\n";
        for name in names.iter().filter(is_setting) {
            let inner = path.iter().try_fold(defaults, |table, step| table.get(step)?.as_table());
            let default = inner.and_then(|table| table.get(name)).map(ToString::to_string);
            *out += &row(name, &table["properties"][name.as_str()], default);
        }
    }
    for name in names.iter().filter(|name| !is_setting(name)) {
        path.push(name.clone());
        section(&table["properties"][name.as_str()], defaults, order, path, out);
        path.pop();
    }
}

fn row(name: &str, node: &Value, default: Option<String>) -> String {
    let mut meaning = sentence(node).to_string();
    let choices = choices(node);
    for (choice, sentence) in choices.iter().filter(|(_, sentence)| !sentence.is_empty()) {
        let sentence = sentence.trim_end_matches('.');
        meaning += &format!("<br>`{}`: {sentence}", choice.trim_matches('"'));
    }
    let listed: Vec<String> = choices.iter().map(|(choice, _)| format!("`{choice}`")).collect();
    let (unit, limits) = match unit(node) {
        Some(unit) => (unit, range(node)),
        None => (String::new(), kind(node)),
    };
    let limits = match (listed.is_empty(), unit.is_empty()) {
        (true, _) => limits,
        (false, true) => listed.join(", "),
        (false, false) => format!("{limits}, or {}", listed.join(", ")),
    };
    let default = default.map(|value| format!("`{value}`")).unwrap_or_default();
    let cells = [format!("`{name}`"), meaning, unit, limits, default];
    format!("| {} |\n", cells.map(|cell| cell.replace('|', "\\|")).join(" | "))
}
