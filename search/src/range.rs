//! Ranges of settings: one line a field, one message for all of them.

use thiserror::Error;

/// A setting, its value and what is allowed.
#[derive(Clone, Debug, PartialEq)]
pub struct Range {
    pub field: String,
    pub value: f64,
    pub min: f64,
    pub max: f64,
}

/// A setting outside its range, or changed under a running session.
#[derive(Debug, Error, PartialEq)]
pub enum ConfigError {
    #[error("learner.{field} is {value}: use {allowed}")]
    Range { field: String, value: String, allowed: String },
    #[error(
        "learner.{field} is {found}, but the session was started with {stored}: resume it with its \
         own configuration, or start another one with --out"
    )]
    Changed { field: String, found: String, stored: String },
}

/// The range of one field, by its name.
pub fn range(field: &str, value: f64, min: f64, max: f64) -> Range {
    Range { field: field.into(), value, min, max }
}

/// All fields within their ranges; `prefix` is the table they stand in, as `search.power.`.
pub fn check(prefix: &str, ranges: &[Range]) -> Result<(), ConfigError> {
    match ranges.iter().find(|range| !(range.min..=range.max).contains(&range.value)) {
        None => Ok(()),
        Some(Range { field, value, min, max }) => Err(ConfigError::Range {
            field: format!("{prefix}{field}"),
            value: value.to_string(),
            allowed: format!("{min} to {max}"),
        }),
    }
}
