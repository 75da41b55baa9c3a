//! The policy message: physical parameters {μᵢ, Kᵢ, κᵛ, activations} of Eq. (5), or an action vector
//! for a task without arm, and the rollout that asks for them to be executed once.

#[cfg(feature = "transport")]
use iceoryx2::prelude::ZeroCopySend;
use thiserror::Error;

use crate::{Digest, MAX_ACTIONS, MAX_COMPONENTS, PACKED, SCHEMA, TASK_DIM};

/// `activation` when hᵢ is driven by the time since the start of the rollout.
pub const ACTIVATION_TIME: u32 = 0;
/// `activation` when hᵢ is driven by s = exp(−decay_rate·t), the canonical system of Eq. (3).
pub const ACTIVATION_DECAY: u32 = 1;

/// Entries of an action that are always part of the digest.
const DIGESTED_ACTIONS: usize = 8;
/// Largest entry of an action, in the units of its world.
const ACTION_MAX: f64 = 1e6;

message! {
    /// One virtual spring of Eq. (5).
    pub struct Component as "skillet/Component/1" {
        /// Centre of the activation: seconds, or s ∈ (0, 1] when driven by decay.
        pub center: f64,
        /// Standard deviation of the activation, in the unit of `center`.
        pub width: f64,
        /// μᵢ: x, y, z, pitch, roll, yaw in m and rad, world frame. Coordinates from `task_dim` on
        /// are not learnt; they are the reference of the orientation controller.
        pub attractor: [f64; TASK_DIM],
        /// Kᵢ: packed lower triangle by rows of the leading `task_dim`×`task_dim` block, s⁻².
        pub stiffness: [f64; PACKED],
    }
}

message! {
    /// A policy and the rollout it is meant for. `digest` guards the physical parameters and is
    /// echoed by the episode, so that a reward never reaches a θ it does not belong to.
    pub struct PolicyMsg as "skillet/Policy/3" {
        pub schema: u64,
        pub digest: u64,
        /// Session that asks; an episode carries it back.
        pub session: u64,
        /// Rollout number within the session, from 1.
        pub rollout: u64,
        /// Version of the policy within the session.
        pub policy_id: u64,
        /// Learnt coordinates: 3 (position), 4 (and pitch) or 6 (and roll, yaw).
        pub task_dim: u32,
        pub n_components: u32,
        /// [`ACTIVATION_TIME`] or [`ACTIVATION_DECAY`].
        pub activation: u32,
        /// Entries of `action` in use. Either there are components, or there are actions.
        pub n_actions: u32,
        /// Length of the Execute phase, s.
        pub duration_s: f64,
        /// Rate of the decay activation, s⁻¹ (0 when driven by time).
        pub decay_rate: f64,
        /// κᵛ, s⁻¹.
        pub damping: f64,
        /// ζ: where it is not 0, spring i damps with 2ζ Kᵢ^½ instead of κᵛ.
        pub damping_ratio: f64,
        /// Gains of the coordinates that are not learnt: resolved acceleration, s⁻² and s⁻¹.
        pub orientation_stiffness: f64,
        pub orientation_damping: f64,
        /// The whole policy of a task without arm (Sec. 4.2), in the units of its world.
        pub action: [f64; MAX_ACTIONS],
        pub components: [Component; MAX_COMPONENTS],
    }
}

message! {
    /// Names a policy: as rollout of a session, or, with session 0, as number `policy_id` of the
    /// cell's catalogue.
    pub struct PolicyName as "skillet/PolicyName/1" {
        pub session: u64,
        pub rollout: u64,
        pub policy_id: u64,
        /// 0 when it names none.
        pub digest: u64,
    }
}

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
    #[error("activation is {0}: use {ACTIVATION_TIME} (time) or {ACTIVATION_DECAY} (decay)")]
    Activation(u32),
    #[error("{field} is {value}: it must be finite and within {min}..={max}")]
    Range { field: &'static str, value: f64, min: f64, max: f64 },
    #[error(
        "component {component}: {field} is {value}: it must be finite and within {min}..={max}"
    )]
    ComponentRange { component: usize, field: &'static str, value: f64, min: f64, max: f64 },
}

impl PolicyName {
    pub const NONE: PolicyName = PolicyName { session: 0, rollout: 0, policy_id: 0, digest: 0 };

    pub fn is_none(&self) -> bool {
        *self == PolicyName::NONE
    }

    /// As people read it.
    pub fn describe(&self) -> String {
        match self {
            name if name.is_none() => "none".into(),
            PolicyName { session: 0, policy_id, .. } => format!("{policy_id}"),
            PolicyName { session, policy_id, .. } => {
                format!("{policy_id} of session {session:016x}")
            }
        }
    }
}

impl Component {
    pub const ZERO: Component =
        Component { center: 0.0, width: 1.0, attractor: [0.0; TASK_DIM], stiffness: [0.0; PACKED] };

    /// Entry (row, column) of the symmetric Kᵢ.
    pub fn stiffness_at(&self, row: usize, column: usize) -> f64 {
        self.stiffness[packed_index(row, column)]
    }
}

/// Index of entry (row, column) of a symmetric matrix in its packed lower triangle.
pub const fn packed_index(row: usize, column: usize) -> usize {
    let (r, c) = if row >= column { (row, column) } else { (column, row) };
    r * (r + 1) / 2 + c
}

impl PolicyMsg {
    /// An unsealed message without components.
    pub const EMPTY: PolicyMsg = PolicyMsg {
        schema: SCHEMA,
        digest: 0,
        session: 0,
        rollout: 0,
        policy_id: 0,
        task_dim: 3,
        n_components: 0,
        activation: ACTIVATION_TIME,
        n_actions: 0,
        duration_s: 1.0,
        decay_rate: 0.0,
        damping: 0.0,
        damping_ratio: 0.0,
        orientation_stiffness: 0.0,
        orientation_damping: 0.0,
        action: [0.0; MAX_ACTIONS],
        components: [Component::ZERO; MAX_COMPONENTS],
    };

    /// The unsealed policy of a task without arm. Precondition: at most [`MAX_ACTIONS`] entries.
    pub fn of_action(action: &[f64]) -> PolicyMsg {
        let mut policy = PolicyMsg { n_actions: action.len() as u32, ..PolicyMsg::EMPTY };
        policy.action[..action.len()].copy_from_slice(action);
        policy
    }

    /// The same policy under another name.
    pub fn named(&self, name: PolicyName) -> PolicyMsg {
        let PolicyName { session, rollout, policy_id, .. } = name;
        PolicyMsg { session, rollout, policy_id, ..*self }
    }

    pub fn name(&self) -> PolicyName {
        PolicyName {
            session: self.session,
            rollout: self.rollout,
            policy_id: self.policy_id,
            digest: self.digest,
        }
    }

    /// Hash of the physical parameters (not of who asks for them).
    pub fn compute_digest(&self) -> u64 {
        let mut digest = Digest::new()
            .u64(u64::from(self.task_dim))
            .u64(u64::from(self.n_components))
            .u64(u64::from(self.activation))
            .f64(self.duration_s)
            .f64(self.decay_rate)
            .f64(self.damping)
            .f64(self.orientation_stiffness)
            .f64(self.orientation_damping)
            .u64(u64::from(self.n_actions));
        // Those beyond count where they are used: digests of before there were so many stay right.
        for value in &self.action[..self.actions().len().max(DIGESTED_ACTIONS)] {
            digest = digest.f64(*value);
        }
        for component in &self.components {
            digest = digest.f64(component.center).f64(component.width);
            for value in component.attractor.iter().chain(&component.stiffness) {
                digest = digest.f64(*value);
            }
        }
        // The same for what came later still.
        if self.damping_ratio != 0.0 {
            digest = digest.f64(self.damping_ratio);
        }
        digest.finish()
    }

    /// Sets schema and digest; call last, before sending.
    pub fn sealed(mut self) -> Self {
        self.schema = SCHEMA;
        self.digest = self.compute_digest();
        self
    }

    /// The components in use. Call only on a validated message.
    pub fn components(&self) -> &[Component] {
        &self.components[..(self.n_components as usize).min(MAX_COMPONENTS)]
    }

    /// The actions in use; empty when the policy is one of springs.
    pub fn actions(&self) -> &[f64] {
        &self.action[..(self.n_actions as usize).min(MAX_ACTIONS)]
    }

    /// Structure, finiteness and coarse bounds. Positive definiteness and the arm's own bounds are
    /// the controller's admission check.
    pub fn validate(&self) -> Result<(), PolicyMsgError> {
        if self.schema != SCHEMA {
            return Err(PolicyMsgError::Schema { found: self.schema });
        }
        if self.n_actions > 0 {
            self.validate_actions()?;
        } else {
            self.validate_shape()?;
        }
        if self.digest != self.compute_digest() {
            return Err(PolicyMsgError::Digest);
        }
        let decay_min = if self.activation == ACTIVATION_DECAY { 1e-3 } else { 0.0 };
        for (field, value, min, max) in [
            ("duration_s", self.duration_s, 0.05, 30.0),
            ("decay_rate", self.decay_rate, decay_min, 1e3),
            ("damping", self.damping, 0.0, 1e3),
            ("damping_ratio", self.damping_ratio, 0.0, 10.0),
            ("orientation_stiffness", self.orientation_stiffness, 0.0, 1e5),
            ("orientation_damping", self.orientation_damping, 0.0, 1e3),
        ] {
            if !(min..=max).contains(&value) {
                return Err(PolicyMsgError::Range { field, value, min, max });
            }
        }
        for (i, component) in self.components().iter().enumerate() {
            component.validate(i)?;
        }
        Ok(())
    }

    fn validate_shape(&self) -> Result<(), PolicyMsgError> {
        if !matches!(self.task_dim, 3 | 4 | 6) {
            return Err(PolicyMsgError::TaskDim(self.task_dim));
        }
        if self.n_components == 0 || self.n_components as usize > MAX_COMPONENTS {
            return Err(PolicyMsgError::Components(self.n_components));
        }
        if self.activation > ACTIVATION_DECAY {
            return Err(PolicyMsgError::Activation(self.activation));
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
}

impl Component {
    fn validate(&self, component: usize) -> Result<(), PolicyMsgError> {
        let check = |field, value: f64, min: f64, max: f64| {
            if (min..=max).contains(&value) {
                Ok(())
            } else {
                Err(PolicyMsgError::ComponentRange { component, field, value, min, max })
            }
        };
        check("center", self.center, -30.0, 60.0)?;
        check("width", self.width, 1e-4, 30.0)?;
        for value in self.attractor {
            check("attractor", value, -100.0, 100.0)?;
        }
        for value in self.stiffness {
            check("stiffness", value, -1e6, 1e6)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
