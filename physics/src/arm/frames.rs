//! Where every body is: the pass all the other functions start from.

use nalgebra::{Matrix3, Vector3};

use super::model::ArmModel;
use super::{JointVector, MAX_JOINTS};

/// Rotation R_WB and origin p_WB of every body at one q.
///
/// Where several quantities are needed at the same q, the frames are evaluated once and handed to the
/// functions that end in `at`; the results are the same to the last bit.
#[derive(Debug, Clone, Copy)]
pub struct BodyFrames {
    /// Entries beyond `n_joints` are meaningless.
    pub(super) R_WB: [Matrix3<f64>; MAX_JOINTS],
    pub(super) p_WB: [Vector3<f64>; MAX_JOINTS],
}

impl BodyFrames {
    /// The frames at `q` (rad), from the base outwards:
    /// R_WB = R_WA·R_AB0·Rz(q), p_WB = p_WA + R_WA·p_AB.
    #[inline]
    pub fn new(model: &ArmModel, q: &JointVector) -> BodyFrames {
        let mut frames = BodyFrames {
            R_WB: [Matrix3::identity(); MAX_JOINTS],
            p_WB: [Vector3::zeros(); MAX_JOINTS],
        };
        let mut R_WA: Matrix3<f64> = Matrix3::identity();
        let mut p_WA: Vector3<f64> = Vector3::zeros();
        for (i, body) in model.bodies().iter().enumerate() {
            let (sin, cos) = q[i].sin_cos();
            let R_WB0: Matrix3<f64> = R_WA * body.R_AB0;
            let (x, y, z) = (R_WB0.column(0), R_WB0.column(1), R_WB0.column(2));
            p_WA += R_WA * body.p_AB;
            R_WA = Matrix3::from_columns(&[x * cos + y * sin, y * cos - x * sin, z.into()]);
            frames.R_WB[i] = R_WA;
            frames.p_WB[i] = p_WA;
        }
        frames
    }

    /// Axis of joint i in the world, a unit vector.
    #[inline]
    pub(super) fn axis(&self, i: usize) -> Vector3<f64> {
        self.R_WB[i].column(2).into()
    }

    /// Rotation and position of the tip in the world.
    #[inline]
    pub(super) fn tip(&self, model: &ArmModel) -> (Matrix3<f64>, Vector3<f64>) {
        let last = model.n_joints() - 1;
        let R_WB = &self.R_WB[last];
        (R_WB * model.R_BP, self.p_WB[last] + R_WB * model.p_BP)
    }
}
