//! Where a pan may be fixed to a link: held by its handle, as a frying pan is, or lying on it.

// Monogram notation.
#![allow(non_snake_case)]

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use physics::arm::{ArmModel, start_posture};

/// Distance from the link to the centre of a pan held by its handle, m, for a large arm and at least.
const HANDLE_M: f64 = 0.3;
const HANDLE_MIN_M: f64 = 0.16;
/// Thickness between a link and the surface of a pan that lies on it, m.
const ON_TOP_M: f64 = 0.03;
/// What a posture with a pan on top is worth beside one with a handle, which tosses better.
const ON_TOP_BONUS: f64 = 0.5;

/// Offsets below this, m, tell no direction.
const NEAR_M: f64 = 0.005;

/// One way to fix a pan.
pub struct Mounting {
    /// The pan's frame in the link.
    pub X_TP: Isometry3<f64>,
    /// Factor on the score of its postures.
    pub bonus: f64,
}

/// The pan's normal to either side across the outward axis, or along it.
pub fn mountings(model: &ArmModel) -> Vec<Mounting> {
    let outward = outward(model);
    let side = if outward.x.abs() < 0.5 { Vector3::x() } else { Vector3::z() };
    let other = outward.cross(&side);
    let handle = HANDLE_M.min(0.3 * start_posture::reach(model)).max(HANDLE_MIN_M);
    let fixed = |normal: Vector3<f64>, distance: f64, bonus: f64| {
        // Any x axis will do: the pan is turned about its normal later.
        let x = if normal.dot(&outward).abs() < 0.5 { outward } else { side };
        let axes = Matrix3::from_columns(&[x, normal.cross(&x), normal]);
        let rotation =
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        Mounting {
            X_TP: Isometry3::from_parts(Translation3::from(outward * distance), rotation),
            bonus,
        }
    };
    let mut all: Vec<Mounting> =
        [side, -side, other, -other].map(|normal| fixed(normal, handle, 1.0)).into();
    all.push(fixed(outward, ON_TOP_M, ON_TOP_BONUS));
    all
}

/// The axis of the link's frame that points away from the arm: along the last joint's axis, on the
/// side on which the link lies or, where that decides nothing, away from the joint before.
fn outward(model: &ArmModel) -> Vector3<f64> {
    let body = &model.bodies()[model.n_joints() - 1];
    let X_BT = model.tip_offset();
    let to_link = X_BT.translation.vector;
    let from_before = body.R_AB0.transpose() * body.p_AB;
    let is_beside = to_link.norm() > NEAR_M && to_link.normalize().z.abs() < 0.7;
    let direction = match is_beside {
        true => to_link,
        false => {
            let along = [to_link.z, from_before.z].into_iter().find(|z| z.abs() > NEAR_M);
            // Else as most makers have it: z points out of the flange.
            along.map_or(X_BT.rotation * Vector3::z(), |z| Vector3::z() * z.signum())
        }
    };
    let in_link = X_BT.rotation.inverse() * direction;
    let i = in_link.iamax();
    Vector3::ith(i, in_link[i].signum())
}
