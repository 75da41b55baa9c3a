//! Ranges and units of settings: one line a field, one message for all of them.

use std::fmt;

use thiserror::Error;

/// A setting, its value, its limits and their unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Range {
    /// Its name below the table that is checked, as `power.n_elites`; entries of lists as `unit[0]`.
    pub field: String,
    pub value: f64,
    pub limits: Limits,
    /// As `s` or `s⁻²`; `1` of a number without one.
    pub unit: &'static str,
    /// A smaller upper limit that follows from another setting.
    most: f64,
}

/// The least and the greatest value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    pub min: f64,
    pub max: f64,
}

/// Every finite number.
pub const ANY: Limits = Limits { min: f64::MIN, max: f64::MAX };
/// Every finite number above 0.
pub const ABOVE_ZERO: Limits = Limits { min: f64::MIN_POSITIVE, max: f64::MAX };

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
pub fn range(field: &str, value: f64, min: f64, max: f64, unit: &'static str) -> Range {
    within(field, value, Limits { min, max }, unit)
}

/// The same with limits that several fields share.
pub fn within(field: &str, value: f64, limits: Limits, unit: &'static str) -> Range {
    Range { field: field.into(), value, limits, unit, most: limits.max }
}

impl Range {
    /// The same where another setting lowers the upper limit.
    pub fn up_to(self, most: f64) -> Range {
        Range { most: most.min(self.limits.max), ..self }
    }

    /// The same in the table `prefix`, as `power.`.
    pub fn inside(self, prefix: &str) -> Range {
        Range { field: format!("{prefix}{}", self.field), ..self }
    }

    pub fn holds(&self) -> bool {
        (self.limits.min..=self.most).contains(&self.value)
    }

    /// What is allowed, as `0.1 to 3 s`.
    pub fn allowed(&self) -> String {
        let limits = Limits { max: self.most, ..self.limits };
        // Several words are no unit that could stand behind a number.
        let is_unit = self.unit != "1" && !self.unit.contains(' ');
        if is_unit { format!("{limits} {}", self.unit) } else { limits.to_string() }
    }
}

impl fmt::Display for Limits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (min, max) = (said(self.min), said(self.max));
        match (self.min == ANY.min, self.min == ABOVE_ZERO.min, self.max == ANY.max) {
            (true, _, true) => write!(f, "any number"),
            (_, true, true) => write!(f, "above 0"),
            (_, _, true) => write!(f, "{min} or more"),
            _ => write!(f, "{min} to {max}"),
        }
    }
}

/// Without rows of zeros.
fn said(limit: f64) -> String {
    let is_plain = limit == 0.0 || (1e-4..1e7).contains(&limit.abs());
    if is_plain { limit.to_string() } else { format!("{limit:e}") }
}

/// `ranges`, all in the table `prefix`.
pub fn inside(prefix: &str, ranges: impl IntoIterator<Item = Range>) -> Vec<Range> {
    ranges.into_iter().map(|range| range.inside(prefix)).collect()
}

/// All fields within their ranges; `prefix` is the table they stand in, as `search.power.`.
pub fn check(prefix: &str, ranges: &[Range]) -> Result<(), ConfigError> {
    match ranges.iter().find(|range| !range.holds()) {
        None => Ok(()),
        Some(range) => Err(ConfigError::Range {
            field: format!("{prefix}{}", range.field),
            value: range.value.to_string(),
            allowed: range.allowed(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_say_what_is_allowed() {
        let said = |limits: Limits| within("f", 0.0, limits, "1").allowed();
        assert_eq!(said(ANY), "any number");
        assert_eq!(said(ABOVE_ZERO), "above 0");
        assert_eq!(said(Limits { min: 0.5, max: f64::MAX }), "0.5 or more");
        assert_eq!(range("f", 0.0, -1.0, 1e4, "s").allowed(), "-1 to 10000 s");
        assert_eq!(range("f", 0.0, 1e-12, 1e12, "1").allowed(), "1e-12 to 1e12");
    }

    #[test]
    fn what_is_not_finite_is_outside_of_every_range() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(!within("f", value, ANY, "1").holds());
        }
        assert!(!within("f", 0.0, ABOVE_ZERO, "1").holds());
    }

    #[test]
    fn another_setting_only_lowers_a_limit() {
        let of = |most| range("min", 2.0, 0.0, 3.0, "1").up_to(most);
        assert!(of(2.0).holds() && !of(1.9).holds());
        assert_eq!((of(9.0).allowed(), of(1.0).allowed()), ("0 to 3".into(), "0 to 1".into()));
    }
}
