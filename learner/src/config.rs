//! `[learner]` of the configuration file: every setting of a session, with defaults and ranges.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use shm_types::MAX_COMPONENTS;

use crate::action::ActionConfig;
use crate::activation::Activation;
use crate::compliance::ComplianceConfig;
use crate::demonstration::DemonstrationsAre;
use crate::encoding::{Components, EncodingConfig, EncodingKind};
use crate::exploration::{ExplorationConfig, StiffnessKind};
use crate::initial_policy::{InitialPolicyConfig, InitialStiffness};
use crate::modes::Prefer;
use crate::orientation::Orientation;
use crate::parameters::{STIFFNESS_MAX, STIFFNESS_MIN, Scales};
use crate::people::PeopleConfig;
use crate::reward::RewardConfig;
use search::SearchConfig;
pub use search::range::ConfigError;
use search::range::{ANY, Range, check, inside, range};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct LearnerConfig {
    /// Rollouts after which the session is done; may be raised when resuming.
    pub rollouts: u64,
    /// Seed of every random number of the session.
    pub seed: u64,
    /// Encoding of a policy: the numbers that are learnt. Default: "springs".
    #[serde(skip_serializing_if = "EncodingKind::is_springs")]
    pub encoding: EncodingKind,
    /// Relation of several demonstrations. Default: "starts".
    #[serde(skip_serializing_if = "DemonstrationsAre::is_starts")]
    pub demonstrations_are: DemonstrationsAre,
    /// Learnt coordinates: 3 (position), 4 (and pitch) or 6 (and roll, yaw).
    #[cfg_attr(feature = "schema", schemars(extend("enum" = [3, 4, 6])))]
    pub task_dim: usize,
    /// Representation of orientations. Default: "rotation_vector".
    #[serde(skip_serializing_if = "Orientation::is_vector")]
    pub orientation: Orientation,
    /// Number of components of a policy, or "bic" to choose it by the Bayesian information criterion.
    pub n_components: Components,
    /// Stiffness κᴾ of the initial policy, per unit of mass.
    pub kappa_p: f64,
    /// Source of the initial policy's stiffness. Default: "kappa_p".
    #[serde(skip_serializing_if = "InitialStiffness::is_kappa_p")]
    pub initial_stiffness: InitialStiffness,
    /// Stiffness from variability lies within κᴾ divided and multiplied by this. Default: 4.
    #[serde(skip_serializing_if = "is_usual_range")]
    pub stiffness_range: f64,
    /// Damping ratio ζ of dampers that follow the stiffness, 2ζ Kᵢ^½; 0 for κᵛ = 2√κᴾ at any stiffness.
    pub damping_ratio: f64,
    /// Variable that drives the activations.
    pub activation: Activation,
    /// Rate α of the decay activation.
    pub decay_rate: f64,
    /// Width σ of an activation relative to the spacing of the centres.
    pub width_ratio: f64,
    /// Stiffness of coordinates that are not learnt, per unit of inertia.
    pub orientation_stiffness: f64,
    /// Damping of coordinates that are not learnt, per unit of inertia.
    pub orientation_damping: f64,
    /// Physical size of one unit of θ.
    pub scales: Scales,
    /// Start and box of the search for a task without an arm.
    pub action: ActionConfig,
    /// Directions in which the search explores, and how far.
    pub exploration: ExplorationConfig,
    /// The search, and a table of settings for each method.
    pub search: SearchConfig,
    /// The built-in rewards; `task.judge` replaces them.
    pub reward: RewardConfig,
    /// Reward for compliance.
    #[serde(default = "ComplianceConfig::off")]
    pub compliance: ComplianceConfig,
    /// Ratings by people, and when the learner asks for them.
    pub people: PeopleConfig,
    /// Mode that provides the selected policy.
    pub prefer: Prefer,
    /// Additional condition on a success, over the measures; may be changed when resuming. Default: none.
    #[serde(rename = "where", skip_serializing_if = "String::is_empty")]
    pub wish: String,
}

/// Whether it is the value from before there was a choice.
fn is_usual_range(range: &f64) -> bool {
    *range == InitialPolicyConfig::default().stiffness_range
}

impl Default for LearnerConfig {
    fn default() -> Self {
        let policy = InitialPolicyConfig::default();
        LearnerConfig {
            rollouts: 100,
            seed: 1,
            encoding: EncodingKind::default(),
            demonstrations_are: DemonstrationsAre::default(),
            task_dim: policy.task_dim,
            orientation: policy.orientation,
            n_components: policy.n_components.into(),
            kappa_p: policy.kappa_p,
            initial_stiffness: policy.initial_stiffness,
            stiffness_range: policy.stiffness_range,
            damping_ratio: policy.damping_ratio,
            activation: policy.activation,
            decay_rate: policy.decay_rate,
            width_ratio: policy.width_ratio,
            orientation_stiffness: policy.orientation_stiffness,
            orientation_damping: policy.orientation_damping,
            scales: Scales::default(),
            action: ActionConfig::default(),
            exploration: ExplorationConfig::default(),
            search: SearchConfig::default(),
            reward: RewardConfig::default(),
            compliance: ComplianceConfig::default(),
            people: PeopleConfig::default(),
            prefer: Prefer::default(),
            wish: String::new(),
        }
    }
}

impl LearnerConfig {
    /// Every setting with its range, as fields of the table `learner`.
    pub fn ranges(&self) -> Vec<Range> {
        let own = vec![
            range("rollouts", self.rollouts as f64, 1.0, 100_000.0, "1"),
            range("seed", self.seed as f64, 0.0, ANY.max, "1"),
            range("n_components", self.count() as f64, 1.0, MAX_COMPONENTS as f64, "1"),
            range("kappa_p", self.kappa_p, STIFFNESS_MIN, STIFFNESS_MAX, "s⁻²"),
            range("stiffness_range", self.stiffness_range, 1.0, 100.0, "1"),
            range("damping_ratio", self.damping_ratio, 0.0, 10.0, "1"),
            range("decay_rate", self.decay_rate, 0.01, 100.0, "s⁻¹"),
            range("width_ratio", self.width_ratio, 0.1, 3.0, "1"),
            range("orientation_stiffness", self.orientation_stiffness, 0.0, 1e5, "s⁻²"),
            range("orientation_damping", self.orientation_damping, 0.0, 1e3, "s⁻¹"),
        ];
        [
            own,
            inside("scales.", self.scales.ranges()),
            inside("action.", self.action.ranges()),
            inside("exploration.", self.exploration.ranges()),
            inside("reward.", self.reward.ranges()),
            inside("compliance.", self.compliance.ranges()),
            inside("people.", self.people.ranges()),
            inside("search.", self.search.ranges()),
        ]
        .concat()
    }

    /// Checks that every field is within its range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        if !matches!(self.task_dim, 3 | 4 | 6) {
            return Err(ConfigError::Range {
                field: "task_dim".into(),
                value: self.task_dim.to_string(),
                allowed: "3 (position), 4 (and pitch) or 6 (and roll, yaw)".into(),
            });
        }
        self.action.validate()?;
        self.search.validate()?;
        check("", &self.ranges())?;
        self.check_encoding()?;
        self.check_variability()?;
        self.check_is_told_anew()
    }

    /// The same settings for another encoding: features it lacks are off.
    pub fn encoded(self, encoding: EncodingKind) -> LearnerConfig {
        let mut config = LearnerConfig { encoding, ..self };
        if !encoding.is_springs() {
            config.compliance = ComplianceConfig::off();
        }
        if !encoding.has_stiffness() {
            config.exploration.stiffness = StiffnessKind::Fixed;
        }
        if encoding == EncodingKind::Dmp {
            config.activation = Activation::Decay;
        }
        config
    }

    /// Checks that no setting needs a feature the encoding lacks.
    fn check_encoding(&self) -> Result<(), ConfigError> {
        let (encoding, stiffness) = (self.encoding, self.exploration.stiffness);
        let from_variability = !self.initial_stiffness.is_kappa_p();
        let asked = [
            (
                "compliance.weight",
                !encoding.is_springs() && self.compliance.pays(),
                self.compliance.weight.to_string(),
                "0",
            ),
            (
                "exploration.stiffness",
                !encoding.has_stiffness() && stiffness != StiffnessKind::Fixed,
                format!("{stiffness:?}").to_lowercase(),
                "fixed",
            ),
            (
                "damping_ratio",
                !encoding.has_activation() && self.damping_ratio != 0.0,
                self.damping_ratio.to_string(),
                "0",
            ),
            (
                "activation",
                !encoding.has_activation() && self.activation != Activation::Time,
                "decay".into(),
                "time",
            ),
            (
                "initial_stiffness",
                !encoding.is_springs() && from_variability,
                "variability".into(),
                "kappa_p",
            ),
            (
                "demonstrations_are",
                !encoding.fits_several()
                    && !from_variability
                    && !self.demonstrations_are.is_starts(),
                "repetitions".into(),
                if encoding.is_springs() {
                    "starts, or initial_stiffness = \"variability\","
                } else {
                    "starts"
                },
            ),
            (
                "orientation",
                !encoding.has_activation() && !self.orientation.is_vector(),
                "sphere".into(),
                "rotation_vector",
            ),
            (
                "n_components",
                encoding.has_activation() && self.n_components.number().is_none(),
                self.n_components.to_string(),
                "a number",
            ),
        ];
        match asked.into_iter().find(|(_, is_missing, ..)| *is_missing) {
            None => Ok(()),
            Some((field, _, value, allowed)) => Err(ConfigError::Range {
                field: field.into(),
                value,
                allowed: format!("{allowed} with learner.encoding = \"{}\"", encoding.name()),
            }),
        }
    }

    /// Checks that stiffness from variability has repetitions, and bounds that θ and the controller allow.
    fn check_variability(&self) -> Result<(), ConfigError> {
        if self.initial_stiffness.is_kappa_p() {
            return Ok(());
        }
        if self.demonstrations_are.is_starts() {
            return Err(ConfigError::Range {
                field: "initial_stiffness".into(),
                value: "variability".into(),
                allowed: "kappa_p, or demonstrations_are = \"repetitions\" of one movement, three or more".into(),
            });
        }
        let (softest, stiffest) = (self.kappa_p / STIFFNESS_MIN, STIFFNESS_MAX / self.kappa_p);
        let most = softest.min(stiffest);
        if self.stiffness_range > most {
            return Err(ConfigError::Range {
                field: "stiffness_range".into(),
                value: self.stiffness_range.to_string(),
                allowed: format!(
                    "1 to {most:.1} with learner.kappa_p = {}, as stiffness lies within {STIFFNESS_MIN} and \
                     {STIFFNESS_MAX} s⁻²",
                    self.kappa_p
                ),
            });
        }
        Ok(())
    }

    /// Checks that the search can relearn its trials if a setting needs this.
    fn check_is_told_anew(&self) -> Result<(), ConfigError> {
        let weight = self.people.weight;
        let asks = [
            ("where", !self.wish.is_empty(), self.wish.clone(), "nothing"),
            ("people.weight", self.people.takes_ratings(), weight.to_string(), "0"),
        ];
        match asks.into_iter().find(|(_, asks, ..)| *asks) {
            Some((field, _, value, nothing)) if !self.search.method.learns_from_any_trial() => {
                let allowed = format!(
                    "{nothing}, because this search learns only from its own proposals; or use \
                     power or aim as learner.search.method"
                );
                Err(ConfigError::Range { field: field.into(), value, allowed })
            }
            _ => Ok(()),
        }
    }

    /// The part that shapes the initial policy.
    pub fn initial_policy(&self) -> InitialPolicyConfig {
        InitialPolicyConfig {
            task_dim: self.task_dim,
            n_components: self.count(),
            kappa_p: self.kappa_p,
            initial_stiffness: self.initial_stiffness,
            stiffness_range: self.stiffness_range,
            orientation: self.orientation,
            damping_ratio: self.damping_ratio,
            activation: self.activation,
            decay_rate: self.decay_rate,
            width_ratio: self.width_ratio,
            orientation_stiffness: self.orientation_stiffness,
            orientation_damping: self.orientation_damping,
        }
    }

    /// The number of components, or the largest there may be.
    fn count(&self) -> usize {
        self.n_components.number().unwrap_or(MAX_COMPONENTS)
    }

    /// The part that shapes policies.
    pub fn encoding(&self) -> EncodingConfig {
        EncodingConfig {
            kind: self.encoding,
            policy: self.initial_policy(),
            components: self.n_components,
            scales: self.scales,
        }
    }

    /// Checks that a session started with `stored` may continue with `self`: everything is equal except the
    /// number of rollouts, the preferred mode, and when the learner waits for or asks people, on which no
    /// proposal depends, and the condition, which is stored with the trial from which it applies.
    pub fn check_resumes(&self, stored: &LearnerConfig) -> Result<(), ConfigError> {
        let LearnerConfig { rollouts, prefer, wish, .. } = stored.clone();
        let PeopleConfig { wait, ask_after, .. } = stored.people;
        let people = PeopleConfig { wait, ask_after, ..self.people };
        let found = LearnerConfig { rollouts, prefer, wish, people, ..self.clone() };
        match first_difference("", &to_json(&found), &to_json(stored)) {
            Some((field, found, stored)) => Err(ConfigError::Changed { field, found, stored }),
            None => Ok(()),
        }
    }
}

fn to_json(config: &LearnerConfig) -> Value {
    serde_json::to_value(config).expect("a configuration is plain data")
}

/// Name and both values of the first field, in alphabetical order, that differs; what is left out is null.
fn first_difference(
    prefix: &str,
    found: &Value,
    stored: &Value,
) -> Option<(String, String, String)> {
    let said =
        |value: &Value| if value.is_null() { "its default".into() } else { value.to_string() };
    match (found.as_object(), stored.as_object()) {
        (Some(found), Some(stored)) => {
            let keys: BTreeSet<&String> = found.keys().chain(stored.keys()).collect();
            keys.into_iter().find_map(|key| {
                let field = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
                let value = |of: &Map<String, Value>| of.get(key).cloned().unwrap_or_default();
                first_difference(&field, &value(found), &value(stored))
            })
        }
        _ if found == stored => None,
        _ => Some((prefix.into(), said(found), said(stored))),
    }
}

#[cfg(test)]
mod tests;
