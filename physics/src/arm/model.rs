//! The immutable arm: where the joints sit, what the bodies weigh, what the joints may do.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::{JointVector, MAX_JOINTS};

/// One moving body B with everything that is rigidly fixed to it, and the joint that moves it.
///
/// B's frame has its origin on the joint axis and its z axis along it. It coincides with the URDF
/// link frame when the URDF axis is (0, 0, 1); otherwise it is turned until z is the joint axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// R_AB at q = 0, A being the parent body (or the world for the first one). The pose at q is
    /// (p_AB, R_AB0·Rz(q)).
    pub R_AB0: Matrix3<f64>,
    /// Origin of B in A, m.
    pub p_AB: Vector3<f64>,
    /// Mass, kg, greater than zero.
    pub mass: f64,
    /// Centre of mass in B, m.
    pub p_BBcm: Vector3<f64>,
    /// Inertia about the centre of mass in B's axes, kg·m² (products carry the minus sign).
    pub I_BBcm: Matrix3<f64>,
}

impl Body {
    /// Pose of this body's joint frame in its parent at q = 0.
    pub fn X_AB0(&self) -> Isometry3<f64> {
        isometry(&self.R_AB0, &self.p_AB)
    }
}

/// What each joint may do. Unused joints carry zeros.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointLimits {
    /// Lower position limit, rad.
    pub q_min: JointVector,
    /// Upper position limit, rad.
    pub q_max: JointVector,
    /// Largest speed, rad/s.
    pub qd_max: JointVector,
    /// Largest torque, N·m.
    pub tau_max: JointVector,
}

/// A serial revolute arm of 1 to [`MAX_JOINTS`] joints, from the world to one tip frame.
///
/// The world frame W is the URDF's root link, z up. The tip is the task frame, for example a
/// flange or a frying pan.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmModel {
    pub(super) n_joints: usize,
    pub(super) bodies: [Body; MAX_JOINTS],
    pub(super) R_BP: Matrix3<f64>,
    pub(super) p_BP: Vector3<f64>,
    pub(super) joint_names: Vec<String>,
    pub(super) limits: JointLimits,
}

impl ArmModel {
    /// Number of moving joints, 1 to [`MAX_JOINTS`].
    pub fn n_joints(&self) -> usize {
        self.n_joints
    }

    /// URDF names of the moving joints, from the base to the tip.
    pub fn joint_names(&self) -> &[String] {
        &self.joint_names
    }

    /// Position, speed and torque limits of the joints.
    pub fn limits(&self) -> &JointLimits {
        &self.limits
    }

    /// Gravity in the world, m/s². The mount is level: URDF has no element to say otherwise.
    pub fn gravity(&self) -> Vector3<f64> {
        Vector3::new(0.0, 0.0, -9.81)
    }

    /// The moving bodies from the base to the tip, `n_joints` of them.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies[..self.n_joints]
    }

    /// The same arm with another tip frame, at `X_BP` in the last body.
    pub fn with_tip_offset(&self, X_BP: &Isometry3<f64>) -> ArmModel {
        ArmModel {
            R_BP: X_BP.rotation.to_rotation_matrix().into_inner(),
            p_BP: X_BP.translation.vector,
            ..self.clone()
        }
    }

    /// Pose X_BP of the tip in the last body.
    pub fn tip_offset(&self) -> Isometry3<f64> {
        isometry(&self.R_BP, &self.p_BP)
    }
}

/// Puts a rotation matrix and a position together.
pub(super) fn isometry(R: &Matrix3<f64>, p: &Vector3<f64>) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*R));
    Isometry3::from_parts(Translation3::from(*p), rotation)
}
