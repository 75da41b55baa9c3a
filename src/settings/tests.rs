//! Every setting has a sentence, a unit and a range, and the loader enforces the ranges that the schema states.

use std::collections::BTreeSet;

use search::range::{ABOVE_ZERO, ANY, Range};
use serde_json::Value;
use toml::{Table, Value as Toml};

use super::commented::commented;
use super::complete::complete;
use super::describe::{facts, is_table, range, sentence, unit};
use super::schema::schema;
use crate::config::Config;
use crate::tasks;

/// Every setting of the schema with its path.
fn leaves(node: &Value, path: &str, all: &mut Vec<(String, Value)>) {
    let table = if node.get("properties").is_some() { node } else { &node["items"] };
    for (name, inner) in table["properties"].as_object().into_iter().flatten() {
        let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
        if is_table(inner) {
            assert!(!sentence(inner).is_empty(), "[{path}] has no sentence");
            leaves(inner, &path, all);
        } else {
            all.push((path, inner.clone()));
        }
    }
}

fn settings() -> Vec<(String, Value)> {
    let mut all = Vec::new();
    leaves(&schema(), "", &mut all);
    all
}

#[test]
fn every_setting_has_a_sentence_a_unit_and_a_range() {
    let all = settings();
    assert!(all.len() > 170, "only {} settings", all.len());
    for (path, node) in &all {
        let sentence = sentence(node);
        assert!(sentence.ends_with('.') && sentence.len() > 10, "{path}: '{sentence}'");
        assert!(
            sentence.starts_with(|c: char| c.is_uppercase() || !c.is_alphabetic()),
            "{path}: '{sentence}'"
        );
        assert!(!facts(node).is_empty(), "{path} says nothing of what it takes");
        let has_numbers = node.to_string().contains("\"number\"")
            || (node.to_string().contains("\"integer\"") && node.get("enum").is_none());
        let is_mapped = path.ends_with("reward_map");
        assert_eq!(
            unit(node).is_some() || is_mapped,
            has_numbers || is_mapped,
            "{path} and its unit"
        );
    }
}

/// A name that ends in a unit says the same as the table of ranges.
#[test]
fn names_and_units_agree() {
    let endings = [
        ("_rad_s", "rad/s"),
        ("_rad", "rad"),
        ("_m", "m"),
        ("_us", "µs"),
        ("_hz", "Hz"),
        ("_kg", "kg"),
        ("_nm", "N·m"),
        ("_s", "s"),
    ];
    let mut n_checked = 0;
    for (path, node) in settings() {
        if let Some((_, expected)) = endings.iter().find(|(ending, _)| path.ends_with(ending)) {
            assert_eq!(unit(&node).as_deref(), Some(*expected), "{path}");
            n_checked += 1;
        }
    }
    assert!(n_checked > 20, "only {n_checked}");
}

/// What the loader says against it.
fn fault(table: &Table) -> Option<String> {
    let text = toml::to_string(table).unwrap();
    let read = Config::of_text(&text, Config::of_options);
    read.and_then(|config| config.validate_settings()).err().map(|error| format!("{error:#}"))
}

fn put(table: &mut Table, field: &str, value: f64) {
    let (path, name) = field.rsplit_once('.').unwrap();
    let mut node = Toml::Table(std::mem::take(table));
    let mut at = &mut node;
    for step in path.split('.').chain([name]) {
        let (step, index) = step.split_once('[').map_or((step, None), |(step, rest)| {
            (step, rest.trim_end_matches(']').parse::<usize>().ok())
        });
        at = at.get_mut(step).unwrap_or_else(|| panic!("{field}: no {step}"));
        if let Some(index) = index {
            at = at.get_mut(index).unwrap();
        }
    }
    *at = match at {
        Toml::Integer(_) => Toml::Integer(value as i64),
        _ => Toml::Float(value),
    };
    let Toml::Table(whole) = node else { unreachable!() };
    *table = whole;
}

fn is_integer(table: &Table, field: &str) -> bool {
    let mut at = Some(Toml::Table(table.clone()));
    for step in field.split('.') {
        let name = step.split('[').next().unwrap();
        at = at.and_then(|node| node.get(name).cloned());
        if step.contains('[') {
            at = at.and_then(|node| node.get(0).cloned());
        }
    }
    matches!(at, Some(Toml::Integer(_)))
}

/// Below and above each limit that there is.
fn just_outside(range: &Range, is_integer: bool) -> Vec<f64> {
    let (min, max) = (range.limits.min, range.limits.max);
    let below = match () {
        () if min == ANY.min => None,
        () if min == ABOVE_ZERO.min => Some(0.0),
        () if is_integer => Some(min - 1.0),
        () => Some(min.next_down()),
    };
    let above = match () {
        () if max == ANY.max => None,
        () if is_integer => Some(max + 1.0),
        () => Some(max.next_up()),
    };
    below.into_iter().chain(above).collect()
}

/// The limits of the schema are those of the loader: it refuses what is just outside by the name of the field and
/// takes the limit itself.
#[test]
fn the_loader_enforces_the_ranges_of_the_schema() {
    let base = complete();
    let table = Table::try_from(&base).unwrap();
    let schema = schema();
    let mut n_refused = 0;
    for of_setting in base.ranges() {
        let field = &of_setting.field;
        let steps: Vec<&str> = field.split('.').map(|s| s.split('[').next().unwrap()).collect();
        let node = super::schema::at(&schema, &steps).unwrap();
        assert_eq!(range(node), of_setting.limits.to_string(), "{field} in the schema");
        let is_integer = is_integer(&table, field);
        for value in just_outside(&of_setting, is_integer) {
            let mut changed = table.clone();
            put(&mut changed, field, value);
            let message =
                fault(&changed).unwrap_or_else(|| panic!("{field} = {value} is accepted"));
            let name = field.rsplit('.').next().unwrap().split('[').next().unwrap();
            assert!(message.contains(name), "{field} = {value}: {message}");
            // What is below 0 cannot even be read as a number of things.
            let is_unreadable = is_integer && (value < 0.0 || value > 255.0 && name == "priority");
            let limits = of_setting.limits.to_string();
            let says = limits.split(" to ").any(|limit| message.contains(limit));
            let says = says || message.contains("> 0");
            assert!(says || is_unreadable, "{field} = {value} without its limits: {message}");
            n_refused += 1;
        }
        for limit in [of_setting.limits.min, of_setting.limits.max] {
            if limit.abs() == ANY.max || limit == ABOVE_ZERO.min {
                continue;
            }
            let mut changed = table.clone();
            put(&mut changed, field, limit);
            // It may be refused beside another setting, but not for its own range.
            let own = format!("{field} is {limit}: use {}", of_setting.limits);
            let refused = fault(&changed).filter(|message| message.starts_with(&own));
            assert_eq!(refused, None, "{field} = {limit}");
        }
    }
    assert!(n_refused > 250, "only {n_refused} values were refused");
}

/// What is printed reads back as the same configuration, for every task.
#[test]
fn what_is_printed_reads_back() {
    for task in tasks::ALL {
        let config = Config::of_task(task.name);
        let text = commented(&config).unwrap();
        assert_eq!(Config::of_text(&text, Config::of_options).unwrap(), config, "{}", task.name);
    }
}

/// A comment above every key, and an example for each setting that is not set.
#[test]
fn every_key_is_printed_with_its_comment() {
    let text = commented(&Config::of_task("pancake")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let (mut table, mut names) = (String::new(), BTreeSet::new());
    for (i, line) in lines.iter().enumerate() {
        if line.starts_with('[') {
            table = line.trim_matches(['[', ']']).into();
            names.insert(table.clone());
        }
        let key = line.trim_start_matches("# ").split_once(" = ").map(|(key, _)| key);
        let is_name = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        if let Some(key) = key.filter(|key| key.chars().all(is_name) && !table.is_empty()) {
            // A list of tables says it once.
            let is_new = names.insert(format!("{table}.{key}"));
            assert!(!is_new || lines[i - 1].starts_with("# "), "{line} has no comment");
        }
    }
    for (path, _) in settings() {
        let parent = path.rsplit_once('.').unwrap().0;
        let is_optional_table = ["task.judge", "plant.pan"].contains(&parent);
        assert!(names.contains(&path) || is_optional_table, "{path} is not printed");
    }
    for name in ["task.judge", "plant.pan", "controller.cpu"] {
        assert!(names.contains(name), "{name} is not printed");
    }
}

/// Where nothing is printed, because it is the default, the sentence names it.
#[test]
fn every_setting_shows_its_default() {
    let printed = Table::try_from(Config::of_task("pancake")).unwrap();
    for (path, node) in settings() {
        let mut steps = path.split('.').map(str::to_string);
        let first = printed.get(&steps.next().unwrap()).cloned();
        let value = steps.fold(first, |value, step| {
            let value = value.map(|value| value.get(0).cloned().unwrap_or(value));
            value.and_then(|value| value.get(step.as_str()).cloned())
        });
        let says = sentence(&node).contains("Default:");
        let is_optional_table = path.starts_with("plant.pan.");
        assert!(value.is_some() || says || is_optional_table, "{path} has no default to be seen");
    }
    let schema = schema();
    for (path, said, written) in [
        ("encoding", "\"springs\"", "\"springs\""),
        ("demonstrations_are", "\"starts\"", "\"starts\""),
        ("orientation", "\"rotation_vector\"", "\"rotation_vector\""),
        ("initial_stiffness", "\"kappa_p\"", "\"kappa_p\""),
        ("stiffness_range", "4", "4.0"),
    ] {
        let sentence = sentence(&schema["properties"]["learner"]["properties"][path]);
        assert!(sentence.ends_with(&format!("Default: {said}.")), "{path}: {sentence}");
        let text = format!("[learner]\n{path} = {written}\n");
        let config = Config::of_text(&text, Config::of_options).unwrap();
        assert_eq!(config, Config::of_task("pancake"), "{path} has another default");
    }
}

/// No number shows how it was computed.
#[test]
fn defaults_are_short_numbers() {
    for task in tasks::ALL {
        let text = Config::of_task(task.name).to_toml().unwrap();
        for line in text.lines() {
            assert!(!line.contains("000000") && !line.contains("999999"), "{}: {line}", task.name);
        }
    }
}
