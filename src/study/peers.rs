//! The search of `skillet learn` beside those of other packages, on the same rollouts.
//! `clients/python/peers.py` says what each method is told.

use anyhow::Result;

use super::{Sample, python};

pub fn run_seed(seed: u64) -> Result<Vec<Sample>> {
    python::samples("clients/python/peers.py", &["--seeds", "1", "--first-seed", &seed.to_string()])
}
