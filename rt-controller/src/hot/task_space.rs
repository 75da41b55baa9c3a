//! Task coordinates of the tip: x, y, z, pitch, roll, yaw.
//!
//! The rotational ones are the rotation vector of R_WP, with its y component (pitch, positive nose
//! down) first, so that 3-, 4- and 6-dimensional policies use a leading part of one vector.

use nalgebra::{UnitQuaternion, Vector3, Vector6};
#[cfg(feature = "loop")]
use physics::arm::TipKinematics;

/// Row of a world 6-vector [linear; angular] that belongs to each task coordinate.
const WORLD_ROW: [usize; 6] = [0, 1, 2, 4, 3, 5];

/// x and ẋ of the tip.
#[derive(Clone, Copy, Debug)]
pub struct TaskState {
    /// m and rad.
    pub x: Vector6<f64>,
    /// m/s and rad/s. The angular part is ω: it equals the derivative of the rotation vector while
    /// the tip turns about one axis, as in a toss.
    pub xd: Vector6<f64>,
    /// The orientation itself, which has no jump at half a turn.
    pub R_WP: UnitQuaternion<f64>,
}

impl TaskState {
    #[cfg(feature = "loop")]
    pub fn new(tip: &TipKinematics) -> TaskState {
        let p_WP = tip.X_WP.translation.vector;
        let R_WP = tip.X_WP.rotation;
        let rotation = R_WP.scaled_axis();
        let world = Vector6::new(p_WP.x, p_WP.y, p_WP.z, rotation.x, rotation.y, rotation.z);
        TaskState { x: from_world(&world), xd: from_world(&tip.v), R_WP }
    }

    /// The state at these coordinates and velocities.
    pub fn at(x: Vector6<f64>, xd: Vector6<f64>) -> TaskState {
        TaskState { x, xd, R_WP: orientation(&x) }
    }

    /// x with the orientation `R_WR` as the origin of its rotational part: Log(R_WP R_WR⁻¹), the
    /// rotation in the world frame that leads from there to here, at most π long.
    pub fn relative_to(&self, R_WR: &UnitQuaternion<f64>) -> Vector6<f64> {
        let turn = (self.R_WP * R_WR.inverse()).scaled_axis();
        let x = &self.x;
        from_world(&Vector6::new(x[0], x[1], x[2], turn.x, turn.y, turn.z))
    }
}

/// exp of the rotational coordinates of `x`, of any length.
pub fn orientation(x: &Vector6<f64>) -> UnitQuaternion<f64> {
    let world = to_world(x);
    UnitQuaternion::from_scaled_axis(Vector3::new(world[3], world[4], world[5]))
}

/// World [linear; angular] → task coordinates.
pub fn from_world(world: &Vector6<f64>) -> Vector6<f64> {
    Vector6::from_fn(|i, _| world[WORLD_ROW[i]])
}

/// Task coordinates → world [linear; angular].
pub fn to_world(task: &Vector6<f64>) -> Vector6<f64> {
    // The exchange of rows 3 and 4 is its own inverse.
    from_world(task)
}
