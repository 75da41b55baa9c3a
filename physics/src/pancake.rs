//! The pancake world: the arm, a frying pan at its tip and one artificial pancake (Sec. 3.1).
//!
//! Geometry and contact numbers are our design choice; the paper gives none. Only pan and pancake
//! collide: the arm's links have no shapes.

mod bodies;
mod check;
pub mod outcome;
mod plant;

use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::arm::JointVector;
use crate::arm::urdf::Payload;
use crate::plant::Dynamics;

pub use bodies::{insert_pan, insert_pan_in_two, insert_pancake, is_touching, object_state};
pub use check::PancakeConfigError;
pub use plant::{PancakePlant, PancakeScene};

/// Start posture of the WAM (rad): the pan level, its centre at (0.78, 0, 0.72) m.
pub const WAM7_START_POSTURE: JointVector =
    JointVector::from_array_storage(nalgebra::ArrayStorage([[
        0.0,
        0.210469914,
        0.0,
        2.043443404,
        0.0,
        -0.683116991,
        0.0,
    ]]));

/// Everything that describes the pancake world except the arm.
///
/// The pan frame P is the model's tip: origin in the centre of the pan's top surface, z the pan's
/// normal. The pan's mass belongs to the arm's URDF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PancakeConfig {
    /// How the arm moves.
    pub dynamics: Dynamics,
    /// Simulated time per [`crate::plant::Plant::advance`], s.
    pub period_s: f64,
    /// Sub-steps per period.
    pub solver_iterations: usize,
    /// Natural frequency of the contact spring, Hz. Rapier's own 30 Hz lets the pancake sink
    /// 3–8 mm into the pan.
    pub contact_frequency_hz: f64,
    /// Damping ratio of the contact spring.
    pub contact_damping_ratio: f64,
    /// Radius of the pan's disc, m.
    pub pan_radius: f64,
    /// Thickness of the pan's disc, below the top surface, m. Thick on purpose: a thin disc can be
    /// passed by a fast edge.
    pub pan_thickness: f64,
    /// Length of the rim from the disc's edge along its slope, m.
    pub rim_height: f64,
    /// Outward tilt of the rim from the pan's normal, rad.
    pub rim_tilt: f64,
    /// Thickness of the rim, outwards from its inner face, m.
    pub rim_thickness: f64,
    /// Number of boxes that form the rim, at least 3.
    pub rim_segments: usize,
    /// Radius of the pancake, m.
    pub pancake_radius: f64,
    /// Thickness of the pancake, m.
    pub pancake_thickness: f64,
    /// Rounding of the pancake's edge, m, less than half its thickness.
    pub pancake_border: f64,
    /// Mass of the pancake, kg.
    pub pancake_mass: f64,
    /// Coulomb friction coefficient between pancake and pan. It decides most of the outcome.
    pub friction: f64,
    /// Rapier's restitution coefficient. A drop test then rebounds a little less, see the tests.
    pub restitution: f64,
    /// Gap between pan and pancake at the start, m. Not zero: the first contact must be found as
    /// an approach.
    pub start_gap: f64,
    /// Where the pancake starts, (x, y) in the pan's plane, m.
    pub pancake_offset: [f64; 2],
}

impl Default for PancakeConfig {
    fn default() -> Self {
        Self {
            dynamics: Dynamics::Multibody,
            period_s: 1e-3,
            solver_iterations: Dynamics::Multibody.substeps(),
            contact_frequency_hz: 240.0,
            contact_damping_ratio: 1.0,
            pan_radius: 0.13,
            pan_thickness: 0.02,
            rim_height: 0.025,
            rim_tilt: 30_f64.to_radians(),
            rim_thickness: 0.01,
            rim_segments: 12,
            pancake_radius: 0.08,
            pancake_thickness: 0.01,
            pancake_border: 0.003,
            pancake_mass: 0.026,
            friction: 0.4,
            restitution: 0.1,
            start_gap: 0.3e-3,
            pancake_offset: [0.0, 0.0],
        }
    }
}

impl PancakeConfig {
    /// The pan's disc as something an arm carries: `mass` kg, its frame at `X_TP` in the tip link.
    pub fn pan(&self, mass: f64, X_TP: &Isometry3<f64>) -> Payload {
        let (r, h) = (self.pan_radius, self.pan_thickness);
        let across = mass * (3.0 * r * r + h * h) / 12.0;
        Payload {
            X_TP: *X_TP,
            mass,
            p_cm: Vector3::new(0.0, 0.0, -h / 2.0),
            I_cm: Matrix3::from_diagonal(&Vector3::new(across, across, mass * r * r / 2.0)),
        }
    }
}
