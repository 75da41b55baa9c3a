//! The columns that a table has: which line is its header, names, units, and cells that hold lists.

use anyhow::{Result, bail};
use csv::StringRecord;

use super::cell;
use super::dialect::{Row, Table};
use super::mapping::Assignment;
use super::names::{self, Name, Units};
use super::time_names;

/// Names that a message lists.
const LISTED: usize = 30;
/// Columns of a trajectory as TUM's benchmark and evo write it, without a header.
const TUM: [&str; 8] = ["t", "tx", "ty", "tz", "qx", "qy", "qz", "qw"];
/// Sum of squares of what may be a unit quaternion.
const UNIT_NORM: std::ops::Range<f64> = 0.95..1.05;

/// A column, or one element of a column of lists.
#[derive(Clone, Debug)]
pub struct Field {
    pub index: usize,
    pub element: Option<usize>,
    /// As the file writes it.
    pub text: String,
    pub name: Name,
}

/// Where a quantity is, and in which unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    pub index: usize,
    pub element: Option<usize>,
    pub name: String,
    /// As the file states it.
    pub unit: Option<&'static str>,
    /// SI units in one unit of the column.
    pub scale: f64,
}

pub struct Fields<'a> {
    /// File and line of the header, for messages.
    at: String,
    pub table: &'a Table,
    pub all: Vec<Field>,
    /// Cells of the header; as many as the table is wide without one.
    pub width: usize,
    pub header: Option<StringRecord>,
    pub is_tum: bool,
}

impl<'a> Fields<'a> {
    pub fn of(file: &str, table: &'a Table, mapping: &[Assignment]) -> Fields<'a> {
        let first = &table.rows[0];
        let Some(at) = header(table, first.cells.len(), mapping) else {
            return Fields::without_header(file, table);
        };
        let header = &table.heading[at];
        let units = units_below(&table.heading[at + 1..]);
        let mut all = Vec::new();
        // An empty name at the end is a separator at the end.
        let is_named = |text: &str| !cell::bare(text).is_empty();
        let width =
            (0..header.cells.len()).rfind(|i| is_named(&header.cells[*i])).map_or(0, |i| i + 1);
        for (index, text) in header.cells.iter().enumerate().take(width) {
            let mut name = Name::parse(text);
            if let (None, Some(unit)) = (&name.unit, units.and_then(|row| row.cells.get(index))) {
                name.unit = stated_unit(unit);
            }
            let text = cell::bare(text).to_string();
            let items = first.cells.get(index).and_then(cell::list).map_or(0, |items| items.len());
            if items == 0 {
                all.push(Field { index, element: None, text, name });
                continue;
            }
            for element in 0..items {
                let mut name = name.clone();
                name.words.push(element.to_string());
                let text = format!("{text}[{element}]");
                all.push(Field { index, element: Some(element), text, name });
            }
        }
        let at = format!("{file}, line {}", header.line);
        Fields { at, table, all, width, header: Some(header.cells.clone()), is_tum: false }
    }

    /// Columns are called by their number, unless the table is a trajectory as TUM writes it.
    fn without_header(file: &str, table: &'a Table) -> Fields<'a> {
        let first = &table.rows[0].cells;
        let numbers: Vec<f64> =
            first.iter().filter_map(|text| cell::number(text, table.decimal_mark)).collect();
        let width = first.len();
        let norm: f64 = numbers.iter().skip(4).map(|x| x * x).sum();
        let is_tum = numbers.len() == TUM.len() && width == 8 && UNIT_NORM.contains(&norm);
        let field = |index: usize| {
            let text = if is_tum { TUM[index].to_string() } else { format!("{}", index + 1) };
            Field { index, element: None, name: Name::parse(&text), text }
        };
        let all = (0..width).map(field).collect();
        let at = format!("{file}, line {}", table.rows[0].line);
        Fields { at, table, all, width, header: None, is_tum }
    }

    /// For messages: file, line, and what stands there.
    pub fn at(&self) -> &str {
        &self.at
    }

    pub fn listing(&self) -> String {
        let names: Vec<&str> = self.all.iter().take(LISTED).map(|field| &field.text[..]).collect();
        let more = match self.all.len().saturating_sub(LISTED) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        match self.header.is_some() {
            true => format!("the columns are {}{more}", names.join(", ")),
            false => format!(
                "there is no header; write one, or say with --columns which column is what by its \
                 number, 1 to {}",
                self.all.len()
            ),
        }
    }

    /// The column called `name`, in any case, or by its number from 1.
    pub fn named(&self, name: &str) -> Result<&Field> {
        let bare = |text: &str| cell::bare(text).trim_start_matches(['#', '%']).to_lowercase();
        let found = self.all.iter().find(|field| bare(&field.text) == bare(name));
        let number = name.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
        let numbered = || self.all.iter().find(|field| Some(field.index) == number);
        match found.or_else(numbered) {
            Some(field) => Ok(field),
            None => bail!("{}: --columns names `{name}`, but {}", self.at, self.listing()),
        }
    }

    /// `field` as a quantity that is measured in `units`.
    pub fn column(&self, field: &Field, units: Units) -> Result<Column> {
        self.column_in(field, units, field.name.unit.as_deref())
    }

    pub fn column_in(&self, field: &Field, units: Units, stated: Option<&str>) -> Result<Column> {
        let stated = stated.filter(|_| !units.is_empty());
        let (unit, scale) = match stated.map(|stated| (stated, names::unit(units, stated))) {
            None => (None, 1.0),
            Some((_, Some((unit, scale)))) => (Some(unit), scale),
            Some((stated, None)) => {
                let known: Vec<&str> = units.iter().map(|(names, _)| names[0]).collect();
                bail!(
                    "{}: column `{}` has the unit `{stated}`, which is not one of {}: convert it, or \
                     leave the column out",
                    self.at,
                    field.text,
                    known.join(", ")
                );
            }
        };
        let name = field.text.clone();
        Ok(Column { index: field.index, element: field.element, name, unit, scale })
    }
}

/// The line that names the columns: the nearest one above the numbers with a time, or with a name that
/// was asked for; else the nearest one that is as wide as the table.
fn header(table: &Table, width: usize, mapping: &[Assignment]) -> Option<usize> {
    let asked = |text: &str| {
        let text = cell::bare(text);
        mapping.iter().any(|assignment| assignment.column.eq_ignore_ascii_case(text))
    };
    let names_columns = |row: &Row| {
        row.cells.iter().any(|text| asked(text) || time_names::is_name(&Name::parse(text).words))
    };
    let nearest = |is_it: &dyn Fn(&Row) -> bool| table.heading.iter().rposition(is_it);
    nearest(&|row| !row.is_comment && names_columns(row))
        // A comment is a header only if it has a name for every column.
        .or_else(|| nearest(&|row| row.cells.len().abs_diff(width) <= 1 && names_columns(row)))
        .or_else(|| nearest(&|row| !row.is_comment && row.cells.len() == width))
}

/// A row of units between the header and the numbers.
fn units_below(rows: &[Row]) -> Option<&Row> {
    let all = [names::TIME, names::LENGTH, names::ANGLE];
    let is_known = |text: &str| {
        let stated = stated_unit(text);
        stated.is_some_and(|stated| all.iter().any(|units| names::unit(units, &stated).is_some()))
    };
    rows.iter().find(|row| row.cells.iter().any(is_known))
}

/// `[s]`, `(s)` or `s`; nothing where no letter stands.
fn stated_unit(text: &str) -> Option<String> {
    let unit = cell::bare(text).trim_matches(['[', ']', '(', ')', '{', '}']).trim().to_lowercase();
    unit.contains(|c: char| c.is_alphabetic() || c == '°').then_some(unit)
}
