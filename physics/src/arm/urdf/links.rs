//! The links of a URDF as a tree of frames, as `robot_state_publisher` of ROS names and places them.
//!
//! [`super::ArmModel`] has frames of its own: fixed links are merged into bodies, whose z axes are the joint axes.

use nalgebra::{Isometry3, Unit, UnitQuaternion, Vector3};

use super::chain::Positions;
use super::document::Joint;
use super::finding::Findings;
use super::tree::{Tree, motion};
use crate::arm::JointVector;

/// All links of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkTree {
    /// The root link, whose frame is the world.
    pub root: String,
    /// The other links, each after the one that carries it.
    pub frames: Vec<LinkFrame>,
}

/// A link L in its parent link P.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkFrame {
    pub link: String,
    pub parent: String,
    /// X_PL while the joint between them is at 0, or where it is held.
    pub X_PL0: Isometry3<f64>,
    /// Index of the arm's joint that moves the link, and its axis in L; none for links that do not move in P.
    pub joint: Option<(usize, Unit<Vector3<f64>>)>,
}

impl LinkTree {
    /// Takes the moving joints from `chain` and the positions of held joints (rad or m) from `positions`.
    pub(super) fn new(
        tree: &Tree,
        chain: &[&Joint],
        positions: &Positions,
        findings: &mut Findings,
    ) -> LinkTree {
        let mut frames = Vec::new();
        for (link, joint) in &tree.order {
            let Some(joint) = joint else { continue };
            let moving = chain.iter().position(|other| other.name == joint.name);
            let mut X_PL0 = joint.X_PJ;
            if moving.is_none()
                && let Some(position) = positions.get(joint.name.as_str()).filter(|p| **p != 0.0)
            {
                X_PL0 *= motion(joint, *position, findings);
            }
            frames.push(LinkFrame {
                link: link.name.clone(),
                parent: joint.parent.clone(),
                X_PL0: Isometry3::from_parts(
                    X_PL0.translation,
                    UnitQuaternion::from_rotation_matrix(&X_PL0.rotation),
                ),
                joint: moving.zip(joint.direction().map(Unit::new_unchecked)),
            });
        }
        LinkTree { root: tree.root.name.clone(), frames }
    }
}

impl LinkFrame {
    /// X_PL = X_PL0·R(axis, qᵢ), with `q` in rad.
    pub fn pose(&self, q: &JointVector) -> Isometry3<f64> {
        match &self.joint {
            Some((i, axis)) => self.X_PL0 * UnitQuaternion::from_axis_angle(axis, q[*i]),
            None => self.X_PL0,
        }
    }
}
