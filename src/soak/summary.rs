//! What a soak found.

use std::time::Duration;

use serde_json::{Map, Value, json};

use super::ordeal::{Ordeal, kill_name};
use super::tally::Tally;

/// Growth of a process that still counts as flat.
const FLAT: f64 = 0.02;

pub struct Summary {
    pub wall: Duration,
    pub cells: Vec<(Ordeal, Tally)>,
    /// Processes that did not come back, respond or end cleanly.
    pub failures: Vec<String>,
    /// Shared memory and locks that should be gone.
    pub left_over: Vec<String>,
}

impl Summary {
    pub fn is_good(&self) -> bool {
        self.reasons().is_empty()
    }

    /// Everything that makes it a failure, in words.
    fn reasons(&self) -> Vec<String> {
        let mut reasons = self.failures.clone();
        reasons.extend(self.left_over.iter().map(|path| format!("left over: {path}")));
        for (ordeal, tally) in &self.cells {
            let (name, of_cell) = (ordeal.name(), faults(tally).into_iter());
            reasons.extend(of_cell.map(|fault| format!("in the cell '{name}': {fault}")));
        }
        reasons
    }

    pub fn json(&self) -> Value {
        let cells = self
            .cells
            .iter()
            .map(|(ordeal, tally)| (ordeal.name().to_string(), cell_json(*ordeal, tally)));
        json!({
            "passed": self.is_good(),
            "minutes": self.wall.as_secs_f64() / 60.0,
            "cells": cells.collect::<Map<_, _>>(),
            "failures": self.reasons(),
            "left_over": self.left_over,
        })
    }

    pub fn text(&self) -> String {
        let mut text = format!("soaked for {:.1} min\n", self.wall.as_secs_f64() / 60.0);
        for (ordeal, tally) in &self.cells {
            text += &format!("\n{}\n{}", ordeal.title(), cell_text(*ordeal, tally));
        }
        text += "\n";
        for reason in self.reasons() {
            text += &format!("FAILED: {reason}\n");
        }
        if self.is_good() {
            text += "passed: nothing lost or duplicated, every session identical to an undisturbed one\n";
        }
        text
    }
}

/// What should not have happened in a cell.
fn faults(tally: &Tally) -> Vec<String> {
    let ledger = &tally.ledger;
    let mut faults: Vec<String> = [
        (tally.different, "sessions differ from an undisturbed run of the same seed"),
        (ledger.lost, "episodes were durable and never learnt"),
        (ledger.duplicated, "episodes were executed more than once"),
        (ledger.foreign, "episodes were learnt from another start of the controller"),
        (ledger.produced.abs_diff(ledger.learnt), "more episodes on one side than on the other"),
    ]
    .into_iter()
    .filter(|(n, _)| *n > 0)
    .map(|(n, what)| format!("{n} {what}"))
    .collect();
    if let Some([first, last]) = tally.footprint.trend() {
        let growth = 100.0 * (last.memory_mib / first.memory_mib - 1.0);
        if growth > 100.0 * FLAT {
            let limit = 100.0 * FLAT;
            faults.push(format!(
                "the controller's memory grew by {growth:.1} % (limit {limit:.0} %)"
            ));
        }
        if last.files > first.files {
            let (first, last) = (first.files, last.files);
            faults.push(format!("the controller's open files grew from {first} to {last}"));
        }
    }
    faults
}

fn cell_text(ordeal: Ordeal, tally: &Tally) -> String {
    let ledger = &tally.ledger;
    let mut text = String::new();
    for &role in ordeal.services().iter().filter(|role| !ordeal.spares(**role)) {
        let (name, role) = (role.name(), tally.of(role));
        text += &format!(
            "  {name:<11} {} kills, {} of them at its start; up again after {}\n",
            role.kills,
            role.at_start,
            times(&role.restarts)
        );
    }
    text += &format!("  kills       {}\n", tally.kills_in_words());
    if ordeal.has_plant() {
        text += &format!(
            "  arm held    after a plant's death: {}; {} re-arms accepted, {} refused\n",
            times(&tally.holds),
            tally.rearms.accepted,
            tally.rearms.refused
        );
    }
    text += &format!(
        "  sessions    {}, {} different from an undisturbed one; {} swaps, {} observers, \
         {} observers killed\n\
         \x20 episodes    {} produced, {} learnt, {} duplicated, {} lost, {} foreign\n",
        tally.sessions,
        tally.different,
        tally.swaps,
        tally.observers,
        tally.observers_killed,
        ledger.produced,
        ledger.learnt,
        ledger.duplicated,
        ledger.lost,
        ledger.foreign
    );
    if let (Some([first, last]), Some(most)) = (tally.footprint.trend(), tally.footprint.most()) {
        text += &format!(
            "  footprint   {:.1} -> {:.1} MiB ({:+.1} %), {} -> {} files; most {:.1} MiB, {}\n",
            first.memory_mib,
            last.memory_mib,
            100.0 * (last.memory_mib / first.memory_mib - 1.0),
            first.files,
            last.files,
            most.memory_mib,
            most.files
        );
    }
    text
}

fn cell_json(ordeal: Ordeal, tally: &Tally) -> Value {
    let mut cell = outcome_json(tally);
    for role in ordeal.services() {
        let of = tally.of(*role);
        cell[role.name()] = json!({
            "kills": of.kills,
            "kills_at_start": of.at_start,
            "restarts": of.restarts.len(),
            "restart_ms": times_json(&of.restarts),
        });
    }
    let kills = tally.kills.iter().map(|(kill, n)| (kill_name(kill), json!(n)));
    cell["kills"] = Value::Object(kills.collect());
    if ordeal.has_plant() {
        cell["holds"] = json!({ "seen": tally.holds.len(), "after_ms": times_json(&tally.holds) });
        cell["rearms"] =
            json!({ "accepted": tally.rearms.accepted, "refused": tally.rearms.refused });
    }
    cell
}

fn outcome_json(tally: &Tally) -> Value {
    let ledger = &tally.ledger;
    let footprint = tally.footprint.trend().map(|[first, last]| {
        json!({
            "memory_mib": [first.memory_mib, last.memory_mib],
            "files": [first.files, last.files],
        })
    });
    json!({
        "sessions": tally.sessions,
        "sessions_different": tally.different,
        "swaps": tally.swaps,
        "observers": tally.observers,
        "observers_killed": tally.observers_killed,
        "episodes": {
            "produced": ledger.produced,
            "learnt": ledger.learnt,
            "duplicated": ledger.duplicated,
            "lost": ledger.lost,
            "foreign": ledger.foreign,
        },
        "controller_footprint": footprint,
    })
}

pub fn times(times: &[Duration]) -> String {
    let [p50, p99, max] = percentiles(times);
    format!("p50 {p50:.0}, p99 {p99:.0}, max {max:.0} ms (n = {})", times.len())
}

pub fn times_json(times: &[Duration]) -> Value {
    let [p50, p99, max] = percentiles(times);
    json!({ "p50": p50, "p99": p99, "max": max })
}

/// p50, p99 and the longest, ms; nearest rank.
fn percentiles(times: &[Duration]) -> [f64; 3] {
    let mut sorted = times.to_vec();
    sorted.sort_unstable();
    [0.5, 0.99, 1.0].map(|share| {
        let rank = (share * sorted.len() as f64).ceil() as usize;
        let time = sorted.get(rank.saturating_sub(1)).copied().unwrap_or_default();
        1e3 * time.as_secs_f64()
    })
}
