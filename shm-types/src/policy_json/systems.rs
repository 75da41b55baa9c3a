//! The linear systems of Eq. (2) as text; what a policy has none of is left out.

use serde::{Deserialize, Serialize};

use super::matrix::{Rows, block, leading, packed, rows};
use super::{Drive, Orientation, PolicyJsonError};
use crate::policy::{LinearSystem, OUTPUT_ACCELERATION, OUTPUT_VELOCITY, PolicyMsg};
use crate::{MAX_COMPONENTS, PACKED, TASK_DIM};

/// What the systems yield.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Output {
    Acceleration,
    Velocity,
}

/// Units as in [`PolicyMsg`].
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SystemsText {
    task_dim: u32,
    activation: Drive,
    output: Output,
    #[serde(default, skip_serializing_if = "Orientation::is_vector")]
    orientation: Orientation,
    duration_s: f64,
    #[serde(default, skip_serializing_if = "is_nothing")]
    decay_rate: f64,
    orientation_stiffness: f64,
    orientation_damping: f64,
    #[serde(default, skip_serializing_if = "is_nothing")]
    following: f64,
    /// x, y, z, pitch, roll, yaw.
    target: [f64; TASK_DIM],
    /// Rows of P, task_dim×task_dim.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    certificate: Rows,
    systems: Vec<SystemText>,
}

/// Unlike a comparison with 0 it keeps −0.
fn is_nothing(value: &f64) -> bool {
    value.to_bits() == 0
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SystemText {
    log_prior: f64,
    /// One number, or task_dim when the state drives the activations; the rows of the covariance alike.
    center: Vec<f64>,
    covariance: Rows,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    of_position: Rows,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    of_velocity: Rows,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    of_drive: Vec<f64>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    offset: Vec<f64>,
}

impl SystemText {
    fn of(system: &LinearSystem, d: usize, drive_dim: usize) -> SystemText {
        let unless_nothing = |rows: Rows| match rows.iter().flatten().all(is_nothing) {
            true => Vec::new(),
            false => rows,
        };
        let vector = |values: &[f64]| match values[..d].iter().all(is_nothing) {
            true => Vec::new(),
            false => values[..d].to_vec(),
        };
        SystemText {
            log_prior: system.log_prior,
            center: system.center[..drive_dim].to_vec(),
            covariance: rows(drive_dim, |row, column| system.covariance_at(row, column)),
            of_position: unless_nothing(rows(d, |row, column| system.of_position_at(row, column))),
            of_velocity: unless_nothing(rows(d, |row, column| system.of_velocity_at(row, column))),
            of_drive: vector(&system.of_drive),
            offset: vector(&system.offset),
        }
    }

    /// `i` is its place in the policy.
    fn system(
        &self,
        i: usize,
        d: usize,
        drive_dim: usize,
    ) -> Result<LinearSystem, PolicyJsonError> {
        let what = |field: &str| format!("system {i}: {field}");
        if self.center.len() != drive_dim {
            return Err(PolicyJsonError::Length { what: what("center"), n: drive_dim });
        }
        Ok(LinearSystem {
            log_prior: self.log_prior,
            center: leading(&self.center, drive_dim, &what("center"))?,
            covariance: packed(&self.covariance, drive_dim, &what("covariance"))?,
            of_position: block(&self.of_position, d, &what("of_position"))?,
            of_velocity: block(&self.of_velocity, d, &what("of_velocity"))?,
            of_drive: leading(&self.of_drive, d, &what("of_drive"))?,
            offset: leading(&self.offset, d, &what("offset"))?,
        })
    }
}

impl SystemsText {
    pub fn of(policy: &PolicyMsg) -> SystemsText {
        let (d, drive_dim) = (policy.task_dim as usize, policy.drive_dim());
        let certificate = match policy.certificate[..d * (d + 1) / 2].iter().all(is_nothing) {
            true => Vec::new(),
            false => rows(d, |row, column| policy.certificate_at(row, column)),
        };
        let systems = policy.systems().iter();
        SystemsText {
            task_dim: policy.task_dim,
            activation: Drive::of(policy),
            output: match policy.output {
                OUTPUT_VELOCITY => Output::Velocity,
                _ => Output::Acceleration,
            },
            orientation: Orientation::of(policy),
            duration_s: policy.duration_s,
            decay_rate: policy.decay_rate,
            orientation_stiffness: policy.orientation_stiffness,
            orientation_damping: policy.orientation_damping,
            following: policy.following,
            target: policy.target,
            certificate,
            systems: systems.map(|system| SystemText::of(system, d, drive_dim)).collect(),
        }
    }

    /// Not sealed and not validated.
    pub fn policy(&self) -> Result<PolicyMsg, PolicyJsonError> {
        if !(1..=MAX_COMPONENTS).contains(&self.systems.len()) {
            return Err(PolicyJsonError::Systems(self.systems.len()));
        }
        let d = (self.task_dim as usize).min(TASK_DIM);
        let mut policy = PolicyMsg {
            task_dim: self.task_dim,
            activation: self.activation.code(),
            orientation: self.orientation.code(),
            duration_s: self.duration_s,
            decay_rate: self.decay_rate,
            orientation_stiffness: self.orientation_stiffness,
            orientation_damping: self.orientation_damping,
            n_systems: self.systems.len() as u32,
            output: match self.output {
                Output::Acceleration => OUTPUT_ACCELERATION,
                Output::Velocity => OUTPUT_VELOCITY,
            },
            following: self.following,
            target: self.target,
            certificate: match self.certificate.is_empty() {
                true => [0.0; PACKED],
                false => packed(&self.certificate, d, "certificate")?,
            },
            ..PolicyMsg::EMPTY
        };
        let drive_dim = policy.drive_dim();
        for (i, (system, text)) in policy.systems.iter_mut().zip(&self.systems).enumerate() {
            *system = text.system(i, d, drive_dim)?;
        }
        Ok(policy)
    }
}
