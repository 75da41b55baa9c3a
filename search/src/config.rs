//! `[learner.search]` of the configuration file: which search, and a table of settings for each.

use serde::{Deserialize, Serialize};

use super::aim::{AimConfig, Target};
use super::algorithm1::Algorithm1Config;
use super::cem::CemConfig;
use super::enac::EnacConfig;
use super::niching::NichingConfig;
use super::pi2::Pi2Config;
use super::power::PowerConfig;
use super::random::RandomConfig;
use super::regions::RegionsConfig;
use super::reinforce::ReinforceConfig;
use super::rewards::RewardMap;
use super::rwr::RwrConfig;
use super::tempered::TemperedConfig;
use crate::range::{ConfigError, Range, check, inside};

/// Which search proposes the policies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// PoWER with covariance adaptation, Eqs. (1) and (6).
    Power,
    /// The most promising candidate, by what was measured of the others.
    Aim,
    /// Random search around the start, or in the box.
    Random,
    /// Cross-entropy method.
    Cem,
    /// PI² with covariance adaptation.
    Pi2,
    /// Reward-weighted regression.
    Rwr,
    /// REINFORCE with a baseline.
    Reinforce,
    /// Episodic natural actor critic.
    Enac,
    /// All optima of a known box.
    Niching,
    /// The regions of high reward in a known box, and how many there are.
    Regions,
    /// Mixture search with split and merge as printed, Algorithm 1.
    Algorithm1,
    /// Mixture search that is importance-corrected, tempered and finds its number of components.
    Tempered,
}

impl Method {
    /// Trials that it did not propose teach it as much as others: it can be told a history anew.
    pub fn learns_from_any_trial(self) -> bool {
        matches!(self, Method::Power | Method::Aim)
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SearchConfig {
    /// The search that proposes policies; it uses the table of its name.
    pub method: Method,
    /// Mapping from rewards to what the search sees; the session keeps the rewards themselves.
    pub reward_map: RewardMap,
    /// PoWER with covariance adaptation.
    pub power: PowerConfig,
    /// Search that aims at windows of measures.
    pub aim: AimConfig,
    /// Random search.
    pub random: RandomConfig,
    /// Cross-entropy method.
    pub cem: CemConfig,
    /// PI² with covariance adaptation.
    pub pi2: Pi2Config,
    /// Reward-weighted regression.
    pub rwr: RwrConfig,
    /// REINFORCE with a baseline.
    pub reinforce: ReinforceConfig,
    /// Episodic natural actor critic.
    pub enac: EnacConfig,
    /// Niching search for all optima.
    pub niching: NichingConfig,
    /// Search for all regions of high reward.
    pub regions: RegionsConfig,
    /// Mixture search as printed, Algorithm 1.
    pub algorithm1: Algorithm1Config,
    /// Tempered mixture search.
    pub tempered: TemperedConfig,
}

impl Default for SearchConfig {
    fn default() -> Self {
        SearchConfig {
            method: Method::Power,
            reward_map: RewardMap::default(),
            power: PowerConfig::default(),
            aim: AimConfig::default(),
            random: RandomConfig::default(),
            cem: CemConfig::default(),
            pi2: Pi2Config::default(),
            rwr: RwrConfig::default(),
            reinforce: ReinforceConfig::default(),
            enac: EnacConfig::default(),
            niching: NichingConfig::default(),
            regions: RegionsConfig::default(),
            algorithm1: Algorithm1Config::default(),
            tempered: TemperedConfig::default(),
        }
    }
}

impl SearchConfig {
    /// Every setting with its range, as fields of the table `search`.
    pub fn ranges(&self) -> Vec<Range> {
        [
            inside("reward_map.", self.reward_map.ranges()),
            inside("power.", self.power.ranges()),
            inside("aim.", self.aim.ranges()),
            inside("random.", self.random.ranges()),
            inside("cem.", self.cem.ranges()),
            inside("pi2.", self.pi2.ranges()),
            inside("rwr.", self.rwr.ranges()),
            inside("reinforce.", self.reinforce.ranges()),
            inside("enac.", self.enac.ranges()),
            inside("niching.", self.niching.ranges()),
            inside("regions.", self.regions.ranges()),
            inside("algorithm1.", self.algorithm1.ranges()),
            inside("tempered.", self.tempered.ranges()),
        ]
        .concat()
    }

    /// Every field within its range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        self.aim.validate()?;
        check("search.", &self.ranges())?;
        if self.method == Method::Aim {
            self.aim.validate_in_use()?;
        }
        Ok(())
    }

    /// What the search wants measured of every trial; nothing unless it learns from measures.
    pub fn targets(&self) -> &[Target] {
        if self.method == Method::Aim { &self.aim.targets } else { &[] }
    }
}
