//! The springs of Eq. (5) as text.

use serde::{Deserialize, Serialize};

use super::matrix::{Rows, packed, rows};
use super::{Drive, Orientation, PolicyJsonError};
use crate::policy::{Component, PolicyMsg};
use crate::{MAX_COMPONENTS, TASK_DIM};

/// Units as in [`PolicyMsg`].
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SpringsText {
    task_dim: u32,
    activation: Drive,
    #[serde(default, skip_serializing_if = "Orientation::is_vector")]
    orientation: Orientation,
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

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ComponentText {
    center: f64,
    width: f64,
    /// x, y, z, pitch, roll, yaw.
    attractor: [f64; TASK_DIM],
    /// Rows of Kᵢ, task_dim×task_dim.
    stiffness: Rows,
}

impl SpringsText {
    pub fn of(policy: &PolicyMsg) -> SpringsText {
        let d = policy.task_dim as usize;
        let component = |component: &Component| ComponentText {
            center: component.center,
            width: component.width,
            attractor: component.attractor,
            stiffness: rows(d, |row, column| component.stiffness_at(row, column)),
        };
        SpringsText {
            task_dim: policy.task_dim,
            activation: Drive::of(policy),
            orientation: Orientation::of(policy),
            duration_s: policy.duration_s,
            decay_rate: policy.decay_rate,
            damping: policy.damping,
            damping_ratio: policy.damping_ratio,
            orientation_stiffness: policy.orientation_stiffness,
            orientation_damping: policy.orientation_damping,
            components: policy.components().iter().map(component).collect(),
        }
    }

    /// Not sealed and not validated.
    pub fn policy(&self) -> Result<PolicyMsg, PolicyJsonError> {
        if self.components.len() > MAX_COMPONENTS {
            return Err(PolicyJsonError::Components(self.components.len()));
        }
        let mut policy = PolicyMsg {
            task_dim: self.task_dim,
            n_components: self.components.len() as u32,
            activation: self.activation.code(),
            orientation: self.orientation.code(),
            duration_s: self.duration_s,
            decay_rate: self.decay_rate,
            damping: self.damping,
            damping_ratio: self.damping_ratio,
            orientation_stiffness: self.orientation_stiffness,
            orientation_damping: self.orientation_damping,
            ..PolicyMsg::EMPTY
        };
        let d = (self.task_dim as usize).min(TASK_DIM);
        for (i, (component, text)) in policy.components.iter_mut().zip(&self.components).enumerate()
        {
            *component = Component {
                center: text.center,
                width: text.width,
                attractor: text.attractor,
                stiffness: packed(&text.stiffness, d, &format!("component {i}: stiffness"))?,
            };
        }
        Ok(policy)
    }
}
