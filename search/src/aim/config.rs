//! Settings of the search: its targets, and how far it looks.

use serde::{Deserialize, Serialize};

use crate::range::{ABOVE_ZERO, ANY, ConfigError, Range, inside, range, within};

/// More parts than there are rollouts are never covered.
const MAX_PARTS: usize = 100;
/// Unit of what is in the unit of a target's measure.
const OF_MEASURE: &str = "unit of the measure";

/// A measure and its target window.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// Name of the measure; it has no meaning to the search.
    pub measure: String,
    /// A truth value without which the measure does not exist, such as `tossed`. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub when: Option<String>,
    /// Lower end of the window, below `max`.
    pub min: f64,
    /// Upper end of the window.
    pub max: f64,
    /// Approximate change of the measure per unit of exploration.
    pub scale: f64,
    /// Number of equal parts of the window; a covering search aims at a success in each. Default: 1.
    #[serde(default = "whole", skip_serializing_if = "is_whole")]
    pub parts: usize,
}

fn whole() -> usize {
    1
}

fn is_whole(parts: &usize) -> bool {
    *parts == 1
}

impl Target {
    /// A measure that is always there.
    pub fn new(measure: &str, [min, max]: [f64; 2], scale: f64) -> Target {
        Target { measure: measure.into(), when: None, min, max, scale, parts: whole() }
    }

    /// One that is there only where the truth value `name` holds.
    pub fn when(self, name: &str) -> Target {
        Target { when: Some(name.into()), ..self }
    }

    pub(super) fn width(&self) -> f64 {
        self.max - self.min
    }

    pub(super) fn contains(&self, value: f64) -> bool {
        (self.min..=self.max).contains(&value)
    }

    /// The window of one of its parts.
    pub(super) fn part(&self, i: usize) -> [f64; 2] {
        let edge = |i: usize| self.min + self.width() * i as f64 / self.parts as f64;
        [edge(i), edge(i + 1)]
    }

    /// The part that holds `value`, the nearest one where it is outside the window.
    pub(super) fn part_of(&self, value: f64) -> usize {
        let share = (value - self.min) / self.width() * self.parts as f64;
        (share.max(0.0) as usize).min(self.parts - 1)
    }
}

/// What follows the first successes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Then {
    /// More of the same.
    #[default]
    Aim,
    /// PoWER among the successes, for everything the targets do not cover.
    Power,
    /// Successes in every part of the windows.
    Cover,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct AimConfig {
    /// Whether to use the task's prediction of its measures, if it has one.
    pub predict: bool,
    /// Policies drawn around the start, of which the most promising one is executed.
    pub candidates: usize,
    /// Standard deviation of these draws, in scaled units.
    pub std: f64,
    /// Length scale of local effects on the measures, in units of `std`.
    pub length: f64,
    /// What follows the first successes.
    pub then: Then,
    /// Successes after which `then` begins.
    pub successes: u64,
    /// Exploration floor of PoWER from then on, in scaled units.
    pub floor_std: f64,
    /// The measures to aim at, each with its window.
    pub targets: Vec<Target>,
}

impl Default for AimConfig {
    fn default() -> Self {
        AimConfig {
            predict: true,
            candidates: 192,
            std: 1.0,
            length: 1.5,
            then: Then::Aim,
            successes: 4,
            floor_std: 0.25,
            targets: Vec::new(),
        }
    }
}

impl AimConfig {
    /// Settings and their ranges.
    pub fn ranges(&self) -> Vec<Range> {
        let own = vec![
            range("candidates", self.candidates as f64, 1.0, 1e4, "1"),
            range("std", self.std, 1e-6, 100.0, "1"),
            range("length", self.length, 0.01, 100.0, "1"),
            range("successes", self.successes as f64, 1.0, 1e4, "1"),
            range("floor_std", self.floor_std, 0.0, 100.0, "1"),
        ];
        let of_target = |(i, target): (usize, &Target)| {
            let ranges = [
                within("min", target.min, ANY, OF_MEASURE),
                within("max", target.max, ANY, OF_MEASURE),
                within("scale", target.scale, ABOVE_ZERO, OF_MEASURE),
                range("parts", target.parts as f64, 1.0, MAX_PARTS as f64, "1"),
            ];
            inside(&format!("targets[{i}]."), ranges)
        };
        own.into_iter().chain(self.targets.iter().enumerate().flat_map(of_target)).collect()
    }

    /// Every window open, and not too many parts.
    pub fn validate(&self) -> Result<(), ConfigError> {
        for (i, target) in self.targets.iter().enumerate() {
            let field = |name: &str| format!("search.aim.targets[{i}].{name}");
            let name = &target.measure;
            if !(target.min.is_finite() && target.max.is_finite() && target.min < target.max) {
                return Err(ConfigError::Range {
                    field: field("min"),
                    value: target.min.to_string(),
                    allowed: format!("finite numbers, for {name} a min below max = {}", target.max),
                });
            }
            if !(target.scale.is_finite() && target.scale > 0.0) {
                return Err(ConfigError::Range {
                    field: field("scale"),
                    value: target.scale.to_string(),
                    allowed: format!("about what {name} changes with one unit of exploration, > 0"),
                });
            }
            if !(1..=MAX_PARTS).contains(&target.parts) {
                return Err(ConfigError::Range {
                    field: field("parts"),
                    value: target.parts.to_string(),
                    allowed: format!("parts of the window of {name}, 1 to {MAX_PARTS}"),
                });
            }
        }
        let parts = self.targets.iter().fold(1_usize, |all, t| all.saturating_mul(t.parts));
        if parts > MAX_PARTS {
            return Err(ConfigError::Range {
                field: "search.aim.targets".into(),
                value: format!("{parts} combinations of parts"),
                allowed: format!("at most {MAX_PARTS}, all parts multiplied"),
            });
        }
        Ok(())
    }

    /// The same of a search that is to run: there is something to aim at.
    pub fn validate_in_use(&self) -> Result<(), ConfigError> {
        if self.targets.is_empty() {
            return Err(ConfigError::Range {
                field: "search.aim.targets".into(),
                value: "empty".into(),
                allowed: "one target or more, as \
                          [{ measure = \"apex_m\", min = 0.3, max = 0.6, scale = 0.1 }]"
                    .into(),
            });
        }
        Ok(())
    }
}
