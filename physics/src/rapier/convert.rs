//! The one place where nalgebra (our mathematics) meets glam (Rapier's).

use nalgebra::{Isometry3, Matrix3, UnitQuaternion, Vector3};
use rapier3d::math::{Matrix, Pose, Rotation, Vector};

pub fn to_glam_vector(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

pub fn to_glam_rotation(R: &UnitQuaternion<f64>) -> Rotation {
    Rotation::from_xyzw(R.i, R.j, R.k, R.w)
}

pub fn to_glam_pose(X: &Isometry3<f64>) -> Pose {
    Pose::from_parts(to_glam_vector(&X.translation.vector), to_glam_rotation(&X.rotation))
}

pub fn to_glam_matrix(m: &Matrix3<f64>) -> Matrix {
    Matrix::from_cols_array_2d(&m.data.0)
}

pub fn from_glam_vector(v: Vector) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

pub fn from_glam_rotation(R: Rotation) -> UnitQuaternion<f64> {
    let quaternion = nalgebra::Quaternion::new(R.w, R.x, R.y, R.z);
    // Already unit up to rounding; the same bits must come back every time.
    UnitQuaternion::new_unchecked(quaternion)
}
