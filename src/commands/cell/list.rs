//! `skillet cell list`: the cells of this user and what runs in them.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Result;
use rustix::param::clock_ticks_per_second;
use serde_json::{Value, json};
use shm_types::cell::{Cell, Role, runtime_dir};
use shm_types::command::Status;
use shm_types::ports::ToolPorts;

use super::short;
use crate::Verdict;
use crate::output::{print, print_json};
use crate::watch::vitals::Presence;
use crate::{fields, health};

/// How long a controller may take to reply; all are asked at once.
const TIMEOUT: Duration = Duration::from_secs(1);

pub fn run(as_json: bool) -> Result<Verdict> {
    let cells = Cell::all_in(&runtime_dir());
    let rows: Vec<Row> = std::thread::scope(|scope| {
        let asked: Vec<_> =
            cells.into_iter().map(|cell| scope.spawn(move || Row::of(cell))).collect();
        asked.into_iter().filter_map(|row| row.join().ok()).collect()
    });
    if as_json {
        let rows: Vec<Value> = rows.iter().map(Row::json).collect();
        print_json(&json!({ "runtime_dir": runtime_dir(), "cells": rows }))?;
    } else if rows.is_empty() {
        print("no cell; start one with `skillet cell up NAME`\n")?;
    } else {
        print(&table(&rows))?;
    }
    Ok(Verdict::Done)
}

struct Row {
    name: String,
    controller: Presence,
    controller_pid: Option<u32>,
    learner: Presence,
    learner_pid: Option<u32>,
    session: Option<PathBuf>,
    status: Option<Status>,
}

impl Row {
    fn of(cell: Cell) -> Row {
        let is_there = cell.has(Role::Controller);
        let status =
            is_there.then(|| ToolPorts::open(&cell, TIMEOUT).ok()?.status(TIMEOUT)).flatten();
        let controller = match (is_there, &status) {
            (true, Some(_)) => Presence::Running,
            (true, None) => Presence::Silent,
            (false, _) => Presence::Absent,
        };
        let is_silent = status.is_some_and(|status| health::is_learner_silent(&status));
        let learner = match cell.has(Role::Learner) {
            true if is_silent => Presence::Silent,
            true => Presence::Running,
            false => Presence::Absent,
        };
        let pid = |role| cell.holder(role).map(|holder| holder.pid());
        Row {
            controller,
            controller_pid: pid(Role::Controller),
            learner,
            learner_pid: pid(Role::Learner),
            session: cell.session().filter(|_| learner != Presence::Absent),
            name: cell.name().to_string(),
            status,
        }
    }

    fn uptime_s(&self) -> Option<f64> {
        age_s(self.controller_pid?)
    }

    fn json(&self) -> Value {
        let status = self.status.as_ref();
        json!({
            "cell": self.name,
            "controller": self.controller.name(),
            "controller_pid": self.controller_pid,
            "controller_uptime_s": self.uptime_s(),
            "learner": self.learner.name(),
            "learner_pid": self.learner_pid,
            "session": self.session,
            "health": status.map(health::level),
            "active_policy": status.map(|status| fields::policy(&status.active)),
            "pinned": status.map(|status| status.pinned == 1),
            "rollouts_done": status.map(|status| status.rollouts_done),
        })
    }
}

/// Since the process was started.
fn age_s(pid: u32) -> Option<f64> {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The name of the program, in parentheses, may contain spaces; the start is the 22nd field.
    let start: f64 = stat.rsplit_once(')')?.1.split_whitespace().nth(19)?.parse().ok()?;
    let now = std::fs::read_to_string("/proc/uptime").ok()?;
    let now_s: f64 = now.split_whitespace().next()?.parse().ok()?;
    let age_s = now_s - start / clock_ticks_per_second() as f64;
    // The kernel counts hundredths of a second.
    Some((age_s.max(0.0) * 100.0).round() / 100.0)
}

fn table(rows: &[Row]) -> String {
    let width = rows.iter().map(|row| row.name.len()).max().unwrap_or(0).max(4);
    let mut text =
        format!("{:<width$}  controller        learner           health    session\n", "cell");
    for row in rows {
        let process = |presence: Presence, pid: Option<u32>| match pid {
            Some(pid) => format!("{} {pid}", presence.name()),
            None => presence.name().to_string(),
        };
        let health = row.status.map_or("–", |status| health::level(&status).name());
        let session = row.session.as_ref().map(|path| short(path).display().to_string());
        text += &format!(
            "{:<width$}  {:<16}  {:<16}  {health:<8}  {}\n",
            row.name,
            process(row.controller, row.controller_pid),
            process(row.learner, row.learner_pid),
            session.unwrap_or_else(|| "–".into())
        );
    }
    text
}
