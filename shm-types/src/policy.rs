//! The policy message: the springs {μᵢ, Kᵢ, κᵛ, activations} of Eq. (5), the linear systems of Eq. (2)
//! whole, or an action vector for a task without arm, and the rollout that asks for them to be executed
//! once.

mod component;
mod system;
mod validate;

#[cfg(feature = "transport")]
use iceoryx2::prelude::ZeroCopySend;

pub use component::Component;
pub use system::LinearSystem;
pub use validate::{FOLLOWING_MAX, FOLLOWING_MIN, PolicyMsgError};

use crate::{Digest, MAX_ACTIONS, MAX_COMPONENTS, PACKED, SCHEMA, TASK_DIM};

/// `activation` when hᵢ is driven by the time since the start of the rollout.
pub const ACTIVATION_TIME: u32 = 0;
/// `activation` when hᵢ is driven by s = exp(−decay_rate·t), the canonical system of Eq. (3).
pub const ACTIVATION_DECAY: u32 = 1;
/// `activation` when hᵢ is driven by the learnt coordinates x; of systems only.
pub const ACTIVATION_STATE: u32 = 2;

/// `output` when ξᵒ = ẍ, as of springs.
pub const OUTPUT_ACCELERATION: u32 = 0;
/// `output` when ξᵒ = ẋ, which the loop follows by ẍ = λ(ξᵒ − ẋ); of systems only.
pub const OUTPUT_VELOCITY: u32 = 1;

/// `orientation` when a rotation vector is taken for three more coordinates: errors are differences.
pub const ORIENTATION_VECTOR: u32 = 0;
/// `orientation` when errors are rotations, the shortest way in the world frame: a full turn is followed.
pub const ORIENTATION_SPHERE: u32 = 1;

/// Entries of an action that are always part of the digest.
const DIGESTED_ACTIONS: usize = 8;

message! {
    /// A policy and the rollout it is meant for. `digest` guards the physical parameters and is
    /// echoed by the episode, so that a reward never reaches a θ it does not belong to.
    pub struct PolicyMsg as "skillet/Policy/4" {
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
        /// [`ACTIVATION_TIME`], [`ACTIVATION_DECAY`] or, of systems, [`ACTIVATION_STATE`].
        pub activation: u32,
        /// Entries of `action` in use. A policy has components, or actions, or systems.
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
        /// Entries of `systems` in use.
        pub n_systems: u32,
        /// [`OUTPUT_ACCELERATION`] or, of systems, [`OUTPUT_VELOCITY`].
        pub output: u32,
        /// [`ORIENTATION_VECTOR`] or [`ORIENTATION_SPHERE`].
        pub orientation: u32,
        pub reserved: u32,
        /// λ, s⁻¹: how fast the loop follows an `output` of velocity.
        pub following: f64,
        /// x*, m and rad: where a field of the state comes to rest. Coordinates from `task_dim` on are
        /// the reference of the orientation controller, as of the attractors of springs.
        pub target: [f64; TASK_DIM],
        /// P of V = (x − x*)ᵀ P (x − x*), which falls along a field of the state: packed lower triangle
        /// by rows of the leading `task_dim`×`task_dim` block.
        pub certificate: [f64; PACKED],
        pub systems: [LinearSystem; MAX_COMPONENTS],
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
        n_systems: 0,
        output: OUTPUT_ACCELERATION,
        orientation: ORIENTATION_VECTOR,
        reserved: 0,
        following: 0.0,
        target: [0.0; TASK_DIM],
        certificate: [0.0; PACKED],
        systems: [LinearSystem::ZERO; MAX_COMPONENTS],
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

    /// Hash of the physical parameters (not of the session that asks for them).
    pub fn compute_digest(&self) -> u64 {
        match self.n_systems {
            0 => self.digest_springs().finish(),
            _ => self.digest_systems().finish(),
        }
    }

    /// Digest of springs or an action.
    fn digest_springs(&self) -> Digest {
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
        let is_sphere = self.orientation != ORIENTATION_VECTOR;
        if self.damping_ratio != 0.0 || is_sphere {
            digest = digest.f64(self.damping_ratio);
        }
        if is_sphere {
            digest = digest.u64(u64::from(self.orientation));
        }
        digest
    }

    /// Digest of systems: everything in use, and nothing else.
    fn digest_systems(&self) -> Digest {
        let d = self.learnt();
        let mut digest = Digest::new()
            .bytes(b"systems")
            .u64(u64::from(self.task_dim))
            .u64(u64::from(self.n_systems))
            .u64(u64::from(self.activation))
            .u64(u64::from(self.output))
            .u64(u64::from(self.orientation))
            .u64(u64::from(self.n_components))
            .u64(u64::from(self.n_actions));
        let certificate = &self.certificate[..d * (d + 1) / 2];
        for value in [
            self.duration_s,
            self.decay_rate,
            self.orientation_stiffness,
            self.orientation_damping,
            self.following,
        ]
        .iter()
        .chain(&self.target)
        .chain(certificate)
        {
            digest = digest.f64(*value);
        }
        self.systems()
            .iter()
            .fold(digest, |digest, system| system.digest(digest, d, self.drive_dim()))
    }

    /// Sets schema and digest; call last, before sending.
    pub fn sealed(mut self) -> Self {
        self.schema = SCHEMA;
        self.digest = self.compute_digest();
        self
    }

    /// The components in use; empty when the policy is not one of springs.
    pub fn components(&self) -> &[Component] {
        &self.components[..(self.n_components as usize).min(MAX_COMPONENTS)]
    }

    /// The actions in use; empty when the policy drives an arm.
    pub fn actions(&self) -> &[f64] {
        &self.action[..(self.n_actions as usize).min(MAX_ACTIONS)]
    }

    /// The systems in use; empty when the policy is one of springs or an action.
    pub fn systems(&self) -> &[LinearSystem] {
        &self.systems[..(self.n_systems as usize).min(MAX_COMPONENTS)]
    }

    /// Entry (row, column) of the symmetric P.
    pub fn certificate_at(&self, row: usize, column: usize) -> f64 {
        self.certificate[packed_index(row, column)]
    }

    /// Dimension of ξʷ, which drives the activations of systems: the learnt coordinates, or 1.
    pub fn drive_dim(&self) -> usize {
        if self.activation == ACTIVATION_STATE { self.learnt() } else { 1 }
    }

    /// `task_dim`, of a message that is not validated too.
    fn learnt(&self) -> usize {
        (self.task_dim as usize).min(TASK_DIM)
    }
}

#[cfg(test)]
mod tests;
