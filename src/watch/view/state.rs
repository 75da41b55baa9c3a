//! The block at the top: health with what to do, learner, policy, timing.

use ratatui::style::{Color, Style, Stylize};
use ratatui::text::{Line, Span};
use shm_types::command::{PLANT_ABSENT, Status};

use super::flow::{flow, words};
use crate::fields::phase;
use crate::health::{self, Health, SILENT};
use crate::watch::vitals::Presence;
use crate::watch::words::pace;
use crate::watch::{Model, Percentiles};

/// Lines that fit into `width`.
pub fn lines(model: &Model, lost: u64, width: usize) -> Vec<Line<'static>> {
    let known = match model.vitals.status() {
        Some(status) => known(model, lost, &status, width),
        None => Vec::new(),
    };
    match model.vitals.controller() {
        Presence::Running if known.is_empty() => vec!["waiting for the controller …".into()],
        Presence::Running => known,
        _ => {
            // What was known of it is shown for what it is.
            let finding = findings(model).unwrap_or_default();
            let finding = flow("health   ", words(&finding), " ", width);
            let age = model.vitals.status_age().map(|age| age.as_secs_f64());
            let stale = age.map(|age| Line::from(format!("as it was {age:.1} s ago:")).yellow());
            let known = known.into_iter().map(|line| line.patch_style(Style::default().dim()));
            finding.into_iter().map(|line| line.red().bold()).chain(stale).chain(known).collect()
        }
    }
}

/// Why the cell is not well, and who waits for what.
fn findings(model: &Model) -> Option<String> {
    let (_, mut findings) = model.vitals.health()?;
    if let Some(status) = model.vitals.status() {
        findings.extend(health::notes(&status, &model.cell));
    }
    (!findings.is_empty()).then(|| findings.join("; "))
}

fn known(model: &Model, lost: u64, status: &Status, width: usize) -> Vec<Line<'static>> {
    let health = health::level(status);
    let color = match health {
        Health::Ok => Color::Green,
        Health::Degraded => Color::Yellow,
        Health::Bad => Color::Red,
    };
    let mut first: Vec<Vec<Span>> = vec![vec![health.name().fg(color).bold()]];
    first.extend(loop_words(model, status).into_iter().map(|text| vec![text.into()]));
    let mut lines = flow("health   ", first, "  ", width);
    if model.vitals.controller() == Presence::Running
        && let Some(text) = findings(model)
    {
        let found = flow("         ", words(&text), " ", width);
        lines.extend(found.into_iter().map(|line| line.fg(color)));
    }
    let plain = |label, parts: Vec<String>| {
        flow(label, parts.into_iter().map(|part| vec![part.into()]).collect(), "  ", width)
    };
    let pinned = if status.pinned == 1 { ", pinned" } else { "" };
    lines.extend(plain("learner  ", learner_words(model, status)));
    lines.extend(plain(
        "policy   ",
        vec![
            format!("in the loop {}", status.in_loop.describe()),
            format!("active {}{pinned}", status.active.describe()),
            format!("last good {}", status.last_good.describe()),
        ],
    ));
    let (wakeup, tick) = model.times();
    let missed = format!("{} deadlines missed", model.last.missed);
    lines.extend(plain("wake-up  ", times(&wakeup, status.is_paced(), Some(missed))));
    // Telemetry that passes the bridge is thinned out.
    let unseen = model.bridged.is_none().then(|| format!("{lost} ticks missed"));
    lines.extend(plain("tick     ", times(&tick, true, unseen)));
    lines
}

fn loop_words(model: &Model, status: &Status) -> Vec<String> {
    let now = model.last.record.tick;
    let ticked = match model.vitals.tick_age() {
        Some(age) if age >= SILENT => format!("tick {now} ({:.1} s ago)", age.as_secs_f64()),
        Some(_) => format!("tick {now}"),
        None => "no tick yet".into(),
    };
    let plant = (status.plant == PLANT_ABSENT).then(|| "no plant".to_string());
    let phase = phase(model.last.record.phase).to_string();
    [pace(status).to_string()].into_iter().chain(plant).chain([ticked, phase]).collect()
}

fn learner_words(model: &Model, status: &Status) -> Vec<String> {
    let heard = match model.vitals.learner_age() {
        Some(age) => format!(", heard {:.1} s ago", age.as_secs_f64()),
        None => String::new(),
    };
    let full = if status.spool_full == 1 { " (full)" } else { "" };
    vec![
        format!("{}{heard}", model.vitals.learner().name()),
        format!("spool {}{full}", status.spooled),
    ]
}

fn times(times: &Percentiles, is_known: bool, more: Option<String>) -> Vec<String> {
    let Percentiles { p50, p99, max } = times;
    let mut all = match is_known {
        true => vec![format!("p50 {p50:.1}"), format!("p99 {p99:.1}"), format!("max {max:.1} µs")],
        false => vec!["not paced by the wall clock".into()],
    };
    all.extend(more);
    all
}
