//! Stable fields beside encodings driven by time and other programs on handwriting: `imitation/lasa.py` has the data
//! and runs the others.

use anyhow::Result;

use super::{Sample, python};

/// The samples are of the shapes; nothing in them depends on the seed.
pub fn run_seed(_seed: u64) -> Result<Vec<Sample>> {
    python::samples("imitation/lasa.py", &[])
}
