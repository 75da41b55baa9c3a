//! `[learner.search]` of the configuration file: which search, and a table of settings for each.

use serde::{Deserialize, Serialize};

use super::algorithm1::Algorithm1Config;
use super::power::PowerConfig;
use super::random::RandomConfig;
use super::tempered::TemperedConfig;
use crate::range::{ConfigError, check};

/// Which search proposes the policies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// PoWER with covariance adaptation, Eqs. (1) and (6).
    Power,
    /// Random search around the start.
    Random,
    /// Mixture search with split and merge as printed, Algorithm 1.
    Algorithm1,
    /// Mixture search that is importance-corrected, tempered and finds its number of components.
    Tempered,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SearchConfig {
    pub method: Method,
    pub power: PowerConfig,
    pub random: RandomConfig,
    pub algorithm1: Algorithm1Config,
    pub tempered: TemperedConfig,
}

impl Default for SearchConfig {
    fn default() -> Self {
        SearchConfig {
            method: Method::Power,
            power: PowerConfig::default(),
            random: RandomConfig::default(),
            algorithm1: Algorithm1Config::default(),
            tempered: TemperedConfig::default(),
        }
    }
}

impl SearchConfig {
    /// Every field within its range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        check("search.power.", &self.power.ranges())?;
        check("search.random.", &self.random.ranges())?;
        check("search.algorithm1.", &self.algorithm1.ranges())?;
        check("search.tempered.", &self.tempered.ranges())?;
        Ok(())
    }
}
