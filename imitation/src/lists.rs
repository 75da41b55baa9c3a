//! Matrices in JSON: lists of rows, whatever the linear algebra library would write.

use nalgebra::{DMatrix, DVector};

pub(crate) type Rows = Vec<Vec<f64>>;

pub(crate) fn rows(matrix: &DMatrix<f64>) -> Rows {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

/// The matrix with these rows; `None` if they are not equally long or there are none.
pub(crate) fn matrix(rows: &[Vec<f64>]) -> Option<DMatrix<f64>> {
    let width = rows.first()?.len();
    let equal = rows.iter().all(|row| row.len() == width);
    equal.then(|| DMatrix::from_fn(rows.len(), width, |i, j| rows[i][j]))
}

pub(crate) fn lists(vectors: &[DVector<f64>]) -> Rows {
    vectors.iter().map(|vector| vector.as_slice().to_vec()).collect()
}

pub(crate) fn vectors(lists: Rows) -> Vec<DVector<f64>> {
    lists.into_iter().map(DVector::from_vec).collect()
}

pub(crate) fn matrices(lists: &[Rows]) -> Option<Vec<DMatrix<f64>>> {
    lists.iter().map(|rows| matrix(rows)).collect()
}
