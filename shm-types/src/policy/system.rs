//! One linear system of Eq. (2), ξᵒ = Aᵢ ξᵀ + bᵢ, and the Gaussian of its activation.

#[cfg(feature = "transport")]
use iceoryx2::prelude::ZeroCopySend;

use super::{PolicyMsgError, packed_index};
use crate::{Digest, PACKED, TASK_DIM};

/// Largest log prior, entry of a centre or target, and of a covariance, in their units.
const LOG_PRIOR_MAX: f64 = 1e3;
const CENTER_MAX: f64 = 100.0;
const COVARIANCE_MAX: f64 = 1e4;
/// Largest entry of Aᵢ and bᵢ, in the units of the output.
const ENTRY_MAX: f64 = 1e6;

message! {
    /// Subsystem i of Eq. (2): hᵢ ∝ πᵢ 𝒩(ξʷ | cᵢ, Σᵢ) and
    /// Aᵢ ξᵀ + bᵢ = `of_position` x + `of_velocity` ẋ + `of_drive` ξʷ + `offset`.
    ///
    /// x and ẋ are the learnt coordinates: the first `task_dim` of x, y, z, pitch, roll, yaw. The output
    /// is in m/s² and rad/s², or in m/s and rad/s. Entries that are not in use are not read.
    pub struct LinearSystem as "skillet/LinearSystem/1" {
        /// ln πᵢ, up to a constant that all systems share.
        pub log_prior: f64,
        /// cᵢ in the unit of ξʷ: s, or 1 when driven by decay, in the first entry; m and rad when driven
        /// by the state.
        pub center: [f64; TASK_DIM],
        /// Σᵢ: packed lower triangle by rows of the leading block, `task_dim`×`task_dim` when driven by
        /// the state and 1×1 otherwise.
        pub covariance: [f64; PACKED],
        /// ∂ξᵒ/∂x: rows of six, of which the leading `task_dim`×`task_dim` block is in use.
        pub of_position: [f64; 36],
        /// ∂ξᵒ/∂ẋ, in the same order.
        pub of_velocity: [f64; 36],
        /// ∂ξᵒ/∂ξʷ for the time or s, so that regression in time, ẋ = Σ hᵢ(t) [aᵢ t + bᵢ], is exact.
        pub of_drive: [f64; TASK_DIM],
        /// bᵢ.
        pub offset: [f64; TASK_DIM],
    }
}

impl LinearSystem {
    pub const ZERO: LinearSystem = LinearSystem {
        log_prior: 0.0,
        center: [0.0; TASK_DIM],
        covariance: [0.0; PACKED],
        of_position: [0.0; 36],
        of_velocity: [0.0; 36],
        of_drive: [0.0; TASK_DIM],
        offset: [0.0; TASK_DIM],
    };

    /// Entry (row, column) of the symmetric Σᵢ.
    pub fn covariance_at(&self, row: usize, column: usize) -> f64 {
        self.covariance[packed_index(row, column)]
    }

    /// Entry (row, column) of ∂ξᵒ/∂x.
    pub fn of_position_at(&self, row: usize, column: usize) -> f64 {
        self.of_position[TASK_DIM * row + column]
    }

    /// Entry (row, column) of ∂ξᵒ/∂ẋ.
    pub fn of_velocity_at(&self, row: usize, column: usize) -> f64 {
        self.of_velocity[TASK_DIM * row + column]
    }

    /// Adds what is in use, of `d` learnt coordinates and of a ξʷ of `drive_dim`.
    pub(super) fn digest(&self, digest: Digest, d: usize, drive_dim: usize) -> Digest {
        let mut digest = digest.f64(self.log_prior);
        let covariance = &self.covariance[..drive_dim * (drive_dim + 1) / 2];
        for value in self.center[..drive_dim].iter().chain(covariance) {
            digest = digest.f64(*value);
        }
        for row in 0..d {
            for column in 0..d {
                digest = digest.f64(self.of_position_at(row, column));
                digest = digest.f64(self.of_velocity_at(row, column));
            }
            digest = digest.f64(self.of_drive[row]).f64(self.offset[row]);
        }
        digest
    }

    /// Ranges of all entries; `system` is its place in the policy.
    pub(super) fn validate(&self, system: usize) -> Result<(), PolicyMsgError> {
        let check = |field, values: &[f64], max: f64| match values
            .iter()
            .find(|value| !(-max..=max).contains(*value))
        {
            Some(&value) => Err(PolicyMsgError::SystemRange { system, field, value, max }),
            None => Ok(()),
        };
        check("log_prior", &[self.log_prior], LOG_PRIOR_MAX)?;
        check("center", &self.center, CENTER_MAX)?;
        check("covariance", &self.covariance, COVARIANCE_MAX)?;
        check("of_position", &self.of_position, ENTRY_MAX)?;
        check("of_velocity", &self.of_velocity, ENTRY_MAX)?;
        check("of_drive", &self.of_drive, ENTRY_MAX)?;
        check("offset", &self.offset, ENTRY_MAX)
    }
}
