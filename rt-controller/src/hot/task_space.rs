//! Task coordinates of the tip: x, y, z, pitch, roll, yaw.
//!
//! The rotational ones are the rotation vector of R_WP, with its y component (pitch, positive nose
//! down) first, so that 3-, 4- and 6-dimensional policies use a leading part of one vector.

use nalgebra::Vector6;
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
}

#[cfg(feature = "loop")]
impl TaskState {
    pub fn new(tip: &TipKinematics) -> TaskState {
        let p_WP = tip.X_WP.translation.vector;
        let rotation = tip.X_WP.rotation.scaled_axis();
        let world = Vector6::new(p_WP.x, p_WP.y, p_WP.z, rotation.x, rotation.y, rotation.z);
        TaskState { x: from_world(&world), xd: from_world(&tip.v) }
    }
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
