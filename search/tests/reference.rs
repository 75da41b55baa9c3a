//! What every method proposes after forty trials, bit for bit, as clients/python/tests/reference.json has it.
//! The Python package is tested against the same file: a seed means the same in both.
//!
//! A change of a search that is meant changes the file:
//! `SKILLET_WRITE_REFERENCE=1 cargo test -p search --test reference`.

use std::path::Path;

use nalgebra::{DMatrix, DVector};
use search::trial::Trial;
use search::{AskTell, Bounds, SearchConfig, Space, build};
use serde_json::{Value, json};

const TRIALS: u64 = 40;
const START: [f64; 3] = [0.25, -0.5, 0.125];
const LOW: [f64; 3] = [-2.0, -3.0, -1.5];
const HIGH: [f64; 3] = [2.5, 1.75, 3.0];
/// By rows.
const DIRECTIONS: [[f64; 2]; 3] = [[1.0, 0.25], [0.5, -1.0], [0.375, 0.5]];

const METHODS: [&str; 12] = [
    "power",
    "aim",
    "tempered",
    "regions",
    "niching",
    "algorithm1",
    "cem",
    "pi2",
    "rwr",
    "reinforce",
    "enac",
    "random",
];

fn file() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../clients/python/tests/reference.json")
}

/// 1 / (1 + ‖θ − 1‖²), by operations that every language rounds alike.
fn reward(theta: &DVector<f64>) -> f64 {
    let mut squares = 0.0;
    for value in theta.iter() {
        squares += (value - 1.0) * (value - 1.0);
    }
    1.0 / (1.0 + squares)
}

fn settings(method: &str) -> Value {
    match method {
        "aim" => json!({ "method": method, "aim": { "targets": [
            { "measure": "first", "min": 0.9, "max": 1.1, "scale": 0.5 },
            { "measure": "second", "when": "positive", "min": 0.8, "max": 1.2, "scale": 0.5 },
        ] } }),
        method => json!({ "method": method }),
    }
}

fn space(case: &Value) -> Space {
    let floats = |value: &Value| -> Vec<f64> { serde_json::from_value(value.clone()).unwrap() };
    let start = DVector::from_vec(floats(&case["start"]));
    let space = match case["directions"].as_array() {
        Some(rows) => {
            let entries: Vec<f64> = rows.iter().flat_map(floats).collect();
            let columns = entries.len() / start.len();
            Space::along(start, DMatrix::from_row_iterator(3, columns, entries)).unwrap()
        }
        None => Space::white(start),
    };
    let bounds = case["low"]
        .is_array()
        .then(|| Bounds::new(3, &floats(&case["low"]), &floats(&case["high"])).unwrap());
    Space { bounds, ..space }
}

/// Bits of the next proposal and of the mean after all trials.
fn outcome(case: &Value) -> (Vec<String>, Vec<String>) {
    let config: SearchConfig = serde_json::from_value(case["search"].clone()).unwrap();
    config.validate().unwrap();
    let seed = case["seed"].as_u64().unwrap();
    let mut desk = AskTell::new(build(&config, seed, space(case)));
    for rollout in 1..=TRIALS {
        let theta = desk.ask(rollout).theta;
        let measured = config.targets().iter().map(|target| match target.measure.as_str() {
            "first" => Some(theta[0]),
            _ => Some(theta[1]).filter(|_| theta[1] > 0.0),
        });
        let measured = measured.collect();
        let (reward, success) = (reward(&theta), theta[0] > 0.5);
        desk.tell(&Trial { rollout, theta, reward, success, measured }).unwrap();
    }
    let bits = |vector: &DVector<f64>| {
        vector.iter().map(|value| format!("{:016x}", value.to_bits())).collect()
    };
    (bits(&desk.ask(TRIALS + 1).theta), bits(desk.mean()))
}

fn cases() -> Vec<Value> {
    let mut cases = Vec::new();
    for (seed, method) in (1..).zip(METHODS) {
        let case = |box_known: bool, along: bool| {
            json!({
                "search": settings(method), "seed": seed, "start": START, "trials": TRIALS,
                "low": box_known.then_some(LOW), "high": box_known.then_some(HIGH),
                "directions": along.then_some(DIRECTIONS),
            })
        };
        cases.extend([case(true, false), case(true, true)]);
        if !["regions", "niching"].contains(&method) {
            cases.push(case(false, false));
        }
        if method == "regions" {
            // By default it fills the box all the while. Here it climbs, and bridges the groups that the
            // estimator finds on one hill.
            let mut filled = case(true, false);
            filled["search"]["regions"] = json!({ "n_fill": 20, "estimator": "dirichlet" });
            cases.push(filled);
        }
    }
    for case in &mut cases {
        let (next, mean) = outcome(case);
        case["next"] = json!(next);
        case["mean"] = json!(mean);
    }
    cases
}

#[test]
fn every_method_proposes_what_it_always_did() {
    let found = cases();
    if std::env::var_os("SKILLET_WRITE_REFERENCE").is_some() {
        let lines: Vec<String> = found.iter().map(Value::to_string).collect();
        std::fs::write(file(), format!("[\n{}\n]\n", lines.join(",\n"))).unwrap();
    }
    let text = std::fs::read_to_string(file()).unwrap();
    let stored: Vec<Value> = serde_json::from_str(&text).unwrap();
    assert_eq!(stored.len(), found.len());
    for (found, stored) in found.iter().zip(&stored) {
        assert_eq!(found, stored);
    }
}
