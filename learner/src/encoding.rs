//! Encodings of a skill: which part of Eq. (2) θ holds.
//!
//! The default is the springs of Eq. (5). The paper lists other models that are special cases of Eq. (2); each is
//! a file here, which fits a policy to demonstrations and maps θ to policies and back. What a search needs of them
//! is the same for all: any θ decodes to a policy that is admitted, and policies fitted to altered demonstrations
//! lie along smooth directions in θ.

pub mod dmp;

use nalgebra::DVector;
use search::Bounds;
use serde::{Deserialize, Serialize};
use shm_types::policy::PolicyMsg;

use crate::demonstration::Demonstration;
use crate::initial_policy::{InitialPolicyConfig, initial_policy};
use crate::parameters::{ParameterError, ParameterMap, PolicyIds, Scales};
use dmp::Dmp;

/// Which encoding a session learns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EncodingKind {
    /// Eq. (5): attractors and full stiffness matrices.
    #[default]
    Springs,
    /// Eq. (3): a goal, and forces on a spring of constant stiffness.
    Dmp,
}

impl EncodingKind {
    pub const ALL: [EncodingKind; 2] = [EncodingKind::Springs, EncodingKind::Dmp];

    /// Whether it is [`EncodingKind::Springs`], as every session stored before there was a choice.
    pub fn is_springs(&self) -> bool {
        *self == EncodingKind::Springs
    }

    /// Whether there are stiffness matrices in θ.
    pub fn has_stiffness(self) -> bool {
        self == EncodingKind::Springs
    }

    /// Whether one policy can be fitted to several demonstrations.
    pub fn fits_several(self) -> bool {
        !matches!(self, EncodingKind::Springs | EncodingKind::Dmp)
    }

    /// As the configuration writes it.
    pub fn name(self) -> &'static str {
        match self {
            EncodingKind::Springs => "springs",
            EncodingKind::Dmp => "dmp",
        }
    }
}

/// What shapes the policies of an encoding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EncodingConfig {
    pub kind: EncodingKind,
    pub policy: InitialPolicyConfig,
    pub scales: Scales,
}

/// The policy a session starts from, fitted to `demonstrations`, at least one. The message is sealed, without
/// session and rollout.
pub fn fit(config: &EncodingConfig, demonstrations: &[Demonstration]) -> PolicyMsg {
    match config.kind {
        EncodingKind::Springs | EncodingKind::Dmp => {
            initial_policy(&demonstrations[0], &config.policy)
        }
    }
}

/// The map between θ and the policies of a session.
#[derive(Clone, Debug)]
pub struct Encoding {
    config: EncodingConfig,
    map: Map,
}

#[derive(Clone, Debug)]
enum Map {
    Springs(ParameterMap),
    Dmp(Dmp),
}

impl Encoding {
    /// `base` is a policy that [`fit`] gave; it carries everything θ does not.
    pub fn new(base: &PolicyMsg, config: EncodingConfig) -> Result<Encoding, ParameterError> {
        let map = match config.kind {
            EncodingKind::Springs => Map::Springs(ParameterMap::new(base, config.scales)?),
            EncodingKind::Dmp => Map::Dmp(Dmp::new(base, config.scales)?),
        };
        Ok(Encoding { config, map })
    }

    /// The policy fitted to other demonstrations of the same duration, with the activations of the base.
    pub fn refit(&self, demonstrations: &[Demonstration]) -> PolicyMsg {
        match &self.map {
            Map::Springs(_) | Map::Dmp(_) => {
                initial_policy(&demonstrations[0], &self.config.policy)
            }
        }
    }

    /// The map of springs that have a stiffness each; `None` for an encoding without them.
    pub fn springs(&self) -> Option<&ParameterMap> {
        match &self.map {
            Map::Springs(map) => Some(map),
            Map::Dmp(_) => None,
        }
    }

    /// Length of θ.
    pub fn dim(&self) -> usize {
        match &self.map {
            Map::Springs(map) => map.dim(),
            Map::Dmp(map) => map.dim(),
        }
    }

    /// θ of `policy`, `dim()` long; inverse of [`Encoding::decode`].
    pub fn encode(&self, policy: &PolicyMsg) -> Result<DVector<f64>, ParameterError> {
        match &self.map {
            Map::Springs(map) => map.encode(policy),
            Map::Dmp(map) => map.encode(policy),
        }
    }

    /// The sealed policy of θ; one that is admitted, whatever θ is.
    ///
    /// # Panics
    /// If θ has another length than `dim()` or is not finite.
    pub fn decode(&self, theta: &DVector<f64>, ids: PolicyIds) -> PolicyMsg {
        match &self.map {
            Map::Springs(map) => map.decode(theta, ids),
            Map::Dmp(map) => map.decode(theta, ids),
        }
    }

    /// The box of θ whose attractors lie within about `reach_m` of those of `policy`, with no end in other
    /// parameters.
    pub fn near(&self, policy: &PolicyMsg, reach_m: f64) -> Bounds {
        match &self.map {
            Map::Springs(map) => map.near(policy, reach_m),
            Map::Dmp(map) => map.near(policy, reach_m),
        }
    }
}

#[cfg(test)]
mod tests;
