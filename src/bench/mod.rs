//! `skillet bench`: how long things take on this host, as full distributions.
//!
//! One module a bench, each a [`Bench`] whose `run` returns rows; [`output`] prints them and
//! [`page`] draws them. Whatever is compared is measured in turn, round after round, so that drift
//! of a busy host hits all of it alike.

pub mod arm;
mod figure;
pub mod latency;
pub mod learner;
pub mod output;
mod page;
mod row;
pub mod service;
pub mod sim;
pub mod swap;
mod table;
pub mod tick;
pub mod transport;

use std::time::Duration;

use anyhow::Result;

pub use row::Row;

/// What `skillet bench NAME` does.
pub struct Bench {
    pub name: &'static str,
    pub title: &'static str,
    /// How it measures, for the page.
    pub about: &'static str,
    /// Default of `--seconds`.
    pub seconds: f64,
    pub run: fn(&Plan) -> Result<Vec<Row>>,
}

/// How much is measured.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    pub seconds: f64,
    pub rounds: u32,
    /// How often, where that can be asked for.
    pub n: Option<u64>,
}

impl Plan {
    /// Time for each of `n` cases in each round.
    pub fn slice(&self, n: usize) -> Duration {
        Duration::from_secs_f64(self.seconds / (f64::from(self.rounds) * n.max(1) as f64))
    }
}

/// Measures for about so long, at least once.
type Measure<'a> = dyn FnMut(Duration, &mut Row) -> Result<()> + 'a;

/// A row and how it is measured.
pub struct Case<'a> {
    pub row: Row,
    pub measure: Box<Measure<'a>>,
}

/// Measures all cases in turn, round after round.
pub fn interleave(plan: &Plan, mut cases: Vec<Case>) -> Result<Vec<Row>> {
    let slice = plan.slice(cases.len());
    for _ in 0..plan.rounds {
        for case in &mut cases {
            (case.measure)(slice, &mut case.row)?;
        }
    }
    Ok(cases.into_iter().map(|case| case.row).collect())
}
