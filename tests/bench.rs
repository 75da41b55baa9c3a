//! `skillet bench`: every bench runs and reports its measurements. Speed is not tested.

mod util;

use serde_json::Value;
use util::{Bench, text};

/// Runs a bench for a moment; returns its rows after looking at each.
fn rows(bench: &Bench, name: &str, seconds: &str) -> Vec<Value> {
    let arguments = ["bench", name, "--json", "--seconds", seconds, "--rounds", "1", "--out", "r"];
    let found: Value = serde_json::from_str(&bench.ok(&arguments)).unwrap();
    assert_eq!(found["bench"], name);
    assert!(found["host"]["cores"].as_u64().unwrap() >= 1);
    let rows = found["rows"].as_array().unwrap().clone();
    assert!(!rows.is_empty());
    for row in &rows {
        for field in ["name", "scenario", "unit"] {
            assert!(row[field].as_str().is_some_and(|text| !text.is_empty()), "{row}");
        }
        assert!(row["n"].as_u64().unwrap() > 0, "{row}");
        assert!(row["misses"].is_null() || row["misses"].is_u64(), "{row}");
        let values = ["p50", "p99", "p999", "max"].map(|field| row[field].as_f64().unwrap());
        assert!(values.iter().all(|value| value.is_finite() && *value > 0.0), "{row}");
        assert!(values.is_sorted(), "{row}");
    }

    let file: Value = serde_json::from_str(&text(&bench.path(&format!("r/{name}.json")))).unwrap();
    assert_eq!(file, found);
    let page = text(&bench.path(&format!("r/{name}.html")));
    assert!(page.contains("<svg") && !page.contains("<script") && !page.contains("http"));
    assert!(!page.contains("NaN"));
    rows
}

fn names<'a>(rows: &'a [Value], field: &str) -> Vec<&'a str> {
    rows.iter().map(|row| row[field].as_str().unwrap()).collect()
}

#[test]
fn tick_measures_every_part_and_every_size() {
    let bench = Bench::new();
    let rows = rows(&bench, "tick", "0.3");
    let whole: Vec<&Value> = rows.iter().filter(|row| row["name"] == "whole tick").collect();
    assert_eq!(whole.len(), 16, "springs of every size, and a field of the state");
    for part in ["timer", "policy command", "mass matrix", "operational-space torque"] {
        assert!(names(&rows, "name").contains(&part), "no {part}");
    }
    // A tick calls all of its parts.
    let p50 =
        |name: &str| rows.iter().find(|row| row["name"] == name).unwrap()["p50"].as_f64().unwrap();
    assert!(p50("whole tick") > p50("gravity torque"));
}

#[test]
fn sim_compares_one_core_with_all() {
    let bench = Bench::new();
    let rows = rows(&bench, "sim", "0.3");
    assert_eq!(rows.len(), 20);
    for scenario in [
        "multibody, 1 sub-step",
        "multibody, 2 sub-steps",
        "multibody, 4 sub-steps",
        "split, 2 sub-steps",
        "split, 4 sub-steps",
    ] {
        let found = names(&rows, "scenario");
        assert_eq!(found.iter().filter(|name| **name == scenario).count(), 4);
    }
}

#[test]
fn transport_measures_each_way_with_both_sizes_and_leaves_nothing() {
    let bench = Bench::new();
    if std::thread::available_parallelism().unwrap().get() < 2 {
        bench.refused(&["bench", "transport"], &["second one"]);
        return;
    }
    let rows = rows(&bench, "transport", "0.3");
    assert_eq!(rows.len(), 12);
    for link in ["iceoryx2", "socket", "pipe"] {
        for how in ["polling", "waking"] {
            let name = format!("{link}, {how}");
            assert_eq!(rows.iter().filter(|row| row["name"] == name.as_str()).count(), 2);
        }
    }
    let cells = std::fs::read_dir(bench.path("run")).unwrap().flatten();
    assert_eq!(cells.filter(|entry| entry.path().is_dir()).count(), 0, "a cell is left");
}

#[test]
fn without_json_there_is_a_table_and_senseless_times_are_refused() {
    let bench = Bench::new();
    let table = bench.ok(&["bench", "tick", "--seconds", "0.1", "--rounds", "1"]);
    for word in ["p99.9", "misses", "clock source", "16 components, 6 dims"] {
        assert!(table.contains(word), "no '{word}' in:\n{table}");
    }
    bench.refused(&["bench", "tick", "--seconds", "0"], &["number of seconds"]);
    bench.refused(&["bench", "tick", "--seconds", "nan"], &["number of seconds"]);
}

#[test]
fn latency_sees_the_loop_under_every_disturbance_and_loses_no_swap() {
    let bench = Bench::new();
    let rows = rows(&bench, "latency", "4");
    let of = |name: &str| -> Vec<&Value> { rows.iter().filter(|r| r["name"] == name).collect() };
    for name in ["wake-up, controller", "wake-up, bare loop", "tick"] {
        assert_eq!(of(name).len(), 6, "{name}");
    }
    let swaps = of("published to applied");
    let scenarios: Vec<_> = swaps.iter().map(|row| row["scenario"].as_str().unwrap()).collect();
    assert_eq!(scenarios, ["100 swaps a second", "storm"]);
    for row in swaps {
        assert_eq!(row["misses"], 0, "{row}");
    }
}

#[test]
fn swap_checks_each_of_so_many_swaps() {
    let bench = Bench::new();
    let arguments = ["bench", "swap", "--swaps", "300", "--json"];
    let found: Value = serde_json::from_str(&bench.ok(&arguments)).unwrap();
    let rows = found["rows"].as_array().unwrap();
    for row in &rows[..2] {
        assert_eq!((&row["n"], &row["misses"]), (&300.into(), &0.into()), "{row}");
    }
    assert_eq!(rows[2]["name"], "controller, resident");
}
