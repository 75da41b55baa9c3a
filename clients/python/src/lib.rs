//! The compiled half of the Python package `skillet`: searches and Eq. (5). Vectors pass as little-endian
//! float64 bytes, which NumPy reads and writes without a copy of its own library in here.

#![allow(non_snake_case)] // K, as in the paper

mod bytes;
mod policy;
mod search;

use pyo3::prelude::*;

#[pymodule]
mod _skillet {
    #[pymodule_export]
    use super::policy::Springs;
    #[pymodule_export]
    use super::search::Core;
}
