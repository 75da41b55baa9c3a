//! Matrices and vectors as people write them: lists of rows.

use super::PolicyJsonError;
use crate::policy::packed_index;
use crate::{PACKED, TASK_DIM};

pub(super) type Rows = Vec<Vec<f64>>;

/// The leading d×d block of a matrix.
pub(super) fn rows(d: usize, entry: impl Fn(usize, usize) -> f64) -> Rows {
    (0..d).map(|row| (0..d).map(|column| entry(row, column)).collect()).collect()
}

/// Packed lower triangle of a symmetric d×d matrix; `what` names it in an error.
pub(super) fn packed(rows: &Rows, d: usize, what: &str) -> Result<[f64; PACKED], PolicyJsonError> {
    check(rows, d, what)?;
    let mut packed = [0.0; PACKED];
    for (row, values) in rows.iter().enumerate() {
        for (column, &value) in values[..=row].iter().enumerate() {
            if value != rows[column][row] {
                return Err(PolicyJsonError::Asymmetric { what: what.into() });
            }
            packed[packed_index(row, column)] = value;
        }
    }
    Ok(packed)
}

/// A d×d matrix as the leading block of rows of six; without rows it is zero.
pub(super) fn block(rows: &Rows, d: usize, what: &str) -> Result<[f64; 36], PolicyJsonError> {
    let mut block = [0.0; 36];
    if !rows.is_empty() {
        check(rows, d, what)?;
    }
    for (row, values) in rows.iter().enumerate() {
        block[TASK_DIM * row..][..d].copy_from_slice(values);
    }
    Ok(block)
}

/// The first n of six numbers; without numbers they are zero.
pub(super) fn leading(
    values: &[f64],
    n: usize,
    what: &str,
) -> Result<[f64; TASK_DIM], PolicyJsonError> {
    let mut leading = [0.0; TASK_DIM];
    match values.len() {
        0 => {}
        found if found == n => leading[..n].copy_from_slice(values),
        _ => return Err(PolicyJsonError::Length { what: what.into(), n }),
    }
    Ok(leading)
}

fn check(rows: &Rows, n: usize, what: &str) -> Result<(), PolicyJsonError> {
    if rows.len() != n || rows.iter().any(|row| row.len() != n) {
        return Err(PolicyJsonError::Rows { what: what.into(), n });
    }
    Ok(())
}
