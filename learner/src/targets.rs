//! Targets of a search by their names: what a rollout measured of them.
//!
//! The search itself knows no names, only the order of its targets. A session told live, resumed or
//! replayed gets the same values, from the measures that are stored with every trial.

use search::aim::Target;
use shm_types::measures::{Measures, TRUTH};
use thiserror::Error;

use crate::judge::Declared;

/// Why a target cannot be aimed at.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TargetError {
    #[error("{field} is {name}, which the task does not measure: use {known}")]
    Unknown { field: String, name: String, known: String },
    #[error("{field} is {name}, {kind}: use {known}")]
    Kind { field: String, name: String, kind: &'static str, known: String },
}

/// What was measured of `targets`, in their order: `None` where a measure is missing.
pub fn measured(targets: &[Target], measures: &Measures) -> Vec<Option<f64>> {
    let is_there = |target: &&Target| target.when.as_ref().is_none_or(|when| measures.has(when));
    let value = |target| Some(target).filter(is_there).and_then(|t| measures.get(&t.measure));
    targets.iter().map(value).collect()
}

/// That the task measures what is aimed at: numbers, each with or without a truth value it depends on.
pub fn check(targets: &[Target], declared: &Declared) -> Result<(), TargetError> {
    for (i, target) in targets.iter().enumerate() {
        let field = |part: &str| format!("learner.search.aim.targets[{i}].{part}");
        check_name(field("measure"), &target.measure, false, declared)?;
        if let Some(when) = &target.when {
            check_name(field("when"), when, true, declared)?;
        }
    }
    Ok(())
}

fn check_name(
    field: String,
    name: &str,
    is_truth: bool,
    declared: &Declared,
) -> Result<(), TargetError> {
    let fits = |unit: &str| (unit == TRUTH) == is_truth;
    let known = || {
        let names = declared.iter().filter(|(_, unit)| fits(unit)).map(|(name, _)| name.as_str());
        names.collect::<Vec<_>>().join(", ")
    };
    let kind = if is_truth { "a number" } else { "a truth value" };
    match declared.iter().find(|(other, _)| other == name) {
        Some((_, unit)) if fits(unit) => Ok(()),
        Some(_) => Err(TargetError::Kind { field, name: name.into(), kind, known: known() }),
        None => Err(TargetError::Unknown { field, name: name.into(), known: known() }),
    }
}

#[cfg(test)]
mod tests {
    use shm_types::measures::Measure;

    use super::*;

    fn target(measure: &str, when: Option<&str>) -> Target {
        let target = Target::new(measure, [0.0, 1.0], 0.1);
        match when {
            Some(name) => target.when(name),
            None => target,
        }
    }

    fn measures(tossed: bool) -> Measures {
        let number = |name, value| Measure { name, unit: "m", value };
        let all = [number("apex_m", 0.4), number("miss_m", 0.0), Measure::truth("tossed", tossed)];
        Measures::of(all).unwrap()
    }

    #[test]
    fn values_come_in_the_order_of_the_targets_and_are_missing_where_they_are_not_there() {
        let targets = [target("miss_m", Some("tossed")), target("apex_m", None)];
        assert_eq!(measured(&targets, &measures(true)), [Some(0.0), Some(0.4)]);
        assert_eq!(measured(&targets, &measures(false)), [None, Some(0.4)]);
        assert_eq!(measured(&targets, &Measures::NONE), [None, None]);
    }

    #[test]
    fn what_cannot_be_aimed_at_is_refused_with_what_can() {
        let declared = measures(true).declared();
        let refused = |target| check(&[target], &declared).unwrap_err().to_string();
        assert_eq!(check(&[target("apex_m", Some("tossed"))], &declared), Ok(()));
        let error = refused(target("height", None));
        assert!(error.contains("targets[0].measure is height") && error.contains("apex_m, miss_m"));
        let error = refused(target("tossed", None));
        assert!(error.contains("a truth value") && error.contains("apex_m, miss_m"), "{error}");
        let error = refused(target("apex_m", Some("miss_m")));
        assert!(error.contains("targets[0].when is miss_m") && error.contains("tossed"), "{error}");
        assert!(refused(target("apex_m", Some("flown"))).contains("does not measure"));
    }
}
