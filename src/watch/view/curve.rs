//! The reward of the trials, with its key above it.

use std::time::Duration;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style, Stylize};
use ratatui::symbols::Marker;
use ratatui::text::Span;
use ratatui::widgets::{Axis, Block, Chart, Dataset, GraphType, Paragraph};

use super::flow::flow;
use crate::watch::Model;
use crate::watch::session::Trial;

/// Trials follow each other within this time, at the wall clock, too.
const OLD: Duration = Duration::from_secs(10);
const TRIAL: Color = Color::Gray;
const SUCCESS: Color = Color::Green;
const BEST: Color = Color::Cyan;

pub fn draw(frame: &mut Frame, model: &Model, area: Rect) {
    let block = Block::bordered().title(" reward ").title_bottom(measures(model));
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let words = flow("", words(model), "  ", inner.width as usize);
    let [above, plot] =
        Layout::vertical([Constraint::Length(words.len() as u16), Constraint::Min(0)]).areas(inner);
    frame.render_widget(Paragraph::new(words), above);
    let trials = &model.session.trials;
    let point = |trial: &Trial| (trial.rollout as f64, trial.reward);
    let all: Vec<_> = trials.iter().map(point).collect();
    let caught: Vec<_> = trials.iter().filter(|trial| trial.success).map(point).collect();
    let mut best_so_far = f64::NEG_INFINITY;
    let best: Vec<_> = all
        .iter()
        .map(|(rollout, reward)| {
            best_so_far = best_so_far.max(*reward);
            (*rollout, best_so_far)
        })
        .collect();
    let first = all.first().map_or(0.0, |(rollout, _)| *rollout);
    let last = (model.session.rollouts as f64).max(first + 1.0);
    let top = if best_so_far > 0.0 { 1.05 * best_so_far } else { 1.0 };
    let bottom = all.iter().map(|(_, reward)| 1.05 * reward).fold(0.0, f64::min);
    let dots = |data, color| {
        let style = Style::default().fg(color);
        Dataset::default().marker(Marker::Braille).style(style).data(data)
    };
    let sets = vec![
        dots(&all, TRIAL).graph_type(GraphType::Scatter),
        dots(&caught, SUCCESS).graph_type(GraphType::Scatter),
        dots(&best, BEST).graph_type(GraphType::Line),
    ];
    let labels = |low: f64, high: f64, digits| {
        [low, 0.5 * (low + high), high].map(|value| format!("{value:.digits$}"))
    };
    let chart = Chart::new(sets)
        .x_axis(Axis::default().bounds([first, last]).labels(labels(first, last, 0)))
        .y_axis(Axis::default().bounds([bottom, top]).labels(labels(bottom, top, 1)));
    frame.render_widget(chart, plot);
}

/// How the session goes, and the key.
fn words(model: &Model) -> Vec<Vec<Span<'static>>> {
    let session = &model.session;
    let Some((rollout, reward)) = session.best() else {
        return vec![vec!["no trial yet".into()]];
    };
    let newest = session.trials.back().map_or(0, |trial| trial.rollout);
    let mut words = vec![
        format!("rollout {newest} of {}", session.rollouts),
        format!("best {reward:.3} at rollout {rollout}"),
        format!("{:.0} % of the last 20 draws succeed", 100.0 * session.success_last20()),
    ];
    match session.trial_age() {
        Some(age) if age >= OLD => words.push(format!("{:.0} s ago", age.as_secs_f64())),
        _ => {}
    }
    words.extend(session.wished_since().map(|rollout| format!("conditioned since {rollout}")));
    let key = [
        vec![Span::from("• trial").fg(TRIAL)],
        vec![Span::from("• success").fg(SUCCESS)],
        vec![Span::from("─ best").fg(BEST)],
    ];
    words.into_iter().map(|text| vec![text.into()]).chain(key).collect()
}

/// What was measured of the newest trial, as far as the width allows.
fn measures(model: &Model) -> String {
    let all = model.session.measures.as_ref().map(|measures| -> Vec<String> {
        measures.iter().map(|measure| format!("{} {}", measure.name, measure.text())).collect()
    });
    all.map_or(String::new(), |all| format!(" {} ", all.join(", ")))
}
