//! What the terminal shows: state, reward curve, modes, notes and keys.

mod curve;
mod flow;
mod state;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout};
use ratatui::style::{Color, Modifier, Style, Stylize};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Paragraph, Row, Table};

use super::Model;
use super::keys::Prompt;
use super::words::way;
use flow::flow;

/// The reward curve is readable from this height on, with its border and text.
const CURVE_HEIGHT: u16 = 9;
/// A border, a heading and a mode.
const TABLE_HEIGHT: u16 = 4;
const TABLE_HEIGHT_MAX: u16 = 8;
const MODE_COLUMNS: [Constraint; 5] = [
    Constraint::Length(4),
    Constraint::Length(7),
    Constraint::Length(8),
    Constraint::Length(14),
    Constraint::Min(9),
];

/// `lost` ticks were not seen. A small terminal loses the modes first, then notes: health, learner, policy and keys
/// stay.
pub fn draw(frame: &mut Frame, model: &Model, lost: u64, prompt: &Prompt) {
    let area = frame.area();
    let cell = model.cell.clone().bold();
    let way = way(model).map_or(String::new(), |way| format!("{way} "));
    let title = Line::from(vec![" cell ".into(), cell, " ".into(), way.yellow()]);
    let state = state::lines(model, lost, area.width.saturating_sub(2) as usize);
    let keys = bottom_lines(prompt, area.width as usize);
    let mut left = area.height.saturating_sub(state.len() as u16 + 2 + keys.len() as u16);
    let mut give = |wanted: u16, least: u16| {
        let height = wanted.min(left.saturating_sub(CURVE_HEIGHT));
        let height = if height < least { 0 } else { height };
        left -= height;
        height
    };
    let notes = give(model.notes.len() as u16, 1);
    let modes = model.session.modes.len().max(1) as u16 + 3;
    let modes = give(modes.min(TABLE_HEIGHT_MAX), TABLE_HEIGHT);
    let rows = Layout::vertical([
        Constraint::Length(state.len() as u16 + 2),
        Constraint::Min(0),
        Constraint::Length(modes),
        Constraint::Length(notes),
        Constraint::Length(keys.len() as u16),
    ]);
    let [top, curve, table, noted, bottom] = rows.areas(area);
    frame.render_widget(Paragraph::new(state).block(Block::bordered().title(title)), top);
    curve::draw(frame, model, curve);
    frame.render_widget(modes_table(model), table);
    // The newest are at the end.
    let hidden = model.notes.len().saturating_sub(notes as usize);
    let notes = model.notes.iter().skip(hidden).map(|note| Line::from(note.as_str()).dim());
    frame.render_widget(Paragraph::new(notes.collect::<Vec<_>>()), noted);
    frame.render_widget(Paragraph::new(keys), bottom);
}

fn bottom_lines(prompt: &Prompt, width: usize) -> Vec<Line<'static>> {
    let asks = |text: String| vec![Line::from(text).yellow()];
    match prompt {
        Prompt::None => {
            let keys = [
                ("h", "hold"),
                ("e", "re-arm"),
                ("a", "activate"),
                ("p", "pin/unpin"),
                ("r", "roll back"),
                ("0-9 + - w", "rate"),
                ("q", "quit"),
            ];
            let part = |(key, what): (&'static str, &'static str)| {
                vec![Span::from(key).bold(), Span::from(format!(" {what}"))]
            };
            flow("", keys.map(part).into(), "  ", width)
        }
        Prompt::Number(typed) => asks(format!("activate policy number: {typed}▏  Enter, Esc")),
        Prompt::Rating(typed) => asks(format!("rating from 0 to 10: {typed}▏  Enter, Esc")),
        Prompt::Sure(action) => asks(format!("{}? y, or any other key", action.name())),
    }
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
    use crate::watch::session::Trial;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use shm_types::cell::Cell;
    use shm_types::command::Status;
    use shm_types::episode::FAULT_HELD;
    use shm_types::policy::PolicyName;

    const SIZES: [(u16, u16); 2] = [(80, 24), (60, 24)];
    const SMALLEST: (u16, u16) = (60, 18);

    /// The rows of the picture.
    fn drawn(model: &Model, prompt: &Prompt, (width, height): (u16, u16)) -> Vec<String> {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| draw(frame, model, 7, prompt)).unwrap();
        let cells = terminal.backend().buffer().content().chunks(width as usize);
        let row = |row: &[ratatui::buffer::Cell]| row.iter().map(|cell| cell.symbol()).collect();
        cells.map(row).collect()
    }

    /// All of it as one text, however its lines are broken.
    fn text(rows: &[String]) -> String {
        let inner = rows.iter().map(|row| row.trim_matches(|c| c == '│' || c == ' '));
        inner.collect::<Vec<_>>().join(" ")
    }

    fn held() -> Model {
        let mut model = Model::new(&Cell::new("view").unwrap());
        let policy = PolicyName { session: 0xab, policy_id: 91, digest: 1, ..PolicyName::NONE };
        let status = Status {
            latched_fault: FAULT_HELD,
            learner_age_ns: 0,
            in_loop: policy,
            active: PolicyName { session: 0, policy_id: 3, ..policy },
            last_good: policy,
            pinned: 1,
            ..Status::ZERO
        };
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
        model
    }

    #[test]
    fn health_learner_and_policy_are_shown_at_every_size() {
        let state = [
            "bad",
            "held by operator",
            "rearm --cell view`",
            "learner  absent",
            "in the loop 91 of session 00000000000000ab",
            "active 3, pinned",
            "last good 91",
            "7 ticks missed",
            "h hold",
            "q quit",
        ];
        let session =
            ["rollout 2 of 10", "best 1.500 at rollout 2", "50 % of the last 20 draws succeed"];
        for size in SIZES.into_iter().chain([SMALLEST]) {
            let mut model = held();
            model.note("pin: done".into());
            let rows = drawn(&model, &Prompt::None, size);
            let text = text(&rows);
            let session = session.iter().filter(|_| size != SMALLEST);
            for part in state.iter().chain(session) {
                assert!(text.contains(part), "{size:?}: no '{part}' in:\n{}", rows.join("\n"));
            }
        }
    }

    #[test]
    fn the_curve_has_its_rows_for_itself() {
        for size in SIZES {
            let rows = drawn(&held(), &Prompt::None, size);
            let all = rows.join("\n");
            let key = rows.iter().position(|row| row.contains("─ best")).expect("a key");
            let plot: Vec<&String> =
                rows[key + 1..].iter().take_while(|row| !row.contains('└')).collect();
            let is_point = |c: char| ('\u{2801}'..='\u{28ff}').contains(&c);
            assert!(plot.iter().any(|row| row.contains(is_point)), "{size:?}: no curve in\n{all}");
            for row in plot {
                let curve =
                    row.rsplit_once('│').and_then(|(row, _)| row.rsplit_once('│')).unwrap().1;
                let is_free = curve.chars().all(|c| c == ' ' || is_point(c));
                assert!(is_free, "{size:?}: '{row}' in\n{all}");
            }
        }
    }

    #[test]
    fn who_is_missing_and_what_is_asked_is_shown() {
        let size = SIZES[0];
        let mut model = Model::new(&Cell::new("view").unwrap());
        let waits = text(&drawn(&model, &Prompt::None, size));
        assert!(waits.contains("waiting for the controller"), "{waits}");
        model = held();
        let asked = drawn(&model, &Prompt::Number("12".into()), size);
        assert!(text(&asked).contains("policy number: 12"));
        model.bridged = Some(Bridged { host: "arm-1".into(), hz: 50 });
        let bridged = text(&drawn(&model, &Prompt::None, size));
        assert!(
            bridged.contains("through the bridge to arm-1, 50 Hz, not every tick"),
            "{bridged}"
        );
        assert!(!bridged.contains("ticks missed"), "{bridged}");
        model.vitals.look(); // nobody holds a lock
        assert!(text(&drawn(&model, &Prompt::None, size)).contains("no controller for"));
    }
}
