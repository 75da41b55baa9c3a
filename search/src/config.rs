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
use crate::range::{ConfigError, check};

/// Which search proposes the policies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
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
#[serde(default, deny_unknown_fields)]
pub struct SearchConfig {
    pub method: Method,
    pub reward_map: RewardMap,
    pub power: PowerConfig,
    pub aim: AimConfig,
    pub random: RandomConfig,
    pub cem: CemConfig,
    pub pi2: Pi2Config,
    pub rwr: RwrConfig,
    pub reinforce: ReinforceConfig,
    pub enac: EnacConfig,
    pub niching: NichingConfig,
    pub regions: RegionsConfig,
    pub algorithm1: Algorithm1Config,
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
    /// Every field within its range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        check("search.reward_map.", &self.reward_map.ranges())?;
        check("search.power.", &self.power.ranges())?;
        self.aim.validate()?;
        check("search.random.", &self.random.ranges())?;
        check("search.cem.", &self.cem.ranges())?;
        check("search.pi2.", &self.pi2.ranges())?;
        check("search.rwr.", &self.rwr.ranges())?;
        check("search.reinforce.", &self.reinforce.ranges())?;
        check("search.enac.", &self.enac.ranges())?;
        check("search.niching.", &self.niching.ranges())?;
        check("search.regions.", &self.regions.ranges())?;
        check("search.algorithm1.", &self.algorithm1.ranges())?;
        check("search.tempered.", &self.tempered.ranges())?;
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
