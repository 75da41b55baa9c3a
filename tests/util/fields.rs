//! What docs/json.md says about the fields of an object, and whether the object is so.

use std::collections::BTreeMap;

use serde_json::Value;

/// Fields of an object, by name, with type and whether they may be missing.
type Fields = BTreeMap<String, (String, bool)>;

pub struct JsonPage {
    sections: BTreeMap<String, Fields>,
}

impl JsonPage {
    pub fn read() -> JsonPage {
        JsonPage::of(include_str!("../../docs/json.md"))
    }

    pub fn of(text: &str) -> JsonPage {
        let (mut sections, mut heading) = (BTreeMap::<String, Fields>::new(), String::new());
        for line in text.lines() {
            if let Some(title) = line.strip_prefix("### ") {
                heading = title.replace('`', "");
                sections.insert(heading.clone(), Fields::new());
            } else if let Some(row) = line.strip_prefix("| `") {
                let cells: Vec<&str> = row.split(" | ").collect();
                let field = cells[0].trim_end_matches('`').to_string();
                let (kind, is_optional) = match cells[1].strip_suffix(", optional") {
                    Some(kind) => (kind, true),
                    None => (cells[1], false),
                };
                let fields = sections.get_mut(&heading).expect("a table has a heading");
                assert!(!fields.contains_key(&field), "{heading}: {field} is there twice");
                fields.insert(field, (kind.to_string(), is_optional));
            }
        }
        JsonPage { sections }
    }

    pub fn headings(&self) -> impl Iterator<Item = &str> {
        self.sections.keys().map(String::as_str)
    }

    /// Everything in which `object` is not as the section says.
    pub fn faults(&self, section: &str, object: &Value) -> Vec<String> {
        let mut faults = Vec::new();
        let Some(fields) = self.sections.get(section) else {
            return vec![format!("docs/json.md has no section {section}")];
        };
        if object["schema"] != 1 {
            faults.push("schema is not 1".to_string());
        }
        self.look(fields, "", object, &mut faults);
        faults.iter().map(|fault| format!("{section}: {fault}")).collect()
    }

    /// `at` is where `object` is, as `a.` or `a[].`.
    fn look(&self, fields: &Fields, at: &str, object: &Value, faults: &mut Vec<String>) {
        let Some(object) = object.as_object() else {
            return faults.push(format!("{at} is no object"));
        };
        let is_version = |name: &str| at.is_empty() && name == "schema";
        for (name, value) in object.iter().filter(|(name, _)| !is_version(name)) {
            let (path, elements) = (format!("{at}{name}"), format!("{at}{name}[]"));
            if let Some((kind, _)) = fields.get(&path) {
                self.check(fields, &path, kind, value, faults);
            } else if let (Some((kind, _)), Some(values)) =
                (fields.get(&elements), value.as_array())
            {
                values.iter().for_each(|value| self.check(fields, &elements, kind, value, faults));
            } else {
                faults.push(format!("{path} is not documented"));
            }
        }
        let below = fields.iter().filter_map(|(path, (_, is_optional))| {
            let name = path.strip_prefix(at)?.trim_end_matches("[]");
            (!name.contains('.') && !is_optional).then_some(name)
        });
        for name in below.filter(|name| !object.contains_key(*name)) {
            faults.push(format!("{at}{name} is missing"));
        }
    }

    fn check(
        &self,
        fields: &Fields,
        path: &str,
        kind: &str,
        value: &Value,
        faults: &mut Vec<String>,
    ) {
        if value.is_null() && kind.ends_with(" or null") {
            return;
        }
        let is_right = match kind.trim_end_matches(" or null") {
            "text" => value.is_string(),
            "integer" => value.is_i64() || value.is_u64(),
            "number" => value.is_number(),
            "boolean" => value.is_boolean(),
            "list" => value.is_array(),
            "map" => value.is_object(),
            "object" => {
                self.look(fields, &format!("{path}."), value, faults);
                value.is_object()
            }
            shared => match self.sections.get(shared) {
                Some(fields) => {
                    let before = faults.len();
                    self.look(fields, "", value, faults);
                    faults.len() == before
                }
                None => false,
            },
        };
        if !is_right {
            faults.push(format!("{path} is not {kind}: {value}"));
        }
        if has_artefact(value) {
            faults.push(format!("{path} has an artefact of arithmetic: {value}"));
        }
    }
}

/// Such as 1.4000000000000001 or 0.30000000000000004: nearly short.
fn has_artefact(value: &Value) -> bool {
    let text = value.to_string();
    let digits = text.split(['e', 'E']).next().unwrap_or_default();
    value.is_f64()
        && digits.len() > 16
        && (digits.contains("00000000") || digits.contains("99999999"))
}
