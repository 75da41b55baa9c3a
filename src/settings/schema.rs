//! The JSON Schema of a configuration file: structure and sentences from the types, limits and units from
//! their ranges.

use schemars::generate::SchemaSettings;
use search::RewardMap;
use search::range::{ABOVE_ZERO, ANY, Range};
use serde_json::{Map, Value, json};

use super::complete::complete;
use crate::tasks;

/// Where a unit stands: JSON Schema has no word for it.
pub const UNIT: &str = "x-unit";

/// Draft 7, which editors read, without references.
pub fn schema() -> Value {
    let settings = SchemaSettings::draft07().with(|settings| settings.inline_subschemas = true);
    let mut schema =
        settings.into_generator().into_root_schema_for::<crate::config::Config>().to_value();
    tidy(&mut schema);
    schema["title"] = json!("Configuration of Skillet");
    for range in ranges() {
        let leaf = at_mut(&mut schema, &steps(&range.field))
            .unwrap_or_else(|| panic!("{}: a range without a setting", range.field));
        limit(leaf, &range);
    }
    let names: Vec<&str> = tasks::ALL.iter().map(|task| task.name).collect();
    schema["properties"]["task"]["properties"]["name"]["enum"] = json!(names);
    schema
}

/// The range of every number there is; the choices of one setting have different ones.
fn ranges() -> Vec<Range> {
    let mut config = complete();
    let mut ranges = config.ranges();
    for map in [RewardMap::Shift(0.0), RewardMap::Exp(1.0)] {
        config.learner.search.reward_map = map;
        ranges
            .extend(config.ranges().into_iter().filter(|range| range.field.contains("reward_map")));
    }
    ranges
}

/// `a.b[0].c` as a, b, c: a list has one description for all of its entries.
fn steps(field: &str) -> Vec<&str> {
    field.split('.').map(|step| step.split('[').next().unwrap_or(step)).collect()
}

/// The description of a setting within that of its table.
pub fn at<'a>(node: &'a Value, steps: &[&str]) -> Option<&'a Value> {
    let Some((first, rest)) = steps.split_first() else { return Some(node) };
    let list = ["oneOf", "anyOf"].iter().find_map(|name| node.get(name)?.as_array());
    let next = None
        .or_else(|| node.get("properties")?.get(first))
        .or_else(|| list?.iter().find_map(|choice| choice.get("properties")?.get(first)))
        .or_else(|| node.get("items").and_then(|items| at(items, &[*first])))
        .or_else(|| node.get("additionalProperties").filter(|entry| entry.is_object()))?;
    at(next, rest)
}

fn at_mut<'a>(node: &'a mut Value, steps: &[&str]) -> Option<&'a mut Value> {
    let Some((first, rest)) = steps.split_first() else { return Some(node) };
    let has = |node: &Value| at(node, &[*first]).is_some();
    let Value::Object(map) = node else { return None };
    let next = if map.get("properties").is_some_and(|all| all.get(first).is_some()) {
        map.get_mut("properties")?.get_mut(first)?
    } else if let Some(list) = ["oneOf", "anyOf"].iter().find(|name| map.contains_key(**name)) {
        let choices = map.get_mut(*list)?.as_array_mut()?;
        choices.iter_mut().find(|choice| has(choice))?.get_mut("properties")?.get_mut(first)?
    } else if map.get("items").is_some_and(has) {
        return at_mut(map.get_mut("items")?, steps);
    } else {
        map.get_mut("additionalProperties").filter(|entry| entry.is_object())?
    };
    at_mut(next, rest)
}

/// Puts limits and unit into the description of a number, or of the numbers of a list.
fn limit(leaf: &mut Value, range: &Range) {
    leaf[UNIT] = json!(range.unit);
    let number = number(leaf).unwrap_or_else(|| panic!("{}: not a number", range.field));
    let (min, max) = (range.limits.min, range.limits.max);
    for name in ["minimum", "maximum", "exclusiveMinimum"] {
        number.remove(name);
    }
    match min {
        _ if min == ANY.min => {}
        _ if min == ABOVE_ZERO.min => drop(number.insert("exclusiveMinimum".into(), json!(0))),
        _ => drop(number.insert("minimum".into(), limit_of(min))),
    }
    if max != ANY.max {
        number.insert("maximum".into(), limit_of(max));
    }
}

/// Whole numbers without a point.
fn limit_of(value: f64) -> Value {
    if value.fract() == 0.0 && value.abs() < 1e15 { json!(value as i64) } else { json!(value) }
}

/// Where the limits of a number belong: in itself, in the entries of a list, in one of several choices.
fn number(leaf: &mut Value) -> Option<&mut Map<String, Value>> {
    let is_number = |node: &Value| matches!(node["type"].as_str(), Some("number" | "integer"));
    if leaf.get("items").is_some() {
        return number(leaf.get_mut("items")?);
    }
    if leaf.get("anyOf").is_some() {
        let choices = leaf.get_mut("anyOf")?.as_array_mut()?;
        return choices.iter_mut().find(|choice| is_number(choice))?.as_object_mut();
    }
    if is_number(leaf) { leaf.as_object_mut() } else { None }
}

/// TOML has no null, a table needs no default of its own, and a format of numbers says nothing here.
fn tidy(node: &mut Value) {
    match node {
        Value::Object(map) => {
            if let Some(Value::Array(types)) = map.get_mut("type") {
                types.retain(|name| name != "null");
                if let [one] = &types[..] {
                    let one = one.clone();
                    map.insert("type".into(), one);
                }
            }
            if let Some(Value::Array(choices)) = map.get_mut("anyOf") {
                choices.retain(|choice| choice["type"] != "null");
                if let [Value::Object(one)] = &choices[..] {
                    let one = one.clone();
                    map.remove("anyOf");
                    for (key, value) in one {
                        map.entry(key).or_insert(value);
                    }
                }
            }
            if map.get("default").is_some_and(|default| default.is_object() || default.is_null()) {
                map.remove("default");
            }
            if map.get("format").is_some_and(|format| format.is_string() && format != "path") {
                map.remove("format");
            }
            if let Some(Value::String(description)) = map.get_mut("description") {
                *description = description.split_whitespace().collect::<Vec<_>>().join(" ");
            }
            map.values_mut().for_each(tidy);
        }
        Value::Array(list) => list.iter_mut().for_each(tidy),
        _ => {}
    }
}
