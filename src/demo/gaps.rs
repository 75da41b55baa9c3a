//! Cells without a value: filled from their neighbours in time. Pauses are warned of.

use anyhow::{Result, bail};
use learner::trajectory::sample;

/// A pause longer than this many usual periods is worth a warning.
const GAP_PERIODS: f64 = 5.0;
const MIN_ROWS: usize = 3;

/// Rows with some cells empty, at strictly increasing times.
pub struct Sparse {
    pub times_s: Vec<f64>,
    pub lines: Vec<u64>,
    pub rows: Vec<Vec<Option<f64>>>,
}

/// The same with a number in every cell.
pub struct Dense {
    pub times_s: Vec<f64>,
    pub lines: Vec<u64>,
    pub rows: Vec<Vec<f64>>,
    pub warnings: Vec<String>,
}

/// Fills each empty cell from a smooth curve through the others of its column; rows before the first or
/// after the last value of some column are left out. `names` are those of the columns.
pub fn fill(file: &str, names: &[&str], sparse: &Sparse) -> Result<Dense> {
    let Sparse { times_s, lines, rows } = sparse;
    if rows.len() < MIN_ROWS {
        bail!("{file}: {} rows: record at least {MIN_ROWS}, better 100 a second", rows.len());
    }
    let (mut first, mut end) = (0, rows.len());
    let (mut columns, mut pauses, mut filled) = (Vec::new(), Vec::new(), None);
    for (c, name) in names.iter().enumerate() {
        let known: Vec<usize> = (0..rows.len()).filter(|k| rows[*k][c].is_some()).collect();
        let [start, .., last] = known.as_slice() else {
            bail!("{file}: column {name} holds {} values: record at least {MIN_ROWS}", known.len());
        };
        (first, end) = (first.max(*start), end.min(last + 1));
        let at: Vec<f64> = known.iter().map(|k| times_s[*k]).collect();
        let values: Vec<[f64; 1]> = known.iter().filter_map(|k| Some([rows[*k][c]?])).collect();
        pauses.extend(gaps(&at).map(|(i, gap_s, usual_s)| (lines[known[i]], gap_s, usual_s)));
        columns.push(match known.len() == rows.len() {
            true => values,
            false => sample(&at, &values, times_s),
        });
    }
    if end < first + MIN_ROWS {
        bail!(
            "{file}: the columns have values at {} common times: record at least {MIN_ROWS}",
            end.saturating_sub(first)
        );
    }
    let mut n_filled = 0;
    for (k, row) in rows.iter().enumerate().take(end).skip(first) {
        for (_, name) in row.iter().zip(names).filter(|(value, _)| value.is_none()) {
            n_filled += 1;
            filled = filled.or(Some((lines[k], *name)));
        }
    }
    let mut warnings = Vec::new();
    if let Some((line, name)) = filled {
        warnings.push(format!(
            "{file}: {n_filled} cells without a value are filled from their neighbours, the first in \
             column {name}, line {line}"
        ));
    }
    // A pause of all columns is one pause.
    pauses.sort_by_key(|(line, ..)| *line);
    pauses.dedup_by_key(|(line, ..)| *line);
    warnings.extend(pauses.iter().map(|(line, gap_s, usual_s)| {
        format!(
            "{file}, line {line}: {gap_s:.3} s since the value before, usual are {usual_s:.4} s: what is \
             between is interpolated; record again if it matters"
        )
    }));
    let row = |k: usize| columns.iter().map(|column| column[k][0]).collect();
    Ok(Dense {
        times_s: times_s[first..end].to_vec(),
        lines: lines[first..end].to_vec(),
        rows: (first..end).map(row).collect(),
        warnings,
    })
}

/// Every pause: which time ends it, how long it and the usual period are, s.
fn gaps(times_s: &[f64]) -> impl Iterator<Item = (usize, f64, f64)> {
    let periods: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted = periods.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[sorted.len() / 2];
    let long = move |(i, period): (usize, f64)| {
        (period > GAP_PERIODS * usual).then_some((i + 1, period, usual))
    };
    periods.into_iter().enumerate().filter_map(long)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sparse(rows: Vec<Vec<Option<f64>>>) -> Sparse {
        Sparse {
            times_s: (0..rows.len()).map(|k| 0.1 * k as f64).collect(),
            lines: (0..rows.len() as u64).map(|k| k + 2).collect(),
            rows,
        }
    }

    #[test]
    fn interleaved_columns_fill_each_other_and_ends_without_both_are_left_out() {
        let cell = |k: usize, c: usize| (k % 2 == c).then_some(k as f64 * (c as f64 + 1.0));
        let dense = fill(
            "r.csv",
            &["a", "b"],
            &sparse((0..9).map(|k| vec![cell(k, 0), cell(k, 1)]).collect()),
        );
        let dense = dense.unwrap();
        assert_eq!(dense.lines, (3..=9).collect::<Vec<u64>>());
        for (k, row) in dense.rows.iter().enumerate() {
            let x = (k + 1) as f64;
            assert!((row[0] - x).abs() < 1e-12 && (row[1] - 2.0 * x).abs() < 1e-12, "{row:?}");
        }
        assert_eq!(dense.warnings.len(), 1);
        assert!(dense.warnings[0].contains("7 cells") && dense.warnings[0].contains("line 3"));
    }

    #[test]
    fn what_has_no_values_is_refused_by_name() {
        let none = fill("r.csv", &["a", "b"], &sparse(vec![vec![Some(1.0), None]; 5]));
        assert!(none.err().unwrap().to_string().contains("column b holds 0 values"));
        let apart = |k: usize| vec![(k < 4).then_some(1.0), (k > 3).then_some(1.0)];
        let apart = fill("r.csv", &["a", "b"], &sparse((0..8).map(apart).collect()));
        assert!(apart.err().unwrap().to_string().contains("at least 3"));
    }
}
