//! How many components a policy has: a number, or as many as the Bayesian information criterion finds.

use std::fmt;

use imitation::gmm::{self, GmmOptions};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use shm_types::MAX_COMPONENTS;

use super::time::{Moment, moments};
use super::{EncodingConfig, EncodingKind, FitError, files};
use crate::demonstration::Demonstration;
use crate::parameters::extent;

/// The choice is part of the fit, not of the search: the same for every session.
const SEED: u64 = 0;
/// Points that the criterion sees, at most. It takes points for independent, which neighbours on a path are not.
const N_POINTS: usize = 200;
/// A coordinate whose extent is below this never moves and is not fitted, m or rad.
const STILL: f64 = 1e-9;

/// `learner.n_components`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged, expecting = "use a number of components, or \"bic\"")]
pub enum Components {
    Number(usize),
    Chosen(Chosen),
}

/// By what a number of components is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Chosen {
    /// The lowest Bayesian information criterion.
    Bic,
}

impl Components {
    pub const BIC: Components = Components::Chosen(Chosen::Bic);

    /// The number, where it is one.
    pub fn number(self) -> Option<usize> {
        match self {
            Components::Number(number) => Some(number),
            Components::Chosen(Chosen::Bic) => None,
        }
    }
}

impl From<usize> for Components {
    fn from(number: usize) -> Components {
        Components::Number(number)
    }
}

/// As the configuration writes it, without quotes.
impl fmt::Display for Components {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Components::Number(number) => write!(f, "{number}"),
            Components::Chosen(Chosen::Bic) => write!(f, "bic"),
        }
    }
}

/// How many components the policy of `demonstrations` has.
///
/// `bic` takes the mixture with the lowest criterion of those with 1 to 16 components: over time and the learnt
/// coordinates that move, or over the coordinates alone where the state drives.
///
/// # Errors
/// Where the demonstrations have too few points for so many components: centre and directions of a component in time
/// and d coordinates are d + 2 numbers. Springs and `dmp`, whose components are spread evenly, take any number.
pub(super) fn number(
    config: &EncodingConfig,
    demonstrations: &[Demonstration],
) -> Result<usize, FitError> {
    if let (Some(number), true) = (config.components.number(), config.kind.has_activation()) {
        return Ok(number);
    }
    let moments = moments(demonstrations);
    let moves = |c: &usize| {
        let (low, high) = extent(moments.iter().map(|moment| moment.x[*c]));
        high - low > STILL
    };
    let moving: Vec<usize> = (0..config.policy.task_dim).filter(moves).collect();
    if let Some(number) = config.components.number() {
        return match config.kind {
            // Its fit counts the points while it moves.
            EncodingKind::Seds => Ok(number),
            _ => check(number, moving.len(), demonstrations, moments.len()).map(|()| number),
        };
    }
    let data = data(config.kind, &thinned(&moments), &moving);
    let most = (data.ncols() / (data.nrows() + 1)).clamp(1, MAX_COMPONENTS);
    let chosen = gmm::fit_by_bic(&data, 1..=most, &GmmOptions::default(), SEED)
        .map_err(|error| FitError::Bic { files: files(demonstrations), error })?;
    Ok(chosen.fit.mixture.n_components())
}

/// What the mixtures are of, one point a column.
fn data(kind: EncodingKind, moments: &[&Moment], moving: &[usize]) -> DMatrix<f64> {
    let skipped = usize::from(kind == EncodingKind::Seds);
    DMatrix::from_fn(1 - skipped + moving.len(), moments.len(), |row, k| match row + skipped {
        0 => moments[k].t_s,
        row => moments[k].x[moving[row - 1]],
    })
}

/// Every so many of the moments that [`N_POINTS`] remain.
fn thinned(moments: &[Moment]) -> Vec<&Moment> {
    moments.iter().step_by(moments.len().div_ceil(N_POINTS).max(1)).collect()
}

/// That `found` points are enough for `k` components in time and `d` coordinates.
fn check(
    k: usize,
    d: usize,
    demonstrations: &[Demonstration],
    found: usize,
) -> Result<(), FitError> {
    let needed = k * (d + 2);
    if found >= needed {
        return Ok(());
    }
    let (end_s, period_s) = (demonstrations[0].duration_s(), demonstrations[0].period_s());
    let (files, most) = (files(demonstrations), found / (d + 2));
    Err(FitError::TooFewPoints { files, k, d, needed, found, end_s, period_s, most })
}

#[cfg(test)]
mod tests;
