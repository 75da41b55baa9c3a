//! Text → rows of cells: comments taken out, separator and decimal mark recognised.

use anyhow::{Context, Result, bail};
use csv::{ReaderBuilder, StringRecord, Trim};

use super::cell::{self, DecimalMark};

/// So many rows tell the dialect.
const SAMPLE_ROWS: usize = 200;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Separator {
    Comma,
    Semicolon,
    Tab,
    Pipe,
    /// Any number of spaces and tabs.
    Spaces,
}

/// Where two fit equally well, the first one is meant.
const SEPARATORS: [Separator; 5] =
    [Separator::Comma, Separator::Semicolon, Separator::Tab, Separator::Pipe, Separator::Spaces];

impl Separator {
    pub fn name(self) -> &'static str {
        match self {
            Separator::Comma => "commas",
            Separator::Semicolon => "semicolons",
            Separator::Tab => "tabs",
            Separator::Pipe => "pipes",
            Separator::Spaces => "spaces",
        }
    }

    fn byte(self) -> u8 {
        match self {
            Separator::Comma => b',',
            Separator::Semicolon => b';',
            Separator::Tab | Separator::Spaces => b'\t',
            Separator::Pipe => b'|',
        }
    }
}

/// One line of a file and its cells.
#[derive(Clone, Debug)]
pub struct Row {
    pub line: u64,
    pub cells: StringRecord,
    pub is_comment: bool,
}

#[derive(Debug)]
pub struct Table {
    pub separator: Separator,
    pub decimal_mark: DecimalMark,
    /// What stands above the numbers, comments without their mark included.
    pub heading: Vec<Row>,
    pub rows: Vec<Row>,
}

impl Table {
    pub fn parse(file: &str, text: &str) -> Result<Table> {
        let lines = Lines::of(text);
        if lines.rows.is_empty() && lines.comments.is_empty() {
            bail!("{file}: is empty: begin it with a header, then one row a sample");
        }
        let candidates: &[Separator] = match &lines.separator {
            Some(separator) => std::slice::from_ref(separator),
            None => &SEPARATORS,
        };
        let unreadable = || format!("{file}: cannot be read as CSV");
        let mut best: Option<(f64, Separator)> = None;
        for separator in candidates {
            let sample = lines.read(*separator, SAMPLE_ROWS).with_context(unreadable)?;
            let score = score(&sample);
            if score > best.map_or(0.0, |(score, _)| score) {
                best = Some((score, *separator));
            }
        }
        let Some((_, separator)) = best else {
            bail!(
                "{file}: holds no rows of numbers: write a header such as t_s,q1_rad,…, then one row a \
                 sample, with commas, semicolons, tabs, spaces or | between"
            );
        };
        let mut rows = lines.read(separator, usize::MAX).with_context(unreadable)?;
        let width = usual_width(&rows);
        let first =
            rows.iter().position(|row| is_data(row) && row.cells.len() == width).unwrap_or(0);
        let data = rows.split_off(first);
        let above = |comment: &&Row| comment.line < data[0].line;
        let comments = lines.read_comments(separator).with_context(unreadable)?;
        rows.extend(comments.iter().filter(above).cloned());
        rows.sort_by_key(|row| row.line);
        let decimal_mark = decimal_mark(&data);
        Ok(Table { separator, decimal_mark, heading: rows, rows: data })
    }
}

/// The lines of a file by what they are, each with its number.
struct Lines<'a> {
    rows: Vec<(u64, &'a str)>,
    comments: Vec<(u64, &'a str)>,
    /// As Excel states it in a line of its own, `sep=;`.
    separator: Option<Separator>,
}

impl<'a> Lines<'a> {
    fn of(text: &'a str) -> Lines<'a> {
        let mut lines = Lines { rows: Vec::new(), comments: Vec::new(), separator: None };
        for (line, number) in text.lines().zip(1..) {
            let bare = line.trim();
            let comment = ["#", "%", "//"].iter().find_map(|mark| bare.strip_prefix(mark));
            if let Some(comment) = comment {
                lines.comments.push((number, comment.trim_start_matches(['#', '%', '/'])));
            } else if let Some(stated) = bare.trim_matches('"').strip_prefix("sep=") {
                lines.separator =
                    SEPARATORS.into_iter().find(|known| stated.as_bytes() == [known.byte()]);
            } else if !bare.is_empty() {
                lines.rows.push((number, line));
            }
        }
        lines
    }

    fn read(&self, separator: Separator, limit: usize) -> csv::Result<Vec<Row>> {
        records(&self.rows, separator, false, limit)
    }

    /// Each on its own: a quote in a comment is no quote.
    fn read_comments(&self, separator: Separator) -> csv::Result<Vec<Row>> {
        let rows = self.comments.iter().map(|line| {
            records(std::slice::from_ref(line), separator, true, 1).map(|mut rows| rows.pop())
        });
        rows.filter_map(Result::transpose).collect()
    }
}

fn records(
    lines: &[(u64, &str)],
    separator: Separator,
    is_comment: bool,
    limit: usize,
) -> csv::Result<Vec<Row>> {
    let mut text = String::new();
    // More lines than rows: a quoted cell may run over several.
    for (_, line) in lines.iter().take(limit.saturating_mul(4)) {
        match separator {
            Separator::Spaces => text.push_str(&tabbed(line)),
            // The reader knows quotes only at the start of a cell.
            _ => text.push_str(&line.replace(", \"", ",\"").replace("; \"", ";\"")),
        }
        text.push('\n');
    }
    let mut reader = ReaderBuilder::new()
        .flexible(true)
        .has_headers(false)
        .delimiter(separator.byte())
        .trim(Trim::All)
        .from_reader(text.as_bytes());
    let mut rows = Vec::new();
    for record in reader.records().take(limit) {
        let cells = record?;
        let at = cells.position().map_or(1, csv::Position::line) as usize;
        let line = lines.get(at - 1).map_or(0, |(number, _)| *number);
        rows.push(Row { line, cells, is_comment });
    }
    Ok(rows)
}

/// `line` with one tab for every run of spaces outside quotes and brackets; `t [s]` stays one cell.
fn tabbed(line: &str) -> String {
    let (mut text, mut depth, mut quoted) = (String::new(), 0usize, false);
    for c in line.trim().chars() {
        match c {
            '"' => quoted = !quoted,
            '[' | '(' if !quoted => {
                // A unit belongs to the name before it, a list stands alone.
                if depth == 0 && text.ends_with('\t') && !text.is_empty() {
                    text.push('\u{1}');
                }
                depth += 1;
            }
            ']' | ')' if !quoted => depth = depth.saturating_sub(1),
            _ => {}
        }
        match c.is_whitespace() && depth == 0 && !quoted {
            true if text.ends_with('\t') => {}
            true => text.push('\t'),
            false => text.push(c),
        }
    }
    let mut cells = text.split("\t\u{1}");
    let mut joined = cells.next().unwrap_or_default().to_string();
    for cell in cells {
        let is_unit = cell.starts_with(['[', '('])
            && cell[1..].starts_with(|c: char| c.is_alphabetic() || c == '°');
        joined.push_str(if is_unit { " " } else { "\t" });
        joined.push_str(cell);
    }
    joined
}

/// How many cells are numbers under any decimal mark, those of rows with other cells counting less.
fn score(rows: &[Row]) -> f64 {
    let of_row = |row: &Row| {
        let numbers = numbers(row);
        let filled = row.cells.iter().filter(|cell| !cell::is_missing(cell)).count().max(1);
        if numbers < 2 { 0.0 } else { (numbers * numbers) as f64 / filled as f64 }
    };
    rows.iter().map(of_row).sum()
}

fn numbers(row: &Row) -> usize {
    let is_number = |cell: &&str| {
        cell::number(cell, DecimalMark::Point).is_some()
            || cell::number(cell, DecimalMark::Comma).is_some()
            || cell::list(cell).is_some_and(|items| {
                items.iter().all(|item| {
                    cell::number(item, DecimalMark::Point).is_some()
                        || cell::number(item, DecimalMark::Comma).is_some()
                })
            })
    };
    row.cells.iter().filter(is_number).count()
}

/// A time and at least one value.
fn is_data(row: &Row) -> bool {
    numbers(row) >= 2
}

/// The number of cells that most rows of numbers have.
fn usual_width(rows: &[Row]) -> usize {
    let widths: Vec<usize> = rows
        .iter()
        .take(SAMPLE_ROWS)
        .filter(|row| is_data(row))
        .map(|row| row.cells.len())
        .collect();
    let count = |width: &usize| widths.iter().filter(|other| *other == width).count();
    widths.iter().copied().max_by_key(|width| (count(width), *width)).unwrap_or(0)
}

fn decimal_mark(rows: &[Row]) -> DecimalMark {
    let (mut points, mut commas) = (0, 0);
    let cells = rows.iter().take(SAMPLE_ROWS).flat_map(|row| row.cells.iter());
    for text in cells.flat_map(|cell| cell::list(cell).unwrap_or_else(|| vec![cell])) {
        let point = cell::number(text, DecimalMark::Point).is_some();
        let comma = cell::number(text, DecimalMark::Comma).is_some();
        points += usize::from(point && !comma);
        commas += usize::from(comma && !point);
    }
    if commas > points { DecimalMark::Comma } else { DecimalMark::Point }
}

#[cfg(test)]
mod tests;
