//! How an arm looks, as far as its URDF says: every link as capsules, for drawings. Nothing computes with them.

use nalgebra::Vector3;

use super::document::{Inertial, Link};
use super::tree::{Placement, Tree};
use crate::arm::JointVector;
use crate::arm::kinematics::body_poses;
use crate::arm::model::ArmModel;

/// Radii of links without shapes, m.
const THINNEST: f64 = 0.025;
const THICKEST: f64 = 0.08;
/// Radius of what joins two frames and has neither shape nor mass, m.
const ROD: f64 = 0.012;

/// All points nearer than `radius` to the segment between its ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// Index of the moving body that carries it; none for what is fixed to the world.
    pub body: Option<usize>,
    /// In the frame of that body, or in the world, m.
    pub ends: [Vector3<f64>; 2],
    pub radius: f64,
}

/// The links of an arm as capsules, from the base outwards. What lies at the tip and beyond is left out: the task
/// knows better what the arm carries.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Appearance {
    pub capsules: Vec<Capsule>,
    /// All of them are shapes of the file; otherwise their sizes follow from joints and inertias.
    pub has_shapes: bool,
}

impl Appearance {
    /// Links with shapes are drawn by these. Others are capsules from joint to joint, as thick as the cylinder of
    /// their mass and smallest moment of inertia: I = ½ m r².
    pub(super) fn of<'a>(tree: &Tree<'a>, tip: &str, placements: &[Placement<'a>]) -> Appearance {
        let mut appearance = Appearance { capsules: Vec::new(), has_shapes: true };
        let path = tree.path(tip);
        let leads_on = |name: &str| path.iter().any(|joint| joint.child == name) && name != tip;
        let mut thickest = THICKEST;
        for placement in placements {
            let Placement { link, body, X_BL } = *placement;
            let is_root = link.name == tree.root.name;
            let below_tip = tree.path(&link.name).iter().any(|joint| joint.child == tip);
            if below_tip {
                continue;
            }
            let mut bars = link.bars.iter().map(|bar| (bar.ends, bar.radius)).collect::<Vec<_>>();
            if bars.is_empty() && (is_root || leads_on(&link.name) || link.inertial.is_some()) {
                appearance.has_shapes = false;
                let radius = radius(link).map(|radius| radius.min(thickest));
                if leads_on(&link.name) {
                    // A link is not thicker than the one that carries it.
                    thickest = radius.unwrap_or(thickest);
                }
                // What is fixed to the world carries the arm.
                let radius = match (body.is_none(), radius) {
                    (true, None) => THICKEST,
                    (_, radius) => radius.unwrap_or(ROD),
                };
                let next = tree.joints_of(link).map(|joint| joint.X_PJ.translation.vector);
                bars = between(next.collect(), link.inertial.as_ref(), radius);
            }
            appearance.capsules.extend(bars.into_iter().map(|(ends, radius)| Capsule {
                body,
                ends: ends.map(|end| X_BL.translation.vector + X_BL.rotation * end),
                radius,
            }));
        }
        appearance
    }

    /// Both ends of every capsule in the world, m, at `q` (rad).
    pub fn placed(&self, model: &ArmModel, q: &JointVector) -> Vec<[Vector3<f64>; 2]> {
        let poses = body_poses(model, q);
        let place = |capsule: &Capsule| match capsule.body {
            Some(body) => {
                capsule.ends.map(|end| (poses[body] * nalgebra::Point3::from(end)).coords)
            }
            None => capsule.ends,
        };
        self.capsules.iter().map(place).collect()
    }
}

/// The radius of the cylinder with the mass and the smallest principal moment of a link, m.
fn radius(link: &Link) -> Option<f64> {
    let inertial = link.inertial.as_ref().filter(|inertial| inertial.mass > 0.0)?;
    let smallest = inertial.I_C.symmetric_eigenvalues().min();
    let radius = (2.0 * smallest.max(0.0) / inertial.mass).sqrt();
    radius.is_finite().then(|| radius.clamp(THINNEST, THICKEST))
}

/// From the link's origin to each of the next joints; to its centre of mass where none is beside the origin.
fn between(
    next: Vec<Vector3<f64>>,
    inertial: Option<&Inertial>,
    radius: f64,
) -> Vec<([Vector3<f64>; 2], f64)> {
    let is_apart = |p: &Vector3<f64>| p.norm() > 1e-3;
    let mut ends: Vec<Vector3<f64>> = next.into_iter().filter(is_apart).collect();
    if ends.is_empty() {
        ends.extend(inertial.map(|inertial| inertial.X_LC.translation.vector));
    }
    ends.into_iter().map(|end| ([Vector3::zeros(), end], radius)).collect()
}
