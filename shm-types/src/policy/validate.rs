//! What a policy message must satisfy on its own, without an arm.

use thiserror::Error;

use super::{
    ACTIVATION_DECAY, ACTIVATION_STATE, ACTIVATION_TIME, ORIENTATION_SPHERE, ORIENTATION_VECTOR,
    OUTPUT_ACCELERATION, OUTPUT_VELOCITY, PolicyMsg,
};
use crate::{MAX_ACTIONS, MAX_COMPONENTS, SCHEMA};

/// Largest entry of an action, in the units of its world.
const ACTION_MAX: f64 = 1e6;
/// λ of a policy whose output is a velocity, s⁻¹: a loop of 1 kHz samples a lag of 2 ms well.
pub const FOLLOWING_MIN: f64 = 1.0;
pub const FOLLOWING_MAX: f64 = 500.0;
/// Largest entry of a target, m and rad, and of a certificate.
const TARGET_MAX: f64 = 100.0;
const CERTIFICATE_MAX: f64 = 1e6;

/// Why a policy message was refused.
#[derive(Debug, Error, PartialEq)]
pub enum PolicyMsgError {
    #[error(
        "schema {found:#x} instead of {SCHEMA:#x}: learner and controller are different builds; restart both from one"
    )]
    Schema { found: u64 },
    #[error(
        "digest does not match the parameters: the message is torn or was changed after sealing; send it again"
    )]
    Digest,
    #[error("task_dim is {0}: use 3 (position), 4 (and pitch) or 6 (and roll, yaw)")]
    TaskDim(u32),
    #[error("n_components is {0}: use 1 to {MAX_COMPONENTS}")]
    Components(u32),
    #[error(
        "n_actions is {actions} beside {components} components: use components, or 1 to \
         {MAX_ACTIONS} actions"
    )]
    Actions { actions: u32, components: u32 },
    #[error(
        "n_systems is {systems} beside {components} components and {actions} actions: use 1 to \
         {MAX_COMPONENTS} systems and nothing beside them"
    )]
    Systems { systems: u32, components: u32, actions: u32 },
    #[error(
        "activation is {0}: use {ACTIVATION_TIME} (time), {ACTIVATION_DECAY} (decay) or, of systems, \
         {ACTIVATION_STATE} (state)"
    )]
    Activation(u32),
    #[error(
        "output is {0}: use {OUTPUT_ACCELERATION} (acceleration) or, of systems, {OUTPUT_VELOCITY} \
         (velocity)"
    )]
    Output(u32),
    #[error(
        "orientation is {0}: use {ORIENTATION_VECTOR} (vector) or {ORIENTATION_SPHERE} (sphere)"
    )]
    Orientation(u32),
    #[error("{field} is {value}: it must be finite and within {min}..={max}")]
    Range { field: &'static str, value: f64, min: f64, max: f64 },
    #[error(
        "component {component}: {field} is {value}: it must be finite and within {min}..={max}"
    )]
    ComponentRange { component: usize, field: &'static str, value: f64, min: f64, max: f64 },
    #[error("system {system}: {field} is {value}: it must be finite and within -{max}..={max}")]
    SystemRange { system: usize, field: &'static str, value: f64, max: f64 },
}

impl PolicyMsg {
    /// Structure, finiteness and coarse bounds. Positive definiteness and the arm's own bounds are
    /// the controller's admission check.
    pub fn validate(&self) -> Result<(), PolicyMsgError> {
        if self.schema != SCHEMA {
            return Err(PolicyMsgError::Schema { found: self.schema });
        }
        self.validate_shape()?;
        if self.digest != self.compute_digest() {
            return Err(PolicyMsgError::Digest);
        }
        self.validate_ranges()?;
        for (i, component) in self.components().iter().enumerate() {
            component.validate(i)?;
        }
        for (i, system) in self.systems().iter().enumerate() {
            system.validate(i)?;
        }
        Ok(())
    }

    /// Counts and codes.
    fn validate_shape(&self) -> Result<(), PolicyMsgError> {
        if self.orientation > ORIENTATION_SPHERE {
            return Err(PolicyMsgError::Orientation(self.orientation));
        }
        let (systems, components, actions) = (self.n_systems, self.n_components, self.n_actions);
        if systems > 0 {
            let is_alone = components == 0 && actions == 0;
            if !is_alone || systems as usize > MAX_COMPONENTS {
                return Err(PolicyMsgError::Systems { systems, components, actions });
            }
        } else if actions > 0 {
            return self.validate_actions();
        }
        if !matches!(self.task_dim, 3 | 4 | 6) {
            return Err(PolicyMsgError::TaskDim(self.task_dim));
        }
        if systems == 0 && (components == 0 || components as usize > MAX_COMPONENTS) {
            return Err(PolicyMsgError::Components(components));
        }
        let (activation_max, output_max) = match systems {
            0 => (ACTIVATION_DECAY, OUTPUT_ACCELERATION),
            _ => (ACTIVATION_STATE, OUTPUT_VELOCITY),
        };
        if self.activation > activation_max {
            return Err(PolicyMsgError::Activation(self.activation));
        }
        if self.output > output_max {
            return Err(PolicyMsgError::Output(self.output));
        }
        Ok(())
    }

    fn validate_actions(&self) -> Result<(), PolicyMsgError> {
        if self.n_actions as usize > MAX_ACTIONS || self.n_components > 0 {
            let (actions, components) = (self.n_actions, self.n_components);
            return Err(PolicyMsgError::Actions { actions, components });
        }
        let (field, min, max) = ("action", -ACTION_MAX, ACTION_MAX);
        match self.actions().iter().find(|value| !(min..=max).contains(*value)) {
            Some(&value) => Err(PolicyMsgError::Range { field, value, min, max }),
            None => Ok(()),
        }
    }

    fn validate_ranges(&self) -> Result<(), PolicyMsgError> {
        let check = |(field, value, min, max): (&'static str, f64, f64, f64)| {
            let is_within = (min..=max).contains(&value);
            is_within.then_some(()).ok_or(PolicyMsgError::Range { field, value, min, max })
        };
        let decay_min = if self.activation == ACTIVATION_DECAY { 1e-3 } else { 0.0 };
        let follows = self.output == OUTPUT_VELOCITY;
        [
            ("duration_s", self.duration_s, 0.05, 30.0),
            ("decay_rate", self.decay_rate, decay_min, 1e3),
            ("damping", self.damping, 0.0, 1e3),
            ("damping_ratio", self.damping_ratio, 0.0, 10.0),
            ("orientation_stiffness", self.orientation_stiffness, 0.0, 1e5),
            ("orientation_damping", self.orientation_damping, 0.0, 1e3),
            ("following", self.following, if follows { FOLLOWING_MIN } else { 0.0 }, FOLLOWING_MAX),
        ]
        .into_iter()
        .try_for_each(check)?;
        let target = self.target.iter().map(|x| ("target", *x, -TARGET_MAX, TARGET_MAX));
        let certificate =
            self.certificate.iter().map(|x| ("certificate", *x, -CERTIFICATE_MAX, CERTIFICATE_MAX));
        target.chain(certificate).try_for_each(check)
    }
}
