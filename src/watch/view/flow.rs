//! Short texts laid out in lines of a width: none is cut off, whatever the terminal.

use ratatui::text::{Line, Span};

/// Lays `parts` after `label`, with `gap` between them, and goes on in the next line where one does not fit. Lines
/// after the first are indented like it.
pub fn flow(
    label: &'static str,
    parts: Vec<Vec<Span<'static>>>,
    gap: &'static str,
    width: usize,
) -> Vec<Line<'static>> {
    let indent = Span::from(label).width();
    let mut lines = Vec::new();
    let mut line = vec![Span::from(label)];
    let mut used = indent;
    for part in parts {
        let length: usize = part.iter().map(Span::width).sum();
        let is_first = line.len() == 1;
        if !is_first && used + gap.len() + length > width {
            let next = vec![Span::from(" ".repeat(indent))];
            lines.push(Line::from(std::mem::replace(&mut line, next)));
            used = indent;
        } else if !is_first {
            line.push(gap.into());
            used += gap.len();
        }
        used += length;
        line.extend(part);
    }
    lines.push(Line::from(line));
    lines
}

/// The words of a text, to be laid out with a space between them.
pub fn words(text: &str) -> Vec<Vec<Span<'static>>> {
    text.split_whitespace().map(|word| vec![Span::from(word.to_string())]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_that_do_not_fit_go_into_the_next_line() {
        let laid = |width| {
            let lines = flow("at  ", words("one two three"), " ", width);
            lines.iter().map(Line::to_string).collect::<Vec<_>>()
        };
        assert_eq!(laid(17), ["at  one two three"]);
        assert_eq!(laid(16), ["at  one two", "    three"]);
        assert_eq!(laid(1), ["at  one", "    two", "    three"], "at least one a line");
    }
}
