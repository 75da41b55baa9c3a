//! Rows of a table → values in SI units at increasing times.

use anyhow::{Context, Result, bail};
use csv::StringRecord;

use super::cell::{self, DecimalMark};
use super::columns::Columns;
use super::fields::{Column, Fields};
use super::gaps::Sparse;
use super::time;

pub struct Read {
    pub sparse: Sparse,
    /// The column of the time and its unit.
    pub time: String,
    pub warnings: Vec<String>,
}

/// One line with its cells.
struct Line<'a> {
    at: String,
    cells: &'a StringRecord,
    mark: DecimalMark,
}

impl Line<'_> {
    /// In the unit of the file; `None` where there is no value.
    fn number(&self, column: &Column) -> Result<Option<f64>> {
        let cell = self.cells.get(column.index).unwrap_or_default();
        let item = column.element.map(|element| {
            cell::list(cell).and_then(|items| items.get(element).copied()).unwrap_or_default()
        });
        let text = item.unwrap_or(cell);
        if cell::is_missing(text) {
            return Ok(None);
        }
        let advice = match self.mark {
            _ if text.contains(':') => "dates and times of day are not read: write seconds",
            DecimalMark::Point => "use a finite number such as 0.72, or remove the row",
            DecimalMark::Comma => {
                "use a finite number, with the decimal comma of the other rows, or remove the row"
            }
        };
        let number = cell::number(text, self.mark);
        number
            .map(Some)
            .with_context(|| format!("{}: {} is `{text}`: {advice}", self.at, column.name))
    }
}

/// Reads the columns of all rows. Rows without a time or without any value say nothing; rows at the time
/// of the row before complete it.
pub fn read(file: &str, fields: &Fields, columns: &Columns) -> Result<Read> {
    let values = columns.values();
    let (mut stamps, mut lines, mut rows) = (Vec::<f64>::new(), Vec::new(), Vec::<Vec<_>>::new());
    let mut repeated: Option<(usize, u64)> = None;
    let mut first = None;
    for row in &fields.table.rows {
        // Files that were put together repeat it.
        if fields.header.as_ref() == Some(&row.cells) {
            continue;
        }
        let at = format!("{file}, line {}", row.line);
        let found = row.cells.len();
        let is_surplus_empty = row.cells.iter().skip(fields.width).all(cell::is_missing);
        if found < fields.width || !is_surplus_empty {
            if row.cells.iter().all(cell::is_missing) {
                continue;
            }
            bail!("{at}: {found} values instead of {}: give one per column", fields.width);
        }
        let line = Line { at, cells: &row.cells, mark: fields.table.decimal_mark };
        let Some(stamp) = stamp(&line, &columns.time)? else { continue };
        let row_of = values.iter().map(|column| {
            line.number(column).map(|value| value.map(|number| number * column.scale))
        });
        let cells: Vec<Option<f64>> = row_of.collect::<Result<_>>()?;
        // Of a clock that counts from 1970, differences alone are exact enough.
        let stamp = stamp - *first.get_or_insert(stamp);
        if cells.iter().all(Option::is_none) {
            continue;
        }
        match stamps.last().map(|last| stamp.total_cmp(last)) {
            Some(std::cmp::Ordering::Less) => bail!(
                "{}: {} is {} after {} (since the first row): time must increase from row to row; \
                 sort the rows, or keep one of several takes",
                line.at,
                columns.time[0].name,
                stamp,
                stamps[stamps.len() - 1]
            ),
            Some(std::cmp::Ordering::Equal) => {
                let known = rows.last_mut().expect("a row was before");
                if !complete(known, &cells) {
                    repeated = Some((repeated.map_or(0, |(n, _)| n) + 1, row.line));
                }
            }
            _ => {
                stamps.push(stamp);
                rows.push(cells);
                lines.push(row.line);
            }
        }
    }
    let first = first.unwrap_or(0.0);
    let (unit, scale) = unit(&columns.time, first, &stamps);
    let warnings = repeated.map(|(n, line)| {
        format!(
            "{file}: {n} rows repeat the time of the row before and are left out, the last of them line \
             {line}"
        )
    });
    let names: Vec<&str> = columns.time.iter().map(|column| &column.name[..]).collect();
    Ok(Read {
        sparse: Sparse { times_s: stamps.iter().map(|t| t * scale).collect(), lines, rows },
        time: format!("{} ({unit})", names.join(" + ")),
        warnings: warnings.into_iter().collect(),
    })
}

/// In the unit of its column; in seconds where there are two columns.
fn stamp(line: &Line, columns: &[Column]) -> Result<Option<f64>> {
    if let [column] = columns {
        return line.number(column);
    }
    let mut sum = Some(0.0);
    for column in columns {
        let number = line.number(column)?;
        sum = sum.zip(number).map(|(sum, number)| sum + number * column.scale);
    }
    Ok(sum)
}

/// Fills what is missing in `known`; false when `cells` have nothing to add.
fn complete(known: &mut [Option<f64>], cells: &[Option<f64>]) -> bool {
    let mut added = false;
    for (known, cell) in known.iter_mut().zip(cells) {
        if known.is_none() && cell.is_some() {
            *known = *cell;
            added = true;
        }
    }
    added
}

/// Symbol and scale of the unit of stamps that count from `first`.
fn unit(columns: &[Column], first: f64, stamps: &[f64]) -> (&'static str, f64) {
    match columns {
        [column] => match column.unit {
            Some(unit) => (unit, column.scale),
            None => {
                let stamps: Vec<f64> = stamps.iter().map(|t| first + t).collect();
                let (unit, scale) = time::guess_unit(&stamps);
                (unit, scale)
            }
        },
        _ => ("s", 1.0),
    }
}
