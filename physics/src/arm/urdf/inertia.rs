//! Mass, centre and tensor of a moving body: its own link and every link fixed to it. Whether there
//! is enough of it is judged for the body, not for its parts: a point mass on a sound link is sound.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use super::Payload;
use super::document::Joint;
use super::finding::{Findings, UrdfFault};
use super::tree::Placement;

/// What a body without mass or a moment is given, so that every simulator can divide by it.
const MIN_MASS: f64 = 1e-6;
const MIN_MOMENT: f64 = 1e-9;
/// Published tensors are rounded: what they miss of a possible body, as a share of the moments'
/// sum, without a word, and with a warning.
const ROUNDING: f64 = 1e-6;
const TOLERANCE: f64 = 0.05;

/// Mass (kg), centre of mass (m) and inertia about it (kg·m²) in the axes of one frame.
pub(super) struct MassProperties {
    pub mass: f64,
    pub p_cm: Vector3<f64>,
    pub I_cm: Matrix3<f64>,
}

/// Adds up the links that moving body `i` carries, in its frame, and the payload, if it is its.
pub(super) fn merge(
    i: usize,
    joint: &Joint,
    placements: &[Placement],
    payload: Option<&Payload>,
    findings: &mut Findings,
) -> MassProperties {
    let on_body = || placements.iter().filter(|placement| placement.body == Some(i));
    let mut parts: Vec<MassProperties> =
        on_body().filter_map(|placement| in_body(placement, findings)).collect();
    let weighs_nothing = |placement: &Placement| {
        placement.link.inertial.as_ref().is_none_or(|inertial| inertial.mass == 0.0)
    };
    let is_frame = !on_body().any(|placement| placement.link.has_shape);
    if parts.is_empty() && !is_frame && on_body().all(weighs_nothing) {
        let fault = UrdfFault::NoInertia {
            link: joint.child.clone(),
            reason: "moves and has a shape, but no mass",
        };
        findings.fault(line_of(joint, placements), fault);
    }
    if let Some(payload) = payload {
        parts.push(MassProperties { mass: payload.mass, p_cm: payload.p_cm, I_cm: payload.I_cm });
    }
    let merged = match parts.len() {
        1 => parts.remove(0),
        _ => sum(&parts),
    };
    for placement in on_body() {
        let Some(inertial) = &placement.link.inertial else { continue };
        // What is wrong with the main part is not made right by what hangs on it.
        if 2.0 * inertial.mass > merged.mass && is_flat(&inertial.I_C) {
            findings.fault(inertial.line, flat(&placement.link.name));
        }
    }
    judge(merged, joint, placements, findings)
}

/// One principal moment exceeds the sum of the others, by more than rounding. A rod, which has no
/// moment about itself, may be a little more than one.
fn is_flat(I_cm: &Matrix3<f64>) -> bool {
    let moments = I_cm.symmetric_eigenvalues();
    let (most, sum) = (moments.max(), moments.sum());
    moments.min() > MIN_MOMENT && 2.0 * most - sum > TOLERANCE * sum
}

fn flat(link: &str) -> UrdfFault {
    let reason = "one principal moment exceeds the sum of the other two";
    UrdfFault::ImpossibleInertia { link: link.into(), reason }
}

/// Several bodies as one.
fn sum(parts: &[MassProperties]) -> MassProperties {
    let mass: f64 = parts.iter().map(|part| part.mass).sum();
    if mass <= 0.0 {
        let I_cm = parts.iter().map(|part| part.I_cm).sum();
        return MassProperties { mass, p_cm: Vector3::zeros(), I_cm };
    }
    let p_cm = parts.iter().map(|part| part.p_cm * part.mass).sum::<Vector3<f64>>() / mass;
    let I_cm = parts
        .iter()
        .map(|part| {
            let d = part.p_cm - p_cm;
            let parallel_axis =
                Matrix3::from_diagonal_element(d.norm_squared()) - d * d.transpose();
            part.I_cm + parallel_axis * part.mass
        })
        .sum();
    MassProperties { mass, p_cm, I_cm }
}

/// The inertial of one link in the axes of its body; none if it has none, or one of zeros.
fn in_body(placement: &Placement, findings: &mut Findings) -> Option<MassProperties> {
    let link = placement.link;
    let inertial = link.inertial.as_ref()?;
    if inertial.mass == 0.0 && inertial.I_C.iter().all(|&x| x == 0.0) {
        return None;
    }
    if inertial.mass < 0.0 {
        let fault = UrdfFault::NonPositiveMass { link: link.name.clone(), mass: inertial.mass };
        findings.fault(inertial.line, fault);
        return None;
    }
    // A sign is no rounding, however heavy the body it is on.
    let moments = inertial.I_C.symmetric_eigenvalues();
    if moments.min() < -TOLERANCE * moments.max().abs().max(MIN_MOMENT) {
        let reason = "it is not positive definite";
        let fault = UrdfFault::ImpossibleInertia { link: link.name.clone(), reason };
        findings.fault(inertial.line, fault);
    }
    let X_BC = placement.X_BL * inertial.X_LC;
    let R_BC = X_BC.rotation.matrix();
    Some(MassProperties {
        mass: inertial.mass,
        p_cm: X_BC.translation.vector,
        I_cm: R_BC * inertial.I_C * R_BC.transpose(),
    })
}

/// A body has mass, its principal moments are positive and none exceeds the sum of the other two.
/// What misses that by little is lifted to it, or let pass, with a note.
fn judge(
    mut body: MassProperties,
    joint: &Joint,
    placements: &[Placement],
    findings: &mut Findings,
) -> MassProperties {
    let line = line_of(joint, placements);
    let link = || joint.child.clone();
    let moments = body.I_cm.symmetric_eigenvalues();
    let (least, most, sum) = (moments.min(), moments.max(), moments.sum());
    if body.mass == 0.0 && most > 0.0 {
        findings.fault(line, UrdfFault::NonPositiveMass { link: link(), mass: body.mass });
        return body;
    }
    let excess = 2.0 * most - sum;
    if is_flat(&body.I_cm) {
        findings.fault(line, flat(&joint.child));
        return body;
    }
    if body.mass < MIN_MASS {
        let text = format!(
            "link \"{}\" moves without a mass: {MIN_MASS:e} kg are assumed; give it an <inertial> if \
             it has one",
            link()
        );
        findings.note(line, text);
        body.mass = MIN_MASS;
    } else if least < MIN_MOMENT {
        let text = format!(
            "link \"{}\" has a principal moment of inertia of {least:.1e} kg·m²: {MIN_MOMENT:e} is \
             used",
            link()
        );
        findings.note(line, text);
    } else if excess > ROUNDING * sum {
        let text = format!(
            "the inertia of link \"{}\" is not quite that of a body: one principal moment exceeds \
             the sum of the other two by {:.2} %; used as it is",
            link(),
            100.0 * excess / sum
        );
        findings.note(line, text);
    }
    if least < MIN_MOMENT {
        let mut eigen = SymmetricEigen::new(body.I_cm);
        eigen.eigenvalues.apply(|moment| *moment = moment.max(MIN_MOMENT));
        body.I_cm = eigen.recompose();
    }
    body
}

/// Where to look for the body of a joint: its link's inertial, or the link.
fn line_of(joint: &Joint, placements: &[Placement]) -> u32 {
    let own = placements.iter().find(|placement| placement.link.name == joint.child);
    own.map_or(joint.line, |placement| {
        placement.link.inertial.as_ref().map_or(placement.link.line, |inertial| inertial.line)
    })
}
