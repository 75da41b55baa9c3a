//! Mass, centre and tensor of a moving body: its own link and every link fixed to it.

use nalgebra::{Matrix3, Vector3};
use urdf_rs::{Joint, Link};

use super::UrdfError;
use super::tree::{self, Placement};

/// Mass (kg), centre of mass (m) and inertia about it (kg·m²) in the axes of one frame.
pub(super) struct MassProperties {
    pub mass: f64,
    pub p_cm: Vector3<f64>,
    pub I_cm: Matrix3<f64>,
}

/// Adds up the links that moving body `i` carries, in its frame.
pub(super) fn merge(
    i: usize,
    joint: &Joint,
    placements: &[Placement],
) -> Result<MassProperties, UrdfError> {
    let mut parts = Vec::new();
    for placement in placements.iter().filter(|placement| placement.body == Some(i)) {
        parts.extend(in_body(placement)?);
    }
    if let [_] = parts[..] {
        return Ok(parts.remove(0));
    }
    let mass: f64 = parts.iter().map(|part| part.mass).sum();
    // urdf-rs reads a missing <inertial> as zero mass.
    if mass == 0.0 {
        return Err(UrdfError::NoInertia(joint.child.link.clone()));
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
    Ok(MassProperties { mass, p_cm, I_cm })
}

/// The inertial of one link in the axes of its body; none if the link has no `<inertial>`.
fn in_body(placement: &Placement) -> Result<Option<MassProperties>, UrdfError> {
    let link = placement.link;
    let inertial = &link.inertial;
    let tensor = &inertial.inertia;
    let products = [tensor.ixx, tensor.ixy, tensor.ixz, tensor.iyy, tensor.iyz, tensor.izz];
    if inertial.mass.value == 0.0 && products.iter().all(|&x| x == 0.0) {
        return Ok(None);
    }
    if !inertial.mass.value.is_finite() || !products.iter().all(|x| x.is_finite()) {
        return Err(UrdfError::NotFinite(format!("the inertial of link \"{}\"", link.name)));
    }
    if inertial.mass.value <= 0.0 {
        let mass = inertial.mass.value;
        return Err(UrdfError::NonPositiveMass { link: link.name.clone(), mass });
    }
    let I_cm = Matrix3::new(
        tensor.ixx, tensor.ixy, tensor.ixz, //
        tensor.ixy, tensor.iyy, tensor.iyz, //
        tensor.ixz, tensor.iyz, tensor.izz,
    );
    check_tensor(link, &I_cm)?;

    let what = || format!("the inertial origin of link \"{}\"", link.name);
    let X_BC = placement.X_BL * tree::pose(&inertial.origin, what)?;
    let R_BC = X_BC.rotation.matrix();
    Ok(Some(MassProperties {
        mass: inertial.mass.value,
        p_cm: X_BC.translation.vector,
        I_cm: R_BC * I_cm * R_BC.transpose(),
    }))
}

/// A body's principal moments are positive and none exceeds the sum of the other two.
fn check_tensor(link: &Link, I_cm: &Matrix3<f64>) -> Result<(), UrdfError> {
    let impossible = |reason| Err(UrdfError::ImpossibleInertia { link: link.name.clone(), reason });
    let moments = I_cm.symmetric_eigenvalues();
    // Published tensors are rounded: a flat body may miss the bound in the last digits.
    let tolerance = 1e-6 * moments.sum().abs();
    if moments.min() <= 0.0 {
        return impossible("it is not positive definite");
    }
    if 2.0 * moments.max() > moments.sum() + tolerance {
        return impossible("one principal moment exceeds the sum of the other two");
    }
    Ok(())
}
