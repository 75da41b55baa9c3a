//! What the terminal shows.

use std::time::Duration;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style, Stylize};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Block, Chart, Dataset, GraphType, Paragraph, Row, Table, Wrap};
use rt_controller::fault::Fault;
use shm_types::command::{PACE_MAX, PACE_PLANT, PLANT_ABSENT, Status};

use super::keys::Prompt;
use super::session::Trial;
use super::vitals::Presence;
use super::{Model, Percentiles};
use crate::health::{self, Health, SILENT};

/// Trials follow each other within this time, at the wall clock, too.
const OLD: Duration = Duration::from_secs(10);
const PHASES: [&str; 4] = ["idle", "approach", "execute", "settle"];
const MODE_COLUMNS: [Constraint; 5] = [
    Constraint::Length(4),
    Constraint::Length(7),
    Constraint::Length(8),
    Constraint::Length(14),
    Constraint::Min(9),
];

/// `lost` ticks were not seen.
pub fn draw(frame: &mut Frame, model: &Model, lost: u64, prompt: &Prompt) {
    let modes = model.session.modes.len().max(1) as u16 + 3;
    let notes = model.notes.len() as u16;
    // What a person is to do must not be cut off.
    let inner = frame.area().width.saturating_sub(2).max(1);
    let found = findings(model).map_or(0, |text| (text.len() as u16).div_ceil(inner));
    let rows = Layout::vertical([
        Constraint::Length(7 + found),
        Constraint::Min(6),
        Constraint::Length(modes.min(8)),
        Constraint::Length(notes),
        Constraint::Length(1),
    ]);
    let [top, curve, table, noted, bottom] = rows.areas(frame.area());
    frame.render_widget(state(model, lost), top);
    reward(frame, model, curve);
    frame.render_widget(modes_table(model), table);
    let lines: Vec<Line> = model.notes.iter().map(|note| Line::from(note.as_str()).dim()).collect();
    frame.render_widget(Paragraph::new(lines), noted);
    frame.render_widget(Paragraph::new(bottom_line(prompt)), bottom);
}

fn bottom_line(prompt: &Prompt) -> Line<'static> {
    match prompt {
        Prompt::None => {
            let keys = [
                ("a", " activate  "),
                ("p", " pin/unpin  "),
                ("r", " roll back  "),
                ("h", " hold  "),
                ("e", " re-arm  "),
                ("q", " quit  "),
                ("0-9 + - w", " rate"),
            ];
            Line::from(
                keys.into_iter()
                    .flat_map(|(key, what)| [key.bold(), what.into()])
                    .collect::<Vec<Span>>(),
            )
        }
        Prompt::Number(typed) => {
            Line::from(format!("activate policy number: {typed}▏  Enter, Esc")).yellow()
        }
        Prompt::Rating(typed) => {
            Line::from(format!("rating from 0 to 10: {typed}▏  Enter, Esc")).yellow()
        }
        Prompt::Sure(action) => Line::from(format!("{action:?}? y, or any other key")).yellow(),
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

fn state(model: &Model, lost: u64) -> Paragraph<'static> {
    let bridge = match (&model.bridged, model.vitals.via()) {
        (Some(bridged), _) => {
            format!("through the bridge to {}, {} Hz, not every tick ", bridged.host, bridged.hz)
        }
        (None, Some(host)) => format!("through the bridge to {host} "),
        (None, None) => String::new(),
    };
    let cell = model.cell.clone().bold();
    let title = Line::from(vec![" cell ".into(), cell, " ".into(), bridge.yellow()]);
    let block = Block::bordered().title(title);
    let mut lines = match model.vitals.status() {
        Some(status) => known(model, lost, &status),
        None => Vec::new(),
    };
    match (model.vitals.controller(), findings(model)) {
        (Presence::Running, _) if lines.is_empty() => {
            lines.push("waiting for the controller …".into())
        }
        (Presence::Running, _) => {}
        (_, finding) => {
            // What was known of it is shown for what it is.
            let age = model.vitals.status_age().map(|age| age.as_secs_f64());
            let known = lines.into_iter().map(|line| line.style(Style::default().dim()));
            let stale = age.map(|age| Line::from(format!("as it was {age:.1} s ago:")).yellow());
            let finding = Line::from(finding.unwrap_or_default()).red().bold();
            lines = [finding].into_iter().chain(stale).chain(known).collect();
        }
    }
    Paragraph::new(lines).block(block).wrap(Wrap { trim: true })
}

fn known(model: &Model, lost: u64, status: &Status) -> Vec<Line<'static>> {
    let (health, _) = health::of(status);
    let color = match health {
        Health::Ok => Color::Green,
        Health::Degraded => Color::Yellow,
        Health::Bad => Color::Red,
    };
    let phase = PHASES.get(model.last.record.phase as usize).copied().unwrap_or("unknown");
    let pace = match (status.pace, status.privileged) {
        (PACE_MAX, _) => "full speed",
        (PACE_PLANT, 1) => "the plant's pace, SCHED_FIFO",
        (PACE_PLANT, _) => "the plant's pace, no priority",
        (_, 1) => "real time, SCHED_FIFO",
        (_, _) => "real time, no priority",
    };
    let plant = match status.plant {
        PLANT_ABSENT => "  no plant",
        _ => "",
    };
    let (wakeup, tick) = model.times();
    let pinned = if status.pinned == 1 { " pinned" } else { "" };
    let heard = match model.vitals.learner_age() {
        Some(age) => format!(", heard {:.1} s ago", age.as_secs_f64()),
        None => String::new(),
    };
    let learner = format!("{}{heard}", model.vitals.learner().name());
    let now = model.last.record.tick;
    let ticked = match model.vitals.tick_age() {
        Some(age) if age >= SILENT => format!("tick {now} ({:.1} s ago)", age.as_secs_f64()),
        Some(_) => format!("tick {now}"),
        None => "no tick yet".into(),
    };
    let fault = match status.latched_fault {
        0 => Span::from("none"),
        code => Fault::describe(code as u32).red().bold(),
    };
    let missed = match model.bridged {
        Some(_) => String::new(),
        None => format!("  {lost} ticks missed"),
    };
    let mut lines = vec![
        Line::from(vec![
            health.name().fg(color).bold(),
            format!("  {pace}{plant}  {ticked}  {phase}").into(),
        ]),
        times_line(
            "wake-up",
            &wakeup,
            status.is_paced(),
            &format!("  {} deadlines missed", model.last.missed),
        ),
        times_line("tick   ", &tick, true, &missed),
        Line::from(format!(
            "policy   in the loop {}  active {}{pinned}  last good {}",
            status.in_loop.describe(),
            status.active.describe(),
            status.last_good.describe()
        )),
        Line::from(vec![
            format!(
                "learner  {learner}  spool {}{}  held: ",
                status.spooled,
                if status.spool_full == 1 { " (full)" } else { "" }
            )
            .into(),
            fault,
        ]),
    ];
    // Second, so that a narrow terminal cuts off something else.
    if model.vitals.controller() == Presence::Running
        && let Some(text) = findings(model)
    {
        lines.insert(1, Line::from(text).fg(color));
    }
    lines
}

fn times_line(name: &str, times: &Percentiles, is_known: bool, more: &str) -> Line<'static> {
    let Percentiles { p50, p99, max } = times;
    Line::from(match is_known {
        true => format!("{name}  p50 {p50:7.1}  p99 {p99:7.1}  max {max:8.1} µs{more}"),
        false => format!("{name}  not paced by the wall clock{more}"),
    })
}

fn reward(frame: &mut Frame, model: &Model, area: Rect) {
    let point = |trial: &Trial| (trial.rollout as f64, trial.reward);
    let all: Vec<_> = model.session.trials.iter().map(point).collect();
    let caught: Vec<_> =
        model.session.trials.iter().filter(|trial| trial.success).map(point).collect();
    let mut best_so_far = f64::NEG_INFINITY;
    let best: Vec<_> = all
        .iter()
        .map(|(rollout, reward)| {
            best_so_far = best_so_far.max(*reward);
            (*rollout, best_so_far)
        })
        .collect();
    let title = match model.session.best() {
        Some((rollout, reward)) => format!(
            " reward: best {:.3} at rollout {}, {:.0} % of the last 20 draws succeed, {} of {}{}{} ",
            reward,
            rollout,
            100.0 * model.session.success_last20(),
            model.session.trials.back().map_or(0, |trial| trial.rollout),
            model.session.rollouts,
            match model.session.trial_age() {
                Some(age) if age >= OLD => format!(", {:.0} s ago", age.as_secs_f64()),
                _ => String::new(),
            },
            match model.session.wished_since() {
                Some(rollout) => format!(", conditioned since {rollout}"),
                None => String::new(),
            }
        ),
        None => " reward: no trial yet ".into(),
    };
    let first = all.first().map_or(0.0, |(rollout, _)| *rollout);
    let last = (model.session.rollouts as f64).max(first + 1.0);
    let top = if best_so_far > 0.0 { 1.05 * best_so_far } else { 1.0 };
    let bottom = all.iter().map(|(_, reward)| 1.05 * reward).fold(0.0, f64::min);
    let dots = |name, data, color| {
        let style = Style::default().fg(color);
        Dataset::default().name(name).marker(Marker::Braille).style(style).data(data)
    };
    let sets = vec![
        dots("trial", &all, Color::Gray).graph_type(GraphType::Scatter),
        dots("success", &caught, Color::Green).graph_type(GraphType::Scatter),
        dots("best", &best, Color::Cyan).graph_type(GraphType::Line),
    ];
    let labels = |low: f64, high: f64, digits| {
        [low, 0.5 * (low + high), high].map(|value| format!("{value:.digits$}"))
    };
    let chart = Chart::new(sets)
        .block(Block::bordered().title(title).title_bottom(measures(model)))
        .x_axis(Axis::default().bounds([first, last]).labels(labels(first, last, 0)))
        .y_axis(Axis::default().bounds([bottom, top]).labels(labels(bottom, top, 1)));
    frame.render_widget(chart, area);
}

/// What was measured of the newest trial, as far as the width allows.
fn measures(model: &Model) -> String {
    let all = model.session.measures.as_ref().map(|measures| -> Vec<String> {
        measures.iter().map(|measure| format!("{} {}", measure.name, measure.text())).collect()
    });
    all.map_or(String::new(), |all| format!(" {} ", all.join(", ")))
}

fn modes_table(model: &Model) -> Table<'static> {
    let rows = model.session.modes.iter().enumerate().map(|(i, mode)| {
        let best = match mode.best_rollout {
            0 => "none".into(),
            rollout => format!("{:.3} at {rollout}", mode.best_reward),
        };
        let tolerance = match mode.tolerance() {
            None => "unknown".into(),
            Some(tolerance) => format!("{tolerance:.3}"),
        };
        let cells = [
            format!("{}", i + 1),
            format!("{:.0} %", 100.0 * mode.prior),
            format!("{}", mode.n_trials),
            best,
            tolerance,
        ];
        let style = Style::default();
        Row::new(cells).style(if mode.forbidden != 0 { style.fg(Color::Red) } else { style })
    });
    let header = Row::new(["mode", "share", "trials", "best", "tolerance"])
        .style(Style::default().add_modifier(Modifier::BOLD));
    Table::new(rows, MODE_COLUMNS)
        .header(header)
        .block(Block::bordered().title(" modes of the search "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::bridged::Bridged;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use shm_types::cell::Cell;
    use shm_types::episode::FAULT_HELD;

    fn drawn(model: &Model, prompt: &Prompt) -> String {
        let mut terminal = Terminal::new(TestBackend::new(80, 24)).unwrap();
        terminal.draw(|frame| draw(frame, model, 7, prompt)).unwrap();
        let cells = terminal.backend().buffer().content().iter();
        cells.map(ratatui::buffer::Cell::symbol).collect()
    }

    #[test]
    fn a_person_reads_all_that_is_to_be_done() {
        let mut model = Model::new(&Cell::new("view").unwrap());
        assert!(drawn(&model, &Prompt::None).contains("waiting for the controller"));
        let status = Status { latched_fault: FAULT_HELD, learner_age_ns: 0, ..Status::ZERO };
        model.vitals.answered(status);
        let trial = |rollout, reward| Trial {
            rollout,
            reward,
            success: reward > 1.0,
            is_mean: false,
            is_under_wish: false,
        };
        model.session.trials.extend([trial(1, 0.5), trial(2, 1.5)]);
        model.session.rollouts = 10;
        let text = drawn(&model, &Prompt::None);
        for part in [
            "bad",
            "held by operator",
            "rearm`",
            "7 ticks missed",
            "best 1.500",
            "at rollout 2",
            "50 %",
        ] {
            assert!(text.contains(part), "no '{part}' in: {text}");
        }
        model.bridged = Some(Bridged { host: "arm-1".into(), hz: 50 });
        let text = drawn(&model, &Prompt::None);
        assert!(text.contains("through the bridge to arm-1, 50 Hz, not every tick"), "{text}");
        assert!(!text.contains("ticks missed"), "{text}");
        assert!(drawn(&model, &Prompt::Number("12".into())).contains("policy number: 12"));
        model.vitals.look(); // nobody holds a lock
        assert!(drawn(&model, &Prompt::None).contains("no controller for"));
    }
}
