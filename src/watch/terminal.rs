//! The terminal view: its loop, its keys and the line in which a number is typed.

use std::time::{Duration, Instant};

use anyhow::Result;
use learner::people::BEST;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind};
use ratatui::crossterm::execute;
use ratatui::crossterm::terminal::{
    BeginSynchronizedUpdate, Clear, ClearType, EndSynchronizedUpdate,
};

use super::action::Action;
use super::keys::{Keys, Prompt};
use super::{Model, view};
use crate::cell::NamedCell;
use crate::people::Word;
use crate::record::watcher::{Watcher, pause};

/// Between two pictures.
const FRAME: Duration = Duration::from_millis(100);
/// Other processes may write over the picture, such as services in the background of this terminal.
const REPAINT: Duration = Duration::from_millis(500);

pub fn run(
    named: &NamedCell,
    mut model: Model,
    mut watcher: Watcher,
    is_over: &dyn Fn() -> bool,
) -> Result<()> {
    let keys = Keys::new(&named.cell);
    let mut prompt = Prompt::None;
    // Restored when it is dropped, a panic included.
    let mut terminal = ratatui::init();
    let (mut drawn, mut repainted) = (None::<Instant>, Instant::now());
    let result = loop {
        let round = Instant::now();
        let turn = || -> Result<bool> {
            model.look(&mut watcher)?;
            for answer in keys.answers() {
                model.note(answer);
            }
            if drawn.is_none_or(|drawn| drawn.elapsed() >= FRAME) {
                drawn = Some(Instant::now());
                execute!(std::io::stdout(), BeginSynchronizedUpdate)?;
                if repainted.elapsed() >= REPAINT {
                    repainted = Instant::now();
                    // Not `terminal.clear()`: it asks for the cursor, and not every terminal answers.
                    execute!(std::io::stdout(), Clear(ClearType::All))?;
                    terminal.swap_buffers();
                }
                terminal.draw(|frame| view::draw(frame, &model, watcher.lost, &prompt))?;
                execute!(std::io::stdout(), EndSynchronizedUpdate)?;
            }
            let mut goes_on = true;
            // Of a terminal that is gone crossterm would read nothing without end.
            goes_on &= !crate::tty::is_gone();
            while goes_on && event::poll(Duration::ZERO)? {
                if let Event::Key(key) = event::read()?
                    && key.kind == KeyEventKind::Press
                {
                    goes_on = press(key.code, &mut prompt, &model, &keys);
                }
            }
            Ok(goes_on)
        };
        match { turn }() {
            Ok(true) if !is_over() => pause(round),
            Ok(_) => break Ok(()),
            Err(error) => break Err(error),
        }
    };
    // A terminal that is gone cannot be restored.
    let _ = ratatui::try_restore();
    result
}

/// Reacts to a key; false when it ends the view.
fn press(key: KeyCode, prompt: &mut Prompt, model: &Model, keys: &Keys) -> bool {
    let is_pinned = model.vitals.status().is_some_and(|status| status.pinned == 1);
    let (next, action) = after(key, prompt, is_pinned);
    if let Some(action) = action {
        keys.send(action, model.session.trials.back().map(|trial| trial.rollout));
    }
    *prompt = next;
    !(key == KeyCode::Char('q') && *prompt == Prompt::None)
}

/// The prompt after a key, and what is to be done.
fn after(key: KeyCode, prompt: &Prompt, is_pinned: bool) -> (Prompt, Option<Action>) {
    let nothing = (Prompt::None, None);
    match (prompt, key) {
        (_, KeyCode::Esc) => nothing,
        (Prompt::Number(typed), KeyCode::Char(digit)) if digit.is_ascii_digit() => {
            (Prompt::Number(format!("{typed}{digit}")), None)
        }
        (Prompt::Number(typed), KeyCode::Backspace) => {
            (Prompt::Number(typed[..typed.len().saturating_sub(1)].into()), None)
        }
        (Prompt::Number(typed), KeyCode::Enter) => {
            (Prompt::None, typed.parse().ok().map(Action::Activate))
        }
        (Prompt::Number(typed), _) => (Prompt::Number(typed.clone()), None),
        (Prompt::Rating(typed), KeyCode::Char(c)) if c.is_ascii_digit() || c == '.' => {
            (Prompt::Rating(format!("{typed}{c}")), None)
        }
        (Prompt::Rating(typed), KeyCode::Backspace) => {
            (Prompt::Rating(typed[..typed.len().saturating_sub(1)].into()), None)
        }
        // What is no rating stays to be corrected.
        (Prompt::Rating(typed), KeyCode::Enter) => match typed.parse::<f64>() {
            Ok(rating) if (0.0..=BEST).contains(&rating) => {
                (Prompt::None, Some(Action::Rate(Word::Rate(rating))))
            }
            _ => (Prompt::Rating(typed.clone()), None),
        },
        (Prompt::Rating(typed), _) => (Prompt::Rating(typed.clone()), None),
        (Prompt::Sure(action), KeyCode::Char('y')) => (Prompt::None, Some(*action)),
        (Prompt::Sure(_), _) => nothing,
        (Prompt::None, KeyCode::Char('a')) => (Prompt::Number(String::new()), None),
        (Prompt::None, KeyCode::Char('p')) => {
            (Prompt::None, Some(if is_pinned { Action::Unpin } else { Action::Pin }))
        }
        (Prompt::None, KeyCode::Char('r')) => (Prompt::Sure(Action::RollBack), None),
        // The one that must not wait for a second key.
        (Prompt::None, KeyCode::Char('h')) => (Prompt::None, Some(Action::Hold)),
        (Prompt::None, KeyCode::Char('e')) => (Prompt::Sure(Action::Rearm), None),
        (Prompt::None, KeyCode::Char(digit)) if digit.is_ascii_digit() => {
            (Prompt::Rating(digit.into()), None)
        }
        (Prompt::None, KeyCode::Char('+')) => (Prompt::None, Some(Action::Rate(Word::Better))),
        (Prompt::None, KeyCode::Char('-')) => (Prompt::None, Some(Action::Rate(Word::Worse))),
        (Prompt::None, KeyCode::Char('w')) => (Prompt::None, Some(Action::Rate(Word::Withdraw))),
        (Prompt::None, _) => nothing,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn type_keys(keys: &[KeyCode], is_pinned: bool) -> (Prompt, Vec<Action>) {
        let (mut prompt, mut actions) = (Prompt::None, Vec::new());
        for key in keys {
            let (next, action) = after(*key, &prompt, is_pinned);
            actions.extend(action);
            prompt = next;
        }
        (prompt, actions)
    }

    #[test]
    fn keys_become_commands() {
        let letter = |text: &str| text.chars().map(KeyCode::Char).collect::<Vec<_>>();
        let with_enter = |text: &str| [letter(text), vec![KeyCode::Enter]].concat();
        assert_eq!(type_keys(&with_enter("a12"), false).1, [Action::Activate(12)]);
        assert_eq!(type_keys(&with_enter("a"), false), (Prompt::None, vec![]));
        assert_eq!(type_keys(&letter("p"), false).1, [Action::Pin]);
        assert_eq!(type_keys(&letter("p"), true).1, [Action::Unpin]);
        assert_eq!(type_keys(&letter("ry"), false).1, [Action::RollBack]);
        assert_eq!(type_keys(&letter("rn"), false).1, []);
        assert_eq!(type_keys(&letter("h"), false).1, [Action::Hold], "at once");
        let typed = [letter("a1"), vec![KeyCode::Backspace, KeyCode::Char('7'), KeyCode::Enter]];
        assert_eq!(type_keys(&typed.concat(), false).1, [Action::Activate(7)]);
        assert_eq!(type_keys(&[letter("a1"), vec![KeyCode::Esc]].concat(), false).0, Prompt::None);
    }

    #[test]
    fn keys_become_ratings() {
        let letter = |text: &str| text.chars().map(KeyCode::Char).collect::<Vec<_>>();
        let with_enter = |text: &str| [letter(text), vec![KeyCode::Enter]].concat();
        let rated = |rating| [Action::Rate(Word::Rate(rating))];
        assert_eq!(type_keys(&with_enter("7"), false).1, rated(7.0));
        assert_eq!(type_keys(&with_enter("10"), false).1, rated(10.0));
        assert_eq!(type_keys(&with_enter("6.5"), false).1, rated(6.5));
        let none = (Prompt::Rating("11".into()), vec![]);
        assert_eq!(type_keys(&with_enter("11"), false), none, "it can be corrected");
        for (key, word) in [("+", Word::Better), ("-", Word::Worse), ("w", Word::Withdraw)] {
            assert_eq!(type_keys(&letter(key), false).1, [Action::Rate(word)], "at once");
        }
    }
}
