//! `[learner]` of the configuration file: every setting of a session, with defaults and ranges.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use shm_types::MAX_COMPONENTS;

use crate::action::ActionConfig;
use crate::activation::Activation;
use crate::compliance::ComplianceConfig;
use crate::demonstration::DemonstrationsAre;
use crate::encoding::{EncodingConfig, EncodingKind};
use crate::exploration::{ExplorationConfig, StiffnessKind};
use crate::initial_policy::InitialPolicyConfig;
use crate::modes::Prefer;
use crate::parameters::{STIFFNESS_MAX, STIFFNESS_MIN, Scales};
use crate::people::PeopleConfig;
use crate::reward::RewardConfig;
use search::SearchConfig;
pub use search::range::ConfigError;
use search::range::{check, range};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LearnerConfig {
    /// Rollouts after which the session is done; may be raised when it is resumed.
    pub rollouts: u64,
    pub seed: u64,
    /// What θ holds of a policy.
    #[serde(skip_serializing_if = "EncodingKind::is_springs")]
    pub encoding: EncodingKind,
    /// What several demonstrations are to each other.
    #[serde(skip_serializing_if = "DemonstrationsAre::is_starts")]
    pub demonstrations_are: DemonstrationsAre,
    /// Learnt coordinates: 3 (position), 4 (and pitch) or 6 (and roll, yaw).
    pub task_dim: usize,
    pub n_components: usize,
    /// κᴾ of the initial policy, s⁻².
    pub kappa_p: f64,
    /// ζ of dampers that follow the stiffness, 2ζ Kᵢ^½; 0 for κᵛ = 2√κᴾ whatever the stiffness.
    pub damping_ratio: f64,
    pub activation: Activation,
    /// α of the decay activation, s⁻¹.
    pub decay_rate: f64,
    /// σ of an activation relative to the spacing of the centres.
    pub width_ratio: f64,
    /// Gains of the coordinates that are not learnt, s⁻² and s⁻¹.
    pub orientation_stiffness: f64,
    pub orientation_damping: f64,
    pub scales: Scales,
    pub action: ActionConfig,
    pub exploration: ExplorationConfig,
    pub search: SearchConfig,
    pub reward: RewardConfig,
    #[serde(default = "ComplianceConfig::off")]
    pub compliance: ComplianceConfig,
    pub people: PeopleConfig,
    /// Which mode the session's answer is.
    pub prefer: Prefer,
    /// What a success must be like beside succeeding, over the measures; may be changed when it is resumed.
    #[serde(rename = "where", skip_serializing_if = "String::is_empty")]
    pub wish: String,
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
            n_components: policy.n_components,
            kappa_p: policy.kappa_p,
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
    /// Every field within its range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        if !matches!(self.task_dim, 3 | 4 | 6) {
            return Err(ConfigError::Range {
                field: "task_dim".into(),
                value: self.task_dim.to_string(),
                allowed: "3 (position), 4 (and pitch) or 6 (and roll, yaw)".into(),
            });
        }
        let ranges = [
            range("rollouts", self.rollouts as f64, 1.0, 100_000.0),
            range("n_components", self.n_components as f64, 1.0, MAX_COMPONENTS as f64),
            range("kappa_p", self.kappa_p, STIFFNESS_MIN, STIFFNESS_MAX),
            range("damping_ratio", self.damping_ratio, 0.0, 10.0),
            range("decay_rate", self.decay_rate, 0.01, 100.0),
            range("width_ratio", self.width_ratio, 0.1, 3.0),
            range("orientation_stiffness", self.orientation_stiffness, 0.0, 1e5),
            range("orientation_damping", self.orientation_damping, 0.0, 1e3),
            range("scales.position_m", self.scales.position_m, 1e-4, 1.0),
            range("scales.angle_rad", self.scales.angle_rad, 1e-4, 3.0),
            range("scales.log_stiffness", self.scales.log_stiffness, 1e-4, 3.0),
        ];
        check("", &ranges)?;
        check("exploration.", &self.exploration.ranges())?;
        check("reward.", &self.reward.ranges())?;
        check("compliance.", &self.compliance.ranges())?;
        check("people.", &self.people.ranges())?;
        self.action.validate()?;
        self.check_encoding()?;
        self.check_is_told_anew()?;
        self.search.validate()
    }

    /// The same settings for another encoding: what it does not have is off.
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

    /// That nothing is asked of the encoding which it does not have.
    fn check_encoding(&self) -> Result<(), ConfigError> {
        let (encoding, stiffness) = (self.encoding, self.exploration.stiffness);
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
                "demonstrations_are",
                !encoding.fits_several() && !self.demonstrations_are.is_starts(),
                "repetitions".into(),
                "starts",
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

    /// That the search can be told its trials anew where something asks for that.
    fn check_is_told_anew(&self) -> Result<(), ConfigError> {
        let weight = self.people.weight;
        let asks = [
            ("where", !self.wish.is_empty(), self.wish.clone(), "nothing"),
            ("people.weight", self.people.takes_ratings(), weight.to_string(), "0"),
        ];
        match asks.into_iter().find(|(_, asks, ..)| *asks) {
            Some((field, _, value, nothing)) if !self.search.method.learns_from_any_trial() => {
                let allowed = format!(
                    "{nothing} with a search that learns only from its own proposals; use power or aim as \
                     learner.search.method"
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
            n_components: self.n_components,
            kappa_p: self.kappa_p,
            damping_ratio: self.damping_ratio,
            activation: self.activation,
            decay_rate: self.decay_rate,
            width_ratio: self.width_ratio,
            orientation_stiffness: self.orientation_stiffness,
            orientation_damping: self.orientation_damping,
        }
    }

    /// The part that shapes policies.
    pub fn encoding(&self) -> EncodingConfig {
        EncodingConfig { kind: self.encoding, policy: self.initial_policy(), scales: self.scales }
    }

    /// That a session started with `stored` may go on with `self`: everything is equal except the
    /// number of rollouts, the preferred mode, and when the learner waits for people and asks them, which no
    /// proposal depends on, and the wish, which is stored with the trial from which on it holds.
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
mod tests {
    use search::Method;

    use super::*;

    #[test]
    fn defaults_are_valid_and_survive_a_round_trip() {
        let config = LearnerConfig::default();
        assert_eq!(config.validate(), Ok(()));
        let text = serde_json::to_string(&config).unwrap();
        assert_eq!(serde_json::from_str::<LearnerConfig>(&text).unwrap(), config);
        // What a session that was stored before there was a choice does not say is off.
        let old = LearnerConfig { compliance: ComplianceConfig::off(), ..config };
        assert_eq!(serde_json::from_str::<LearnerConfig>("{}").unwrap(), old);
    }

    #[test]
    fn refuses_each_bad_value_and_names_it() {
        type Break = fn(&mut LearnerConfig);
        let breaks: [(&str, Break); 23] = [
            ("learner.task_dim is 5: use 3", |c| c.task_dim = 5),
            ("learner.rollouts is 0: use 1 to 100000", |c| c.rollouts = 0),
            ("learner.n_components is 17: use 1 to 16", |c| c.n_components = 17),
            ("learner.kappa_p is NaN", |c| c.kappa_p = f64::NAN),
            ("learner.damping_ratio is -1: use 0 to 10", |c| c.damping_ratio = -1.0),
            ("learner.decay_rate is 0", |c| c.decay_rate = 0.0),
            ("learner.width_ratio is -1", |c| c.width_ratio = -1.0),
            ("learner.orientation_stiffness", |c| c.orientation_stiffness = -1.0),
            ("learner.orientation_damping", |c| c.orientation_damping = f64::INFINITY),
            ("learner.scales.position_m is 0", |c| c.scales.position_m = 0.0),
            ("learner.search.power.n_elites is 0", |c| c.search.power.n_elites = 0),
            ("learner.search.power.n_initial", |c| c.search.power.n_initial = 20_000),
            ("learner.search.power.initial_std", |c| c.search.power.initial_std = -0.5),
            ("learner.search.regions.connected is 0: use 0.05 to 1", |c| {
                c.search.regions.connected = 0.0
            }),
            ("learner.search.power.floor_decay is 1.1", |c| c.search.power.floor_decay = 1.1),
            ("learner.search.power.floor_min is 0.6: use 0 to 0.5", |c| {
                c.search.power.floor_min = 0.6
            }),
            ("learner.search.random.std", |c| c.search.random.std = f64::NAN),
            ("learner.reward.w2 is -1", |c| c.reward.w2 = -1.0),
            ("learner.reward.catch.lateral_m is 0", |c| c.reward.catch.lateral_m = 0.0),
            ("learner.exploration.tempo_s is -0.1", |c| c.exploration.tempo_s = -0.1),
            ("learner.people.weight is NaN: use 0 to 1", |c| c.people.weight = f64::NAN),
            ("learner.people.success_from is 11: use 0 to 10", |c| c.people.success_from = 11.0),
            ("learner.people.weight is 0.5: use 0 with a search", |c| {
                (c.people.weight, c.search.method) = (0.5, Method::Cem);
            }),
        ];
        for (expected, break_it) in breaks {
            let mut config = LearnerConfig::default();
            break_it(&mut config);
            let message = config.validate().expect_err(expected).to_string();
            assert!(message.contains(expected), "{message:?} lacks {expected:?}");
        }
    }

    #[test]
    fn refuses_unknown_fields_and_choices() {
        for text in [
            r#"{"rollout": 3}"#,
            r#"{"search": {"power": {"elites": 3}}}"#,
            r#"{"reward": {"w4": 1}}"#,
            r#"{"scales": {"position": 1}}"#,
            r#"{"search": {"method": "magic"}}"#,
        ] {
            assert!(serde_json::from_str::<LearnerConfig>(text).is_err(), "{text}");
        }
    }

    #[test]
    fn when_people_are_asked_may_change_and_what_they_count_for_may_not() {
        let stored = LearnerConfig::default();
        let with = |people| LearnerConfig { people, ..stored.clone() };
        let people = PeopleConfig { wait: false, ask_after: 9, ..stored.people };
        assert_eq!(with(people).check_resumes(&stored), Ok(()));
        let error = with(PeopleConfig { weight: 0.5, ..people }).check_resumes(&stored);
        assert!(error.unwrap_err().to_string().contains("learner.people.weight is 0.5"));
    }

    #[test]
    fn a_session_may_grow_but_not_change() {
        let stored = LearnerConfig::default();
        let longer = LearnerConfig { rollouts: 200, ..stored.clone() };
        assert_eq!(longer.check_resumes(&stored), Ok(()));
        let mut changed = stored.clone();
        changed.search.power.floor_std = 0.3;
        let message = changed.check_resumes(&stored).unwrap_err().to_string();
        assert!(message.contains(
            "learner.search.power.floor_std is 0.3, but the session was started with 0.5"
        ));
    }
}
