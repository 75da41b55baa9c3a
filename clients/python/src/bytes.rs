//! Vectors of float64 as bytes, and errors as Python sees them.

use nalgebra::DVector;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

const FLOAT: usize = size_of::<f64>();

/// The numbers in `bytes`, little-endian.
pub fn floats(bytes: &[u8]) -> PyResult<Vec<f64>> {
    if !bytes.len().is_multiple_of(FLOAT) {
        return Err(PyValueError::new_err(format!("{} bytes are no float64 numbers", bytes.len())));
    }
    let number = |chunk: &[u8]| f64::from_le_bytes(chunk.try_into().expect("eight bytes"));
    Ok(bytes.chunks_exact(FLOAT).map(number).collect())
}

pub fn vector(bytes: &[u8]) -> PyResult<DVector<f64>> {
    floats(bytes).map(DVector::from_vec)
}

/// `numbers` as little-endian bytes.
pub fn packed<'py, 'a>(
    py: Python<'py>,
    numbers: impl IntoIterator<Item = &'a f64>,
) -> Bound<'py, PyBytes> {
    let bytes: Vec<u8> = numbers.into_iter().flat_map(|number| number.to_le_bytes()).collect();
    PyBytes::new(py, &bytes)
}

/// An error of a crate as a ValueError with its text.
pub fn refused(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}
