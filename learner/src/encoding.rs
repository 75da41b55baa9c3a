//! Encodings of a skill: which part of Eq. (2) θ holds.
//!
//! The default is the springs of Eq. (5). The paper lists other models that are special cases of Eq. (2); each is
//! a file here, which fits a policy to demonstrations and maps θ to policies and back. What a search needs of them
//! is the same for all: any θ decodes to a policy that is admitted, and policies fitted to altered demonstrations
//! lie along smooth directions in θ.

pub mod components;
pub mod dmp;
pub mod gmr;
pub mod seds;
mod time;
pub mod tsm;

use imitation::gmm::GmmError;
use imitation::stable::StableError;
use nalgebra::DVector;
use search::Bounds;
use serde::{Deserialize, Serialize};
use shm_types::policy::PolicyMsg;
use thiserror::Error;

use crate::demonstration::Demonstration;
use crate::initial_policy::placed::{TooFar, placed, too_far};
use crate::initial_policy::variability::{StiffnessError, stiffen};
use crate::initial_policy::{InitialPolicyConfig, frame, initial_policy};
use crate::orientation::Orientation;
use crate::parameters::{ParameterError, ParameterMap, PolicyIds, Scales};
pub use components::Components;
use dmp::Dmp;
use gmr::Gmr;
use seds::Seds;
use tsm::Tsm;

/// Which encoding a session learns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum EncodingKind {
    /// Eq. (5): attractors and full stiffness matrices.
    #[default]
    Springs,
    /// Eq. (3): a goal, and forces on a spring of constant stiffness.
    Dmp,
    /// Gaussian mixture regression in time.
    Gmr,
    /// A stable field of the state.
    Seds,
    /// Takagi–Sugeno: local models of ẍ in x and ẋ, driven by time.
    Tsm,
}

impl EncodingKind {
    pub const ALL: [EncodingKind; 5] = [
        EncodingKind::Springs,
        EncodingKind::Dmp,
        EncodingKind::Gmr,
        EncodingKind::Seds,
        EncodingKind::Tsm,
    ];

    /// Whether it is [`EncodingKind::Springs`], as every session stored before there was a choice.
    pub fn is_springs(&self) -> bool {
        *self == EncodingKind::Springs
    }

    /// Whether there are stiffness matrices in θ.
    pub fn has_stiffness(self) -> bool {
        matches!(self, EncodingKind::Springs | EncodingKind::Tsm)
    }

    /// Whether what drives the activations is chosen by `activation`.
    pub fn has_activation(self) -> bool {
        matches!(self, EncodingKind::Springs | EncodingKind::Dmp)
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
            EncodingKind::Gmr => "gmr",
            EncodingKind::Seds => "seds",
            EncodingKind::Tsm => "tsm",
        }
    }
}

/// What shapes the policies of an encoding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EncodingConfig {
    pub kind: EncodingKind,
    /// Its number of components counts where `components` is one.
    pub policy: InitialPolicyConfig,
    pub components: Components,
    pub scales: Scales,
}

impl EncodingConfig {
    /// Whether springs are fitted to one demonstration with κᴾ, orientations as rotation vectors.
    fn is_plain(&self) -> bool {
        self.policy.orientation.is_vector() && self.policy.initial_stiffness.is_kappa_p()
    }
}

/// Why no policy can be fitted to demonstrations.
#[derive(Debug, Error, PartialEq)]
pub enum FitError {
    #[error(
        "{file} has quaternions, which may turn any way, and learner.orientation is rotation_vector: set it to \
         \"sphere\", or give pitch_rad, roll_rad and yaw_rad"
    )]
    Quaternions { file: String },
    #[error(
        "{file}: at t = {t_s:.2} s component {component} would pull to {turn:.2} rad from the orientation shown, \
         and beyond π it would pull the other way: raise learner.n_components or \
         learner.kappa_p, lower learner.exploration.rotation_amplitude, or make the demonstration slower"
    )]
    TooFar { file: String, component: usize, t_s: f64, turn: f64 },
    #[error(
        "no stiffness from the variability of {files}: {error}; repetitions are task.demonstration and \
         task.other_demonstrations, and learner.initial_stiffness = \"kappa_p\" needs none"
    )]
    Stiffness { files: String, error: StiffnessError },
    #[error(
        "{k} components in {d} coordinates and time need {needed} points: {files} has {found}, from 0 s to \
         {end_s:.2} s at {period_s} s; use at most {most} as learner.n_components, or \"bic\", or record longer"
    )]
    TooFewPoints {
        files: String,
        k: usize,
        d: usize,
        needed: usize,
        found: usize,
        end_s: f64,
        period_s: f64,
        most: usize,
    },
    #[error("no number of components for {files}: {error}; give one as learner.n_components")]
    Bic { files: String, error: GmmError },
    #[error("no regression in time of {files}: {error}; the components are learner.n_components")]
    Gmr { files: String, error: GmmError },
    #[error(
        "no stable field of {files}: {error}; the components are learner.n_components, the damping is \
         2·√learner.kappa_p, and any other learner.encoding than seds is driven by time"
    )]
    Seds { files: String, error: StableError },
}

impl From<TooFar> for FitError {
    fn from(TooFar { file, component, t_s, turn }: TooFar) -> FitError {
        FitError::TooFar { file, component: component + 1, t_s, turn }
    }
}

/// The policy a session starts from, fitted to `demonstrations`, at least one. The message is sealed, without
/// session and rollout.
pub fn fit(
    config: &EncodingConfig,
    demonstrations: &[Demonstration],
) -> Result<PolicyMsg, FitError> {
    check_shown(config, demonstrations)?;
    let files = || files(demonstrations);
    let n_components = components::number(config, demonstrations)?;
    let policy = &InitialPolicyConfig { n_components, ..config.policy };
    match config.kind {
        EncodingKind::Springs | EncodingKind::Dmp if config.is_plain() => {
            Ok(initial_policy(&demonstrations[0], policy))
        }
        EncodingKind::Springs | EncodingKind::Dmp => {
            let mut frame = frame(policy, demonstrations[0].duration_s());
            if !policy.initial_stiffness.is_kappa_p() {
                stiffen(&mut frame, demonstrations, policy, &config.scales)
                    .map_err(|error| FitError::Stiffness { files: files(), error })?;
            }
            placed_near(&frame, demonstrations)
        }
        EncodingKind::Gmr => gmr::fit(demonstrations, policy)
            .map_err(|error| FitError::Gmr { files: files(), error }),
        EncodingKind::Seds => seds::fit(demonstrations, policy)
            .map_err(|error| FitError::Seds { files: files(), error }),
        EncodingKind::Tsm => Ok(tsm::fit(demonstrations, policy)),
    }
}

/// The names of all files, as messages list them.
fn files(demonstrations: &[Demonstration]) -> String {
    let names: Vec<&str> = demonstrations.iter().map(Demonstration::file).collect();
    names.join(", ")
}

/// That rotation vectors are what was shown to a session that sees them.
fn check_shown(config: &EncodingConfig, demonstrations: &[Demonstration]) -> Result<(), FitError> {
    let is_other = |one: &&Demonstration| !one.orientation().is_vector();
    match demonstrations.iter().find(is_other) {
        Some(one) if config.policy.orientation == Orientation::Vector => {
            Err(FitError::Quaternions { file: one.file().into() })
        }
        _ => Ok(()),
    }
}

/// The springs of `frame` where they follow the demonstrations, none of them nearly half a turn away.
fn placed_near(frame: &PolicyMsg, demonstrations: &[Demonstration]) -> Result<PolicyMsg, FitError> {
    let policy = placed(frame, demonstrations);
    let is_sphere = policy.orientation == Orientation::Sphere.code();
    match is_sphere.then(|| too_far(&policy, demonstrations)).flatten() {
        Some(far) => Err(far.into()),
        None => Ok(policy),
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
    Gmr(Gmr),
    Seds(Seds),
    Tsm(Box<Tsm>),
}

impl Encoding {
    /// `base` is a policy that [`fit`] gave; it carries everything θ does not.
    pub fn new(base: &PolicyMsg, config: EncodingConfig) -> Result<Encoding, ParameterError> {
        let map = match config.kind {
            EncodingKind::Springs => Map::Springs(ParameterMap::new(base, config.scales)?),
            EncodingKind::Dmp => Map::Dmp(Dmp::new(base, config.scales)?),
            EncodingKind::Gmr => Map::Gmr(Gmr::new(base, config.scales)?),
            EncodingKind::Seds => Map::Seds(Seds::new(base, config.scales)?),
            EncodingKind::Tsm => Map::Tsm(Box::new(Tsm::new(base, config.scales)?)),
        };
        Ok(Encoding { config, map })
    }

    /// The policy fitted to other demonstrations of the same duration, with the activations of the base, and with
    /// its stiffness where that is from variability.
    pub fn refit(&self, demonstrations: &[Demonstration]) -> Result<PolicyMsg, FitError> {
        check_shown(&self.config, demonstrations)?;
        match &self.map {
            Map::Springs(_) | Map::Dmp(_) if self.config.is_plain() => {
                Ok(initial_policy(&demonstrations[0], &self.config.policy))
            }
            Map::Springs(map) => placed_near(map.base(), demonstrations),
            Map::Dmp(map) => placed_near(map.base(), demonstrations),
            Map::Gmr(map) => Ok(map.refit(demonstrations)),
            Map::Seds(map) => Ok(map.refit(demonstrations)),
            Map::Tsm(map) => Ok(map.refit(demonstrations)),
        }
    }

    /// What a refit to an altered demonstration differs from: `initial`, which was fitted to `demonstrations`, or
    /// their refit, where a field that was searched for is only regressed again.
    pub fn unaltered(
        &self,
        initial: &PolicyMsg,
        demonstrations: &[Demonstration],
    ) -> Result<PolicyMsg, FitError> {
        match &self.map {
            Map::Seds(_) => self.refit(demonstrations),
            _ => Ok(*initial),
        }
    }

    /// Whether its policies are springs for the loop, whatever θ holds of them.
    pub fn drives_springs(&self) -> bool {
        matches!(self.map, Map::Springs(_) | Map::Dmp(_))
    }

    /// Whether orientations are rotations.
    pub fn is_on_sphere(&self) -> bool {
        !self.config.policy.orientation.is_vector()
    }

    /// The springs in `policy` whose stiffness is learnt, and their map: θ begins with theirs. `None` for an
    /// encoding without stiffness.
    pub fn springs(&self, policy: &PolicyMsg) -> Option<(PolicyMsg, &ParameterMap)> {
        match &self.map {
            Map::Springs(map) => Some((*policy, map)),
            Map::Tsm(map) => Some((map.springs(policy), map.map())),
            Map::Dmp(_) | Map::Gmr(_) | Map::Seds(_) => None,
        }
    }

    /// Length of θ.
    pub fn dim(&self) -> usize {
        match &self.map {
            Map::Springs(map) => map.dim(),
            Map::Dmp(map) => map.dim(),
            Map::Gmr(map) => map.dim(),
            Map::Seds(map) => map.dim(),
            Map::Tsm(map) => map.dim(),
        }
    }

    /// θ of `policy`, `dim()` long; inverse of [`Encoding::decode`].
    pub fn encode(&self, policy: &PolicyMsg) -> Result<DVector<f64>, ParameterError> {
        match &self.map {
            Map::Springs(map) => map.encode(policy),
            Map::Dmp(map) => map.encode(policy),
            Map::Gmr(map) => map.encode(policy),
            Map::Seds(map) => map.encode(policy),
            Map::Tsm(map) => map.encode(policy),
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
            Map::Gmr(map) => map.decode(theta, ids),
            Map::Seds(map) => map.decode(theta, ids),
            Map::Tsm(map) => map.decode(theta, ids),
        }
    }

    /// The box of θ whose attractors lie within about `reach_m` of those of `policy`, with no end in other
    /// parameters.
    pub fn near(&self, policy: &PolicyMsg, reach_m: f64) -> Bounds {
        match &self.map {
            Map::Springs(map) => map.near(policy, reach_m),
            Map::Dmp(map) => map.near(policy, reach_m),
            Map::Gmr(map) => map.near(policy, reach_m),
            Map::Seds(map) => map.near(policy, reach_m),
            Map::Tsm(map) => map.near(policy, reach_m),
        }
    }
}

#[cfg(test)]
mod tests;
