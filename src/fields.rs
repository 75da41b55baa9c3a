//! Fields of JSON output that several commands share: one word and one form for the same thing; see docs/json.md.

use anyhow::{Result, bail};
use serde::Serialize;
use serde_json::{Value, json};
use shm_types::measures::Measure;
use shm_types::policy::PolicyName;

/// Version of all JSON output; raised when a field is renamed, removed or changes its meaning.
pub const SCHEMA: u32 = 1;

const PHASES: [&str; 4] = ["idle", "approach", "execute", "settle"];

/// `value`, which is an object, with the version in it.
pub fn versioned(value: &impl Serialize) -> Result<Value> {
    match serde_json::to_value(value)? {
        Value::Object(mut fields) => {
            fields.insert("schema".into(), SCHEMA.into());
            Ok(Value::Object(fields))
        }
        other => bail!("JSON output is an object, not {other}"),
    }
}

/// An id, which JavaScript could not hold as a number.
pub fn id(id: u64) -> String {
    format!("{id:016x}")
}

/// Names a policy of a cell's catalogue or of a session; null if it names none.
pub fn policy(name: &PolicyName) -> Value {
    if name.is_none() {
        return Value::Null;
    }
    let session = (name.session != 0).then_some(name);
    json!({
        "policy_id": name.policy_id,
        "session_id": session.map(|name| id(name.session)),
        "rollout": session.map(|name| name.rollout),
        "policy_digest": id(name.digest),
    })
}

/// Phases of the loop, by number.
pub fn phase(phase: impl TryInto<usize>) -> &'static str {
    let number = phase.try_into().ok();
    number.and_then(|number| PHASES.get(number)).copied().unwrap_or("unknown")
}

/// What was measured: a number, or whether something happened.
pub fn measure(measure: &Measure<'_>) -> Value {
    if measure.is_truth() { json!(measure.value != 0.0) } else { json!(measure.value) }
}

/// Percentiles of a distribution of times, µs.
pub fn times_us(p50_ns: u64, p99_ns: u64, max_ns: u64) -> Value {
    json!({ "p50": us(p50_ns), "p99": us(p99_ns), "max": us(max_ns) })
}

/// `value`, whose numbers are results of arithmetic: of their digits the first 12 are kept.
pub fn short(value: Value) -> Value {
    match value {
        Value::Number(number) if number.is_f64() => {
            let rounded = number.as_f64().and_then(|number| format!("{number:.11e}").parse().ok());
            rounded.map_or(Value::Number(number), |rounded: f64| json!(rounded))
        }
        Value::Array(values) => values.into_iter().map(short).collect(),
        Value::Object(fields) => {
            fields.into_iter().map(|(name, value)| (name, short(value))).collect()
        }
        other => other,
    }
}

// Divisions: their results are the closest numbers, which print short. 1400 * 1e-3 is 1.4000000000000001.

pub fn us(ns: u64) -> f64 {
    ns as f64 / 1e3
}

pub fn ms(ns: u64) -> f64 {
    ns as f64 / 1e6
}

pub fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_print_short() {
        for ns in (0..3_000_000).step_by(7) {
            let text = json!([us(ns), ms(ns), seconds(ns)]).to_string();
            let digits = |number: &str| number.chars().filter(char::is_ascii_digit).count();
            assert!(text.split(',').all(|number| digits(number) <= 12), "{text}");
        }
        assert_eq!(us(1400).to_string(), "1.4");
        let sums =
            json!({ "a": [7.0 * 0.2, -2.5e-9, 0.0], "b": u64::MAX, "c": "1.40000000000000001" });
        assert_eq!(
            short(sums),
            json!({ "a": [1.4, -2.5e-9, 0.0], "b": u64::MAX, "c": "1.40000000000000001" })
        );
    }

    #[test]
    fn objects_have_a_version_and_nothing_else_is_printed() {
        assert_eq!(versioned(&json!({ "a": 1 })).unwrap(), json!({ "schema": 1, "a": 1 }));
        assert!(versioned(&json!([1])).is_err());
    }
}
