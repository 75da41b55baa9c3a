//! Which column is the time, and its unit: stated, or by the size of its steps.

use anyhow::{Result, bail};

use super::cell;
use super::fields::{Column, Field, Fields};
use super::names::{self, unit};
use super::time_names::rank;

/// A period of samples lies within these bounds, so that the size of a step tells its unit, s.
const PERIOD_S: std::ops::Range<f64> = 4e-4..0.4;
/// Since 1970, s: from 1973 on, so that the units of time cannot be confused.
const EPOCH_S: std::ops::Range<f64> = 1e8..1e11;
/// A period of samples with such a time, s.
const EPOCH_PERIOD_S: std::ops::Range<f64> = 1e-5..10.0;

/// The column of the time; two that add up where seconds and nanoseconds have one each.
pub fn columns(fields: &Fields) -> Result<Vec<Column>> {
    let mut ranked: Vec<(usize, &Field)> =
        fields.all.iter().filter_map(|field| Some((rank(&field.name.words)?, field))).collect();
    ranked.sort_by_key(|(rank, _)| *rank);
    let groups: Vec<Vec<&Field>> = ranked
        .chunk_by(|a, b| a.0 == b.0)
        .map(|group| group.iter().map(|(_, field)| *field).collect())
        .collect();
    let advancing = |group: &&Vec<&Field>| group.iter().any(|field| advances(fields, field));
    let Some(group) = groups.iter().find(advancing).or(groups.first()) else {
        bail!(
            "{}: has no time: name its column t_s (or t_ms, t_us, t_ns), or say --columns t=NAME; {}",
            fields.at(),
            fields.listing()
        );
    };
    let columns: Vec<Column> =
        group.iter().map(|field| column(fields, field)).collect::<Result<_>>()?;
    match columns.as_slice() {
        [_] => Ok(columns),
        [a, b] if a.scale.max(b.scale) == 1.0 && a.scale.min(b.scale) == 1e-9 => Ok(columns),
        [a, b, ..] => bail!(
            "{}: both {} and {} give t: keep one, or say --columns t=NAME",
            fields.at(),
            a.name,
            b.name
        ),
        [] => unreachable!("a group has members"),
    }
}

fn column(fields: &Fields, field: &Field) -> Result<Column> {
    // The name may be the unit alone.
    let stated = field.name.unit.as_deref().or_else(|| match &field.name.words[..] {
        [word] if unit(names::TIME, word).is_some() => Some(word.as_str()),
        _ => None,
    });
    fields.column_in(field, names::TIME, stated)
}

/// From the first row to the last one.
fn advances(fields: &Fields, field: &Field) -> bool {
    let value = |row: &super::dialect::Row| {
        row.cells.get(field.index).and_then(|text| cell::number(text, fields.table.decimal_mark))
    };
    let values: Vec<f64> = fields.table.rows.iter().filter_map(value).collect();
    values.first() < values.last()
}

/// Symbol and scale of the unit of `stamps` that state none: seconds, unless their size says otherwise.
pub fn guess_unit(stamps: &[f64]) -> (&'static str, f64) {
    let mut steps: Vec<f64> =
        stamps.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    let (Some(step), Some(first)) = (steps.get(steps.len() / 2), stamps.first()) else {
        return ("s", 1.0);
    };
    let units = names::TIME.iter().map(|(names, scale)| (names[0], *scale));
    let since_1970 = |(_, scale): &(&str, f64)| {
        EPOCH_S.contains(&(first * scale)) && EPOCH_PERIOD_S.contains(&(step * scale))
    };
    let by_step = |(_, scale): &(&str, f64)| PERIOD_S.contains(&(step * scale));
    units.clone().find(since_1970).or_else(|| units.clone().find(by_step)).unwrap_or(("s", 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_size_of_stamps_tells_their_unit() {
        for (first, step, unit) in [
            (0.0, 0.01, "s"),
            (5.0, 0.001, "s"),
            (0.0, 10.0, "ms"),
            (0.0, 1.0, "ms"),
            (0.0, 2000.0, "us"),
            (0.0, 1e6, "ns"),
            (0.0, 3.3e7, "ns"),
            // A clock that counts from the start of the machine.
            (5e12, 1e7, "ns"),
            (8e8, 1e4, "us"),
            (1.73e9, 0.01, "s"),
            (1.73e9, 1.0, "s"),
            (1.73e12, 10.0, "ms"),
            (1.73e15, 1e3, "us"),
            (1.73e18, 1e7, "ns"),
        ] {
            let stamps: Vec<f64> = (0..9).map(|k| first + step * f64::from(k)).collect();
            assert_eq!(guess_unit(&stamps).0, unit, "{first} + {step}");
        }
        assert_eq!(guess_unit(&[]).0, "s");
        assert_eq!(guess_unit(&[3.0, 3.0]).0, "s");
    }
}
