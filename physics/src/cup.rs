//! Ball in a cup (Kober and Peters 2009): the arm, a cup at its tip, and a ball that hangs from the
//! cup's bottom on a string and is to be swung into it.
//!
//! The arm is Rapier's; ball and string are integrated here, in closed form, because Rapier's rope
//! joint holds a link of a multibody along one axis only. The string does not wind around the cup.
//! Sizes are our design choice: the sources print none but the string.

mod ball;
pub mod outcome;
mod plant;

use crate::arm::JointVector;
use crate::plant::Dynamics;

pub use ball::{Ball, CupMotion, Reaction};
pub use plant::{CupPlant, CupScene};

/// Start posture of the WAM with the cup (rad): that of the pancake, the cup upright in front.
pub const WAM7_CUP_POSTURE: JointVector = crate::pancake::WAM7_START_POSTURE;

/// Everything that describes the world except the arm.
///
/// The cup frame P is the model's tip: origin in the middle of the cup's inner bottom, where the
/// string is fixed, z towards the rim. The cup's mass belongs to the arm's URDF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CupConfig {
    /// How the arm moves.
    pub dynamics: Dynamics,
    /// Simulated time per [`crate::plant::Plant::advance`], s.
    pub period_s: f64,
    /// Sub-steps of ball and string per period.
    pub n_substeps: usize,
    /// From the cup's bottom to the ball's centre, m.
    pub string_length: f64,
    pub ball_radius: f64,
    /// kg. Little beside what the arm moves: what it pulls acts on a multibody one period later.
    pub ball_mass: f64,
    /// Inner radius of the cup at its bottom and at its rim, m.
    pub bottom_radius: f64,
    pub rim_radius: f64,
    /// From the bottom to the rim, m.
    pub depth: f64,
    /// Half of it lies within the cup, m.
    pub wall_thickness: f64,
    /// Share of the speed along a contact's normal that comes back.
    pub restitution: f64,
    /// Coulomb friction coefficient between ball and cup.
    pub friction: f64,
}

impl Default for CupConfig {
    fn default() -> Self {
        CupConfig {
            dynamics: Dynamics::Multibody,
            period_s: 1e-3,
            n_substeps: 4,
            string_length: 0.4,
            ball_radius: 0.015,
            ball_mass: 0.01,
            bottom_radius: 0.035,
            rim_radius: 0.055,
            depth: 0.09,
            wall_thickness: 0.004,
            restitution: 0.2,
            friction: 0.3,
        }
    }
}
