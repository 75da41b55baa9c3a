//! Can the arm be computed with? Something must resist every joint in every posture.

use super::document::Joint;
use super::finding::{Findings, UrdfError, UrdfFault};
use super::tree::Placement;
use crate::arm::dynamics::mass_matrix;
use crate::arm::{ArmModel, JointVector};

/// Least inertia that a joint feels while all joints beyond it are free, kg·m²: ten times what a
/// body without any is given.
const MIN_ARTICULATED: f64 = 1e-8;
/// Postures that are tried.
const POSTURES: usize = 32;

/// Does the file say of any moving link what it weighs? If not, that is one fault and not one a link.
pub(super) fn are_given(
    chain: &[&Joint],
    placements: &[Placement],
    findings: &mut Findings,
) -> bool {
    let moving = || placements.iter().filter(|placement| placement.body.is_some());
    let has_mass = |placement: &Placement| {
        placement.link.inertial.as_ref().is_some_and(|inertial| inertial.mass != 0.0)
    };
    if chain.is_empty() || moving().any(has_mass) {
        return true;
    }
    let names: Vec<_> = chain.iter().map(|joint| joint.child.as_str()).collect();
    findings.fault(chain[0].line, UrdfFault::NoDynamics { links: names.join(", ") });
    false
}

/// That the mass matrix is positive definite with some room, over the postures of the arm.
pub(super) fn resist(
    model: &ArmModel,
    chain: &[&Joint],
    findings: &mut Findings,
) -> Result<(), UrdfError> {
    for k in 0..POSTURES {
        let Some(i) = first_without_resistance(model, &posture(model, k)) else { continue };
        let fault = UrdfFault::NoInertia {
            link: chain[i].child.clone(),
            reason: "and what it carries have no inertia about its joint",
        };
        findings.fault(chain[i].line, fault);
        break;
    }
    findings.check()
}

/// The `k`-th of a sequence that fills the joints' ranges evenly (Kronecker's, with square roots).
fn posture(model: &ArmModel, k: usize) -> JointVector {
    const STEPS: [f64; 7] = [0.4142, 0.7321, 0.2361, 0.6458, 0.3166, 0.6056, 0.1231];
    let limits = model.limits();
    let mut q = JointVector::zeros();
    for i in 0..model.n_joints() {
        let share = (0.5 + (k + 1) as f64 * STEPS[i]).fract();
        q[i] = limits.q_min[i] + share * (limits.q_max[i] - limits.q_min[i]);
    }
    q
}

/// Eliminates the mass matrix from the tip: each pivot is the inertia that a joint feels while all
/// beyond it are free.
fn first_without_resistance(model: &ArmModel, q: &JointVector) -> Option<usize> {
    let mut M = mass_matrix(model, q);
    for k in (0..model.n_joints()).rev() {
        let pivot = M[(k, k)];
        if pivot.is_nan() || pivot < MIN_ARTICULATED {
            return Some(k);
        }
        for i in 0..k {
            for j in 0..k {
                M[(i, j)] -= M[(i, k)] * M[(k, j)] / pivot;
            }
        }
    }
    None
}
