//! Rigid-body mathematics of a serial revolute arm: no simulator, no heap in any evaluation.
//!
//! An arm with fewer than [`MAX_JOINTS`] joints uses the first `n_joints` entries of every vector;
//! the others are zero columns in J, ones on the diagonal of M and zero torques.

pub mod dynamics;
mod frames;
pub mod inverse_kinematics;
pub mod kinematics;
mod model;
pub mod start_posture;
pub mod urdf;

use nalgebra::{SMatrix, SVector};

pub use frames::BodyFrames;
pub use inverse_kinematics::IkError;
pub use kinematics::TipKinematics;
pub use model::{ArmModel, Body, JointLimits};
pub use urdf::{ArmSettings, LoadedArm, UrdfError, UrdfFault, UrdfFileError};

/// Most joints an arm may have; the size of every joint-space quantity.
pub const MAX_JOINTS: usize = 7;

/// One number per joint (rad, rad/s, rad/s² or N·m).
pub type JointVector = SVector<f64, MAX_JOINTS>;

/// A joint-space matrix, for example the mass matrix in kg·m².
pub type JointMatrix = SMatrix<f64, MAX_JOINTS, MAX_JOINTS>;

/// Geometric Jacobian: rows 0–2 linear (m), rows 3–5 angular, both in world axes.
pub type Jacobian = SMatrix<f64, 6, MAX_JOINTS>;
