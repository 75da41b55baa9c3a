//! `[learner.action]`: where the search begins when the policy is an action vector (Sec. 4.2).

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use shm_types::MAX_ACTIONS;

use search::range::{ABOVE_ZERO, ANY, ConfigError, Range, within};
use search::{Bounds, Space};

/// Unit of actions.
const OF_TASK: &str = "units of the task's actions";

/// Empty for a task with an arm. All in the units of the task's world.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ActionConfig {
    /// Action at which the search begins.
    pub start: Vec<f64>,
    /// One unit of noise of each number, for numbers of different size. Default: 1 each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unit: Vec<f64>,
    /// Lower corner of a box known to hold the solutions; empty when none is known.
    pub min: Vec<f64>,
    /// Upper corner of the box.
    pub max: Vec<f64>,
}

impl ActionConfig {
    /// The policy is an action vector.
    pub fn is_used(&self) -> bool {
        !self.start.is_empty()
    }

    /// Settings and their ranges.
    pub fn ranges(&self) -> Vec<Range> {
        let entries = |name: &'static str, values: &[f64], limits| -> Vec<Range> {
            let entry = |(i, value): (usize, &f64)| {
                within(&format!("{name}[{i}]"), *value, limits, OF_TASK)
            };
            values.iter().enumerate().map(entry).collect()
        };
        [
            entries("start", &self.start, ANY),
            entries("unit", &self.unit, ABOVE_ZERO),
            entries("min", &self.min, ANY),
            entries("max", &self.max, ANY),
        ]
        .concat()
    }

    /// As many of each as of the others, and a box that holds the start.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let error = |field: &str, value: String, allowed: &str| ConfigError::Range {
            field: format!("action.{field}"),
            value,
            allowed: allowed.into(),
        };
        if self.start.len() > MAX_ACTIONS || self.start.iter().any(|value| !value.is_finite()) {
            let allowed = format!("at most {MAX_ACTIONS} finite numbers");
            return Err(error("start", format!("{:?}", self.start), &allowed));
        }
        let (units, numbers) = (self.unit.len(), self.start.len());
        let is_unit = |unit: &f64| unit.is_finite() && *unit > 0.0;
        if units > 0 && (units != numbers || !self.unit.iter().all(is_unit)) {
            let allowed = format!("{numbers} numbers above 0, or none");
            return Err(error("unit", format!("{:?}", self.unit), &allowed));
        }
        let Some(bounds) = self.bounds() else { return Ok(()) };
        let bounds = bounds.map_err(|why| {
            let value = format!("{:?} and max {:?}", self.min, self.max);
            error("min", value, &format!("another box: {why}"))
        })?;
        if !bounds.contains(&self.theta_0()) {
            return Err(error("start", format!("{:?}", self.start), "a start within the box"));
        }
        Ok(())
    }

    /// The space of the search. Precondition: [`ActionConfig::validate`] passed.
    pub fn space(&self) -> Space {
        let bounds = self.bounds().and_then(Result::ok);
        let mut space = Space { bounds, ..Space::white(self.theta_0()) };
        if !self.unit.is_empty() {
            space.exploration = DMatrix::from_diagonal(&DVector::from_column_slice(&self.unit));
        }
        space
    }

    fn theta_0(&self) -> DVector<f64> {
        DVector::from_column_slice(&self.start)
    }

    fn bounds(&self) -> Option<Result<Bounds, search::BoundsError>> {
        let is_known = !(self.min.is_empty() && self.max.is_empty());
        is_known.then(|| Bounds::new(self.start.len(), &self.min, &self.max))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refuses_what_is_no_start_or_no_box() {
        let config = |start: &[f64], min: &[f64], max: &[f64]| ActionConfig {
            start: start.into(),
            unit: Vec::new(),
            min: min.into(),
            max: max.into(),
        };
        assert_eq!(config(&[8.0, 2.0], &[], &[]).validate(), Ok(()));
        assert_eq!(config(&[8.0, 2.0], &[0.0, 0.0], &[10.0, 10.0]).validate(), Ok(()));
        for (bad, expected) in [
            (config(&[0.0; 17], &[], &[]), "at most 16"),
            (config(&[f64::NAN], &[], &[]), "learner.action.start is [NaN]"),
            (config(&[1.0], &[2.0], &[2.0]), "empty in parameter 0"),
            (config(&[1.0], &[2.0], &[]), "1 minima and 0 maxima"),
            (config(&[1.0], &[2.0], &[3.0]), "a start within the box"),
        ] {
            let message = bad.validate().unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn numbers_of_different_sizes_have_units() {
        let with = |unit: &[f64]| ActionConfig {
            start: vec![8.0, 2.0],
            unit: unit.into(),
            ..ActionConfig::default()
        };
        assert!(with(&[]).space().is_white());
        assert_eq!(with(&[1.0, 10.0]).space().exploration[(1, 1)], 10.0);
        for bad in [&[1.0][..], &[1.0, 0.0], &[1.0, -1.0], &[1.0, f64::NAN]] {
            let message = with(bad).validate().unwrap_err().to_string();
            assert!(message.contains("learner.action.unit"), "{message}");
        }
    }
}
