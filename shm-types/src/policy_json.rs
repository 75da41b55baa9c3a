//! A policy as JSON text that people can read and edit; floats survive bit for bit.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::policy::{
    ACTIVATION_DECAY, ACTIVATION_TIME, Component, PolicyMsg, PolicyMsgError, packed_index,
};
use crate::{MAX_ACTIONS, MAX_COMPONENTS, TASK_DIM};

#[derive(Debug, Error)]
pub enum PolicyJsonError {
    #[error("policy is not valid JSON of a policy: {0}")]
    Json(serde_json::Error),
    #[error("component {component}: stiffness must be {task_dim} rows of {task_dim} numbers")]
    Stiffness { component: usize, task_dim: u32 },
    #[error("component {component}: stiffness must be symmetric")]
    Asymmetric { component: usize },
    #[error("policy has {0} components: use at most {MAX_COMPONENTS}")]
    Components(usize),
    #[error("policy has {0} actions: use at most {MAX_ACTIONS}")]
    Action(usize),
    #[error(transparent)]
    Message(#[from] PolicyMsgError),
}

/// No `#[from]`: the text holds the cause, and a chain would repeat it.
impl From<serde_json::Error> for PolicyJsonError {
    fn from(error: serde_json::Error) -> Self {
        PolicyJsonError::Json(error)
    }
}

/// What drives the activations.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Drive {
    Time,
    Decay,
}

/// Units as in [`PolicyMsg`].
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PolicyText {
    task_dim: u32,
    activation: Drive,
    duration_s: f64,
    decay_rate: f64,
    damping: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    damping_ratio: f64,
    orientation_stiffness: f64,
    orientation_damping: f64,
    components: Vec<ComponentText>,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// A policy without springs.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ActionText {
    action: Vec<f64>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ComponentText {
    center: f64,
    width: f64,
    /// x, y, z, pitch, roll, yaw.
    attractor: [f64; TASK_DIM],
    /// Rows of Kᵢ, task_dim×task_dim.
    stiffness: Vec<Vec<f64>>,
}

/// The physical parameters of a valid policy.
pub fn to_json(policy: &PolicyMsg) -> Result<String, PolicyJsonError> {
    policy.validate()?;
    if policy.n_actions > 0 {
        let action = policy.actions().to_vec();
        return Ok(serde_json::to_string_pretty(&ActionText { action })?);
    }
    let d = policy.task_dim as usize;
    let component = |c: &Component| ComponentText {
        center: c.center,
        width: c.width,
        attractor: c.attractor,
        stiffness: (0..d).map(|row| (0..d).map(|col| c.stiffness_at(row, col)).collect()).collect(),
    };
    let decays = policy.activation == ACTIVATION_DECAY;
    let activation = if decays { Drive::Decay } else { Drive::Time };
    Ok(serde_json::to_string_pretty(&PolicyText {
        task_dim: policy.task_dim,
        activation,
        duration_s: policy.duration_s,
        decay_rate: policy.decay_rate,
        damping: policy.damping,
        damping_ratio: policy.damping_ratio,
        orientation_stiffness: policy.orientation_stiffness,
        orientation_damping: policy.orientation_damping,
        components: policy.components().iter().map(component).collect(),
    })?)
}

/// A validated, sealed policy that belongs to no session yet.
pub fn from_json(text: &str) -> Result<PolicyMsg, PolicyJsonError> {
    let value: serde_json::Value = serde_json::from_str(text)?;
    if value.get("action").is_some() {
        return action_from_json(value);
    }
    let text: PolicyText = serde_json::from_value(value)?;
    if text.components.len() > MAX_COMPONENTS {
        return Err(PolicyJsonError::Components(text.components.len()));
    }
    let mut policy = PolicyMsg {
        task_dim: text.task_dim,
        n_components: text.components.len() as u32,
        activation: match text.activation {
            Drive::Time => ACTIVATION_TIME,
            Drive::Decay => ACTIVATION_DECAY,
        },
        duration_s: text.duration_s,
        decay_rate: text.decay_rate,
        damping: text.damping,
        damping_ratio: text.damping_ratio,
        orientation_stiffness: text.orientation_stiffness,
        orientation_damping: text.orientation_damping,
        ..PolicyMsg::EMPTY
    };
    let d = text.task_dim.min(TASK_DIM as u32) as usize;
    for (index, (component, text)) in policy.components.iter_mut().zip(text.components).enumerate()
    {
        let rows = &text.stiffness;
        if rows.len() != d || rows.iter().any(|row| row.len() != d) {
            let task_dim = policy.task_dim;
            return Err(PolicyJsonError::Stiffness { component: index, task_dim });
        }
        (component.center, component.width) = (text.center, text.width);
        component.attractor = text.attractor;
        for (row, values) in rows.iter().enumerate() {
            for (col, &value) in values[..=row].iter().enumerate() {
                if value != rows[col][row] {
                    return Err(PolicyJsonError::Asymmetric { component: index });
                }
                component.stiffness[packed_index(row, col)] = value;
            }
        }
    }
    let policy = policy.sealed();
    policy.validate()?;
    Ok(policy)
}

fn action_from_json(value: serde_json::Value) -> Result<PolicyMsg, PolicyJsonError> {
    let ActionText { action } = serde_json::from_value(value)?;
    if action.len() > MAX_ACTIONS {
        return Err(PolicyJsonError::Action(action.len()));
    }
    let policy = PolicyMsg::of_action(&action).sealed();
    policy.validate()?;
    Ok(policy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_action_survives_a_round_trip_and_is_checked() {
        let policy = PolicyMsg::of_action(&[8.0, 0.1 + 0.2]).sealed();
        assert_eq!(from_json(&to_json(&policy).unwrap()).unwrap(), policy);
        let error = |text: &str| from_json(text).unwrap_err().to_string();
        let many = serde_json::json!({ "action": vec![1.0; 17] }).to_string();
        assert!(error(&many).contains("17 actions"));
        assert!(error(r#"{"action": [1], "damping": 2}"#).contains("damping"));
        assert!(error(r#"{"action": []}"#).contains("n_components"));
    }

    fn policy() -> PolicyMsg {
        let mut policy = PolicyMsg { task_dim: 4, n_components: 2, ..PolicyMsg::EMPTY };
        policy.damping = 2.0 * 200_f64.sqrt();
        for (i, component) in policy.components[..2].iter_mut().enumerate() {
            component.center = 0.1 + 0.2 * i as f64;
            component.attractor = [0.78, -0.0, 1.0 / 3.0, 0.1, 5e-324, 1e-17];
            (0..10).for_each(|k| component.stiffness[k] = (k as f64 + 0.1).sqrt() * 37.0);
        }
        policy.sealed()
    }

    #[test]
    fn survives_a_round_trip_bit_for_bit() {
        let follows = PolicyMsg { damping_ratio: 0.7, ..policy() }.sealed();
        assert_ne!(follows.digest, policy().digest);
        for policy in [policy(), follows] {
            let back = from_json(&to_json(&policy).unwrap()).unwrap();
            assert_eq!(back, policy);
            assert_eq!(back.digest, policy.digest);
        }
        assert!(
            !to_json(&policy()).unwrap().contains("damping_ratio"),
            "as it was before there was one"
        );
    }

    #[test]
    fn refuses_damaged_text() {
        let text = to_json(&policy()).unwrap();
        let error = |text: &str| from_json(text).expect_err("must be refused").to_string();
        assert!(error("{}").contains("task_dim"));
        assert!(error(&text.replace("\"task_dim\": 4", "\"task_dim\": 3")).contains("3 rows of 3"));
        assert!(error(&text.replace("\"task_dim\"", "\"dim\"")).contains("dim"));
        assert!(error(&text.replace("\"width\": 1.0", "\"width\": 0.0")).contains("width"));
        let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
        value["components"][1]["stiffness"][0][1] = 0.5.into();
        assert!(error(&value.to_string()).contains("component 1: stiffness must be symmetric"));
    }
}
