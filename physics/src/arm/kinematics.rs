//! Where the tip is and how it moves: pose, Jacobian, velocity, and the acceleration J̇q̇.

use nalgebra::{Isometry3, Vector3, Vector6};

use super::frames::BodyFrames;
use super::model::{ArmModel, isometry};
use super::{Jacobian, JointVector, MAX_JOINTS};

/// Pose X_WP of the tip at `q` (rad).
pub fn tip_pose(model: &ArmModel, q: &JointVector) -> Isometry3<f64> {
    let (R_WP, p_WP) = BodyFrames::new(model, q).tip(model);
    isometry(&R_WP, &p_WP)
}

/// Poses X_WB of all bodies at `q` (rad), from the base; unused entries are the identity.
///
/// A body frame sits on its joint with z along the joint axis, see [`super::Body`].
pub fn body_poses(model: &ArmModel, q: &JointVector) -> [Isometry3<f64>; MAX_JOINTS] {
    let frames = BodyFrames::new(model, q);
    let mut poses = [Isometry3::identity(); MAX_JOINTS];
    for (i, pose) in poses.iter_mut().enumerate().take(model.n_joints()) {
        *pose = isometry(&frames.R_WB[i], &frames.p_WB[i]);
    }
    poses
}

/// Motion of the tip in the world, evaluated in one pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipKinematics {
    /// Pose of the tip.
    pub X_WP: Isometry3<f64>,
    /// Jacobian of the tip origin: v = J·q̇. Rows 0–2 linear, 3–5 angular, world axes.
    pub J: Jacobian,
    /// Velocity [m/s; rad/s], world axes.
    pub v: Vector6<f64>,
    /// J̇·q̇: the classical acceleration [m/s²; rad/s²] the tip has at q̈ = 0, world axes.
    pub Jdot_qd: Vector6<f64>,
}

impl TipKinematics {
    /// Evaluates the tip's motion at `q` (rad) and `qd` (rad/s).
    ///
    /// With z_i the axis and p_i the origin of joint i, column i of J is
    /// [z_i × (p_WP − p_i); z_i]. J̇q̇ follows from the forward recursion at q̈ = 0:
    /// α_i = α_{i−1} + ω_{i−1} × z_i q̇_i,
    /// a_{i+1} = a_i + α_i × r + ω_i × (ω_i × r), r leading to the next joint or the tip.
    pub fn new(model: &ArmModel, q: &JointVector, qd: &JointVector) -> TipKinematics {
        TipKinematics::at(model, &BodyFrames::new(model, q), qd)
    }

    /// [`TipKinematics::new`] where the bodies are at `frames`.
    pub fn at(model: &ArmModel, frames: &BodyFrames, qd: &JointVector) -> TipKinematics {
        let (R_WP, p_WP) = frames.tip(model);
        let n = model.n_joints();

        let mut J = Jacobian::zeros();
        let mut v = Vector3::zeros();
        let mut omega = Vector3::zeros();
        let mut a = Vector3::zeros();
        let mut alpha = Vector3::zeros();
        for i in 0..n {
            let z = frames.axis(i);
            let lever = z.cross(&(p_WP - frames.p_WB[i]));
            J.fixed_view_mut::<3, 1>(0, i).copy_from(&lever);
            J.fixed_view_mut::<3, 1>(3, i).copy_from(&z);

            v += lever * qd[i];
            alpha += omega.cross(&z) * qd[i];
            omega += z * qd[i];
            let next = if i + 1 < n { frames.p_WB[i + 1] } else { p_WP };
            let r = next - frames.p_WB[i];
            a += alpha.cross(&r) + omega.cross(&omega.cross(&r));
        }
        TipKinematics {
            X_WP: isometry(&R_WP, &p_WP),
            J,
            v: Vector6::new(v.x, v.y, v.z, omega.x, omega.y, omega.z),
            Jdot_qd: Vector6::new(a.x, a.y, a.z, alpha.x, alpha.y, alpha.z),
        }
    }
}
