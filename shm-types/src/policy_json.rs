//! A policy as JSON text that people can read and edit; floats survive bit for bit.
//!
//! Three forms, told apart by what they hold: `components` (springs), `systems`, or an `action`.

mod matrix;
mod springs;
mod systems;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::policy::{
    ACTIVATION_DECAY, ACTIVATION_STATE, ACTIVATION_TIME, ORIENTATION_SPHERE, ORIENTATION_VECTOR,
    PolicyMsg, PolicyMsgError,
};
use crate::{MAX_ACTIONS, MAX_COMPONENTS};

#[derive(Debug, Error)]
pub enum PolicyJsonError {
    #[error("policy is not valid JSON of a policy: {0}")]
    Json(serde_json::Error),
    #[error("{what} must be {n} rows of {n} numbers")]
    Rows { what: String, n: usize },
    #[error("{what} must be symmetric")]
    Asymmetric { what: String },
    #[error("{what} must be {n} numbers")]
    Length { what: String, n: usize },
    #[error("policy has {0} components: use at most {MAX_COMPONENTS}")]
    Components(usize),
    #[error("policy has {0} systems: use 1 to {MAX_COMPONENTS}")]
    Systems(usize),
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
    State,
}

impl Drive {
    fn of(policy: &PolicyMsg) -> Drive {
        match policy.activation {
            ACTIVATION_DECAY => Drive::Decay,
            ACTIVATION_STATE => Drive::State,
            _ => Drive::Time,
        }
    }

    fn code(&self) -> u32 {
        match self {
            Drive::Time => ACTIVATION_TIME,
            Drive::Decay => ACTIVATION_DECAY,
            Drive::State => ACTIVATION_STATE,
        }
    }
}

/// How errors of orientation are taken.
#[derive(Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Orientation {
    #[default]
    Vector,
    Sphere,
}

impl Orientation {
    fn of(policy: &PolicyMsg) -> Orientation {
        match policy.orientation {
            ORIENTATION_SPHERE => Orientation::Sphere,
            _ => Orientation::Vector,
        }
    }

    fn code(&self) -> u32 {
        match self {
            Orientation::Vector => ORIENTATION_VECTOR,
            Orientation::Sphere => ORIENTATION_SPHERE,
        }
    }

    fn is_vector(&self) -> bool {
        *self == Orientation::Vector
    }
}

/// A policy without an arm.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ActionText {
    action: Vec<f64>,
}

/// The physical parameters of a valid policy.
pub fn to_json(policy: &PolicyMsg) -> Result<String, PolicyJsonError> {
    policy.validate()?;
    let text = if policy.n_actions > 0 {
        serde_json::to_string_pretty(&ActionText { action: policy.actions().to_vec() })
    } else if policy.n_systems > 0 {
        serde_json::to_string_pretty(&systems::SystemsText::of(policy))
    } else {
        serde_json::to_string_pretty(&springs::SpringsText::of(policy))
    };
    Ok(text?)
}

/// A validated, sealed policy that belongs to no session yet.
pub fn from_json(text: &str) -> Result<PolicyMsg, PolicyJsonError> {
    let value: serde_json::Value = serde_json::from_str(text)?;
    let policy = if value.get("action").is_some() {
        action(serde_json::from_value(value)?)?
    } else if value.get("systems").is_some() {
        serde_json::from_value::<systems::SystemsText>(value)?.policy()?
    } else {
        serde_json::from_value::<springs::SpringsText>(value)?.policy()?
    };
    let policy = policy.sealed();
    policy.validate()?;
    Ok(policy)
}

fn action(text: ActionText) -> Result<PolicyMsg, PolicyJsonError> {
    match text.action.len() {
        n if n > MAX_ACTIONS => Err(PolicyJsonError::Action(n)),
        _ => Ok(PolicyMsg::of_action(&text.action)),
    }
}

#[cfg(test)]
mod tests;
