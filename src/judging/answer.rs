//! What the learner and a judge's program say to each other: one line of JSON each way, a rollout at a time.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::{Map, Value, json};
use shm_types::measures::{Measure, Measures, TRUTH};

/// Bytes of the longest answer.
pub const MAX_BYTES: usize = 64 * 1024;
/// Characters of a program's words that are repeated.
const MAX_WORDS: usize = 300;

/// What a program makes of a rollout.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// Reward, success, and its own measures in the order of their names.
    Judged(Vec<f64>),
    /// It cannot judge this one, and says why.
    Declined(String),
}

/// The line that asks for a verdict; `path` names the file with the records.
pub fn request(rollout: u64, measures: &Measures, path: &str) -> Vec<u8> {
    let value = |measure: &Measure<'_>| match measure.is_truth() {
        true => json!(measure.value != 0.0),
        false => json!(measure.value),
    };
    let named = measures.iter().map(|measure| (measure.name.to_string(), value(&measure)));
    let line = json!({
        "rollout": rollout,
        "measures": named.collect::<Map<String, Value>>(),
        "path": path,
    });
    format!("{line}\n").into_bytes()
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    rollout: u64,
    reward: Option<f64>,
    #[serde(default)]
    success: bool,
    #[serde(default)]
    measures: BTreeMap<String, Value>,
    error: Option<String>,
}

/// The answer in `line` for `rollout`, of a program with the measures `own`; or what is wrong with it.
pub fn parse(line: &[u8], rollout: u64, own: &BTreeMap<String, String>) -> Result<Answer, String> {
    let mut said = read(line).map_err(|error| {
        format!(
            "it replied `{}`, which is not valid ({}): write one line of JSON per rollout to standard output, \
             and everything else to standard error",
            words(line),
            words(error.as_bytes())
        )
    })?;
    if said.rollout != rollout {
        return Err(format!(
            "it replied for rollout {} instead of {rollout}: reply to every line once, before the next",
            said.rollout
        ));
    }
    if let Some(error) = said.error {
        return Ok(Answer::Declined(words(error.as_bytes())));
    }
    let reward = said.reward.ok_or("its reply has no `reward`: give a finite number")?;
    let mut values = vec![finite("reward", reward)?, f64::from(u8::from(said.success))];
    for (name, unit) in own {
        let value = said.measures.remove(name).ok_or_else(|| {
            format!("its reply lacks the measure {name}, which task.judge.measures declares")
        })?;
        values.push(number(name, unit, &value)?);
    }
    match said.measures.first_key_value() {
        Some((name, _)) => Err(format!(
            "its reply has a measure `{}`, which task.judge.measures does not declare: add it there with its \
             unit",
            words(name.as_bytes())
        )),
        None => Ok(Answer::Judged(values)),
    }
}

/// An object; serde would take a list for one as well.
fn read(line: &[u8]) -> Result<Line, String> {
    match line.trim_ascii_start().first() {
        Some(b'{') => serde_json::from_slice(line).map_err(|error| error.to_string()),
        _ => Err("it is not an object".into()),
    }
}

fn number(name: &str, unit: &str, value: &Value) -> Result<f64, String> {
    let number = match (value, unit) {
        (Value::Bool(truth), TRUTH) => Some(f64::from(u8::from(*truth))),
        (value, TRUTH) => value.as_f64().filter(|number| [0.0, 1.0].contains(number)),
        (value, _) => value.as_f64(),
    };
    let wanted = if unit == TRUTH { "true or false" } else { "a finite number" };
    let given = || words(value.to_string().as_bytes());
    let number = number
        .ok_or_else(|| format!("it replied {} for the measure {name}: give {wanted}", given()))?;
    finite(name, number)
}

fn finite(name: &str, number: f64) -> Result<f64, String> {
    match number.is_finite() {
        true => Ok(number),
        false => Err(format!("it replied {number} for {name}: give a finite number")),
    }
}

/// Words of a program as they may be shown: text alone, and not too much of it.
pub fn words(bytes: &[u8]) -> String {
    // A character has at most four bytes.
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(4 * (MAX_WORDS + 1))]);
    let plain = text.trim().chars().map(|c| if c.is_control() { ' ' } else { c });
    let mut words: String = plain.take(MAX_WORDS + 1).collect();
    if let Some((end, _)) = words.char_indices().nth(MAX_WORDS) {
        words.replace_range(end.., "…");
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    fn own() -> BTreeMap<String, String> {
        [("gap_m", "m"), ("straight", TRUTH)].map(|(n, u)| (n.to_string(), u.to_string())).into()
    }

    fn of(line: &str) -> Result<Answer, String> {
        parse(line.as_bytes(), 12, &own())
    }

    #[test]
    fn a_request_is_a_line_that_a_program_can_read() {
        let measures =
            [Measure { name: "apex_m", unit: "m", value: 0.1 }, Measure::truth("caught", true)];
        let line = request(12, &Measures::of(measures).unwrap(), "/a \"b\"/rollout.npy");
        assert_eq!(line.iter().filter(|byte| **byte == b'\n').count(), 1);
        let read: Value = serde_json::from_slice(&line).unwrap();
        let expected = json!({
            "rollout": 12,
            "measures": { "apex_m": 0.1, "caught": true },
            "path": "/a \"b\"/rollout.npy"
        });
        assert_eq!(read, expected);
    }

    #[test]
    fn an_answer_keeps_every_bit() {
        let measures = r#""measures": {"straight": true, "gap_m": 0.30000000000000004}"#;
        let line = format!(r#"{{"rollout": 12, "reward": -1, "success": true, {measures}}}"#);
        assert_eq!(of(&line), Ok(Answer::Judged(vec![-1.0, 1.0, 0.1 + 0.2, 1.0])));
        let plain = parse(br#" {"reward":1e-3,"rollout":12} "#, 12, &BTreeMap::new());
        assert_eq!(plain, Ok(Answer::Judged(vec![0.001, 0.0])));
        let declined = of(r#"{"rollout": 12, "error": "covered\u001b[2J"}"#);
        assert_eq!(declined, Ok(Answer::Declined("covered [2J".into())));
    }

    #[test]
    fn what_is_no_answer_is_said_in_words() {
        let measured = |measures: &str| {
            format!(r#"{{"rollout": 12, "reward": 1, "measures": {{{measures}}}}}"#)
        };
        for (line, word) in [
            ("hello".to_string(), "`hello`, which is not valid"),
            (String::new(), "not valid"),
            ("[12, 1, true, {}, null]".into(), "not an object"),
            (r#"{"rollout": 12, "reward": NaN}"#.into(), "not valid"),
            (r#"{"rollout": 12, "reward": 1e999}"#.into(), "not valid"),
            (r#"{"rollout": 12, "reward": true}"#.into(), "not valid"),
            (r#"{"rollout": 12, "reward": 1, "sucess": true}"#.into(), "`sucess`"),
            (r#"{"rollout": 11, "reward": 1}"#.into(), "rollout 11 instead of 12"),
            (r#"{"rollout": 12}"#.into(), "no `reward`"),
            (measured(r#""gap_m": 1"#), "lacks the measure straight"),
            (measured(r#""gap_m": null, "straight": 1"#), "null for the measure gap_m"),
            (measured(r#""gap_m": 1, "straight": 0.5"#), "give true or false"),
            (measured(r#""gap_m": true, "straight": true"#), "give a finite number"),
            (measured(r#""gap_m": 1, "straight": 1, "gap": 1"#), "a measure `gap`"),
        ] {
            let error = of(&line).unwrap_err();
            assert!(error.contains(word), "{line}: {error}");
        }
    }

    #[test]
    fn a_flood_of_words_is_cut() {
        assert_eq!(words(b" two\nlines "), "two lines");
        assert_eq!(words(&[b'x'; 300]), "x".repeat(300));
        assert_eq!(words(&[b'x'; 9000]), format!("{}…", "x".repeat(300)));
        assert_eq!(words("ä".repeat(9000).as_bytes()).chars().count(), 301);
    }
}
