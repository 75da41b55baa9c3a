//! What a soak found.

use std::time::Duration;

use serde_json::json;

use super::chaos::{RoleTally, Tally};

/// Growth of a process nobody kills that is still called flat.
const FLAT: f64 = 0.02;

pub struct Summary {
    pub wall: Duration,
    /// By what is killed in them.
    pub cells: [(&'static str, Tally); 2],
    /// What did not come back, or answer, or end in order.
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
        for (name, tally) in &self.cells {
            let of_cell = faults(tally).into_iter();
            reasons.extend(of_cell.map(|fault| format!("in the cell '{name}': {fault}")));
        }
        reasons
    }

    pub fn json(&self) -> serde_json::Value {
        let cells = self.cells.iter().map(|(name, tally)| (name.to_string(), cell_json(tally)));
        json!({
            "good": self.is_good(),
            "minutes": self.wall.as_secs_f64() / 60.0,
            "cells": cells.collect::<serde_json::Map<_, _>>(),
            "failures": self.reasons(),
            "left_over": self.left_over,
        })
    }

    pub fn text(&self) -> String {
        let mut text = format!("soaked for {:.1} min\n", self.wall.as_secs_f64() / 60.0);
        for (name, tally) in &self.cells {
            text += &match *name {
                "both" => "\ncontroller and learner killed\n".to_string(),
                _ => "\nlearner killed, controller left alone\n".to_string(),
            };
            text += &cell_text(tally);
        }
        text += "\n";
        for reason in self.reasons() {
            text += &format!("FAILED: {reason}\n");
        }
        if self.is_good() {
            text += "good: nothing lost, nothing twice, every session as if undisturbed\n";
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

fn cell_text(tally: &Tally) -> String {
    let ledger = &tally.ledger;
    let mut text = String::new();
    for (name, role) in [("controller", &tally.controller), ("learner", &tally.learner)] {
        if role.kills == 0 {
            continue;
        }
        let [p50, p99, max] = percentiles(role).map(|ms| format!("{ms:.0}"));
        text += &format!(
            "  {name:<11} {} kills, {} of them at its start; up again after p50 {p50}, p99 {p99}, \
             max {max} ms (n = {})\n",
            role.kills,
            role.at_start,
            role.restarts.len()
        );
    }
    text += &format!(
        "  sessions    {}, {} different from an undisturbed one; {} swaps, {} onlookers, \
         {} observers killed\n\
         \x20 episodes    {} produced, {} learnt, {} duplicated, {} lost, {} foreign\n",
        tally.sessions,
        tally.different,
        tally.swaps,
        tally.onlookers,
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

fn cell_json(tally: &Tally) -> serde_json::Value {
    let role = |role: &RoleTally| {
        let [p50, p99, max] = percentiles(role);
        json!({
            "kills": role.kills,
            "kills_at_start": role.at_start,
            "restarts": role.restarts.len(),
            "restart_ms": { "p50": p50, "p99": p99, "max": max },
        })
    };
    let ledger = &tally.ledger;
    let footprint = tally.footprint.trend().map(|[first, last]| {
        json!({
            "memory_mib": [first.memory_mib, last.memory_mib],
            "files": [first.files, last.files],
        })
    });
    json!({
        "controller": role(&tally.controller),
        "learner": role(&tally.learner),
        "sessions": tally.sessions,
        "sessions_different": tally.different,
        "swaps": tally.swaps,
        "onlookers": tally.onlookers,
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

/// p50, p99 and longest restart, ms; nearest rank.
fn percentiles(role: &RoleTally) -> [f64; 3] {
    let mut sorted = role.restarts.clone();
    sorted.sort_unstable();
    [0.5, 0.99, 1.0].map(|share| {
        let rank = (share * sorted.len() as f64).ceil() as usize;
        let restart = sorted.get(rank.saturating_sub(1)).copied().unwrap_or_default();
        1e3 * restart.as_secs_f64()
    })
}
