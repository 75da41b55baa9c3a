//! What is said of one setting: its sentence, unit and range.

use search::range::{ABOVE_ZERO, ANY, Limits};
use serde_json::Value;

use super::schema::UNIT;

/// Its sentence.
pub fn sentence(node: &Value) -> &str {
    node["description"].as_str().unwrap_or_default()
}

/// Whether it is a table with settings of its own.
pub fn is_table(node: &Value) -> bool {
    node.get("properties").is_some() || node["items"].get("properties").is_some()
}

/// Unit and range as words: `s, 0.1 to 3`, `true or false`, `one of "a", "b"`.
pub fn facts(node: &Value) -> String {
    let choices = choices(node);
    if !choices.is_empty() {
        let listed: Vec<String> = choices.iter().map(|(choice, _)| choice.clone()).collect();
        let numbers = unit(node).map(|unit| format!("{unit}, {}, or ", range(node)));
        return format!("{}one of {}", numbers.unwrap_or_default(), listed.join(", "));
    }
    if let Some(unit) = unit(node) {
        return format!("{unit}, {}", range(node));
    }
    kind(node)
}

/// What a setting without number and choices takes.
pub fn kind(node: &Value) -> String {
    let of_text = |node: &Value| if node["format"] == "path" { "path" } else { "string" };
    match node["type"].as_str() {
        Some("boolean") => "true or false".into(),
        Some("array") => format!("list of {}s", of_text(&node["items"])),
        Some("object") => "table of names and strings".into(),
        Some("string") => format!("any {}", of_text(node)),
        _ => String::new(),
    }
}

/// Its unit in words, if it has numbers.
pub fn unit(node: &Value) -> Option<String> {
    let entry = &node["additionalProperties"];
    let unit = node.get(UNIT).or_else(|| entry.get(UNIT))?.as_str()?;
    Some(match unit {
        "1" if limited(node)["type"] == "integer" => "integer".into(),
        "1" => "dimensionless".into(),
        unit => unit.into(),
    })
}

/// Its range in words.
pub fn range(node: &Value) -> String {
    let number = limited(node);
    let limit = |name: &str| number.get(name).and_then(Value::as_f64);
    let above_zero = limit("exclusiveMinimum").map(|_| ABOVE_ZERO.min);
    let min = limit("minimum").or(above_zero).unwrap_or(ANY.min);
    Limits { min, max: limit("maximum").unwrap_or(ANY.max) }.to_string()
}

/// The description that has the limits.
fn limited(node: &Value) -> &Value {
    let is_number = |node: &&Value| matches!(node["type"].as_str(), Some("number" | "integer"));
    let choice = node.get("anyOf").and_then(Value::as_array);
    let choice = choice.and_then(|choices| choices.iter().find(is_number));
    let entry = node.get("items").or_else(|| node.get("additionalProperties"));
    choice.or(entry.filter(|entry| entry.is_object())).unwrap_or(node)
}

/// What may be chosen, each with its sentence.
pub fn choices(node: &Value) -> Vec<(String, String)> {
    let lists = ["enum", "oneOf", "anyOf"].iter().filter_map(|name| Some((*name, node.get(name)?)));
    let mut all = Vec::new();
    for (name, list) in lists {
        for choice in list.as_array().into_iter().flatten() {
            let sentence = sentence(choice).to_string();
            if name == "enum" {
                all.push((choice.to_string(), String::new()));
            } else if let Some(value) = choice.get("const") {
                all.push((value.to_string(), sentence));
            } else if let Some(properties) = choice["properties"].as_object() {
                let fields =
                    properties.iter().map(|(name, node)| format!("{name} = {}", range(node)));
                all.push((format!("{{ {} }}", fields.collect::<Vec<_>>().join(", ")), sentence));
            } else {
                all.extend(choices(choice));
            }
        }
    }
    all
}
