//! The simple shapes of links: what a URDF says of how a link looks or what it touches with. Meshes are in
//! other files and are passed over, and so is what cannot be read: nothing but drawings depends on it.

use nalgebra::{IsometryMatrix3, Rotation3, Translation3, Vector3};
use roxmltree::Node;

use super::xml::{attribute, child, is};

/// A segment with a radius, in the frame of its link, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bar {
    pub ends: [Vector3<f64>; 2],
    pub radius: f64,
}

/// The shapes of a link to be seen, or those to be touched where only meshes are to be seen.
pub(super) fn bars(link: &Node) -> Vec<Bar> {
    let of_kind = |kind| link.children().filter(move |node| is(node, kind)).filter_map(bar);
    let seen: Vec<Bar> = of_kind("visual").collect();
    if seen.is_empty() { of_kind("collision").collect() } else { seen }
}

fn bar(shape: Node) -> Option<Bar> {
    let geometry = child(&shape, "geometry")?;
    let (half, radius) = if let Some(node) = child(&geometry, "sphere") {
        (Vector3::zeros(), number(&node, "radius")?)
    } else if let Some(node) = child(&geometry, "cylinder") {
        let (radius, length) = (number(&node, "radius")?, number(&node, "length")?);
        // Its ends are flat: round ones begin a radius earlier.
        (Vector3::z() * (0.5 * length - radius).max(0.0), radius)
    } else if let Some(node) = child(&geometry, "capsule") {
        (Vector3::z() * 0.5 * number(&node, "length")?, number(&node, "radius")?)
    } else if let Some(node) = child(&geometry, "box") {
        along_longest(triple(&node, "size")?)
    } else {
        return None;
    };
    let X_LS = pose(&shape);
    let end = |half: Vector3<f64>| X_LS.translation.vector + X_LS.rotation * half;
    let bar = Bar { ends: [end(half), end(-half)], radius };
    let is_finite = bar.ends.iter().flat_map(|end| end.iter()).all(|x| x.is_finite());
    (is_finite && radius.is_finite() && radius > 0.0).then_some(bar)
}

/// Half the axis of a box along its longest side, and a radius between those of the other two.
fn along_longest(size: Vector3<f64>) -> (Vector3<f64>, f64) {
    let longest = size.iamax();
    let radius = 0.25 * (size.sum() - size[longest]);
    let mut half = Vector3::zeros();
    half[longest] = (0.5 * size[longest] - radius).max(0.0);
    (half, radius)
}

fn pose(shape: &Node) -> IsometryMatrix3<f64> {
    let triple = |name| child(shape, "origin").and_then(|node| triple(&node, name));
    let (xyz, rpy) = (triple("xyz").unwrap_or_default(), triple("rpy").unwrap_or_default());
    let rotation = Rotation3::from_euler_angles(rpy.x, rpy.y, rpy.z);
    IsometryMatrix3::from_parts(Translation3::from(xyz), rotation)
}

fn number(node: &Node, name: &str) -> Option<f64> {
    attribute(node, name)?.parse().ok()
}

fn triple(node: &Node, name: &str) -> Option<Vector3<f64>> {
    let numbers = attribute(node, name)?.split_whitespace().map(|word| word.parse().ok());
    match numbers.collect::<Option<Vec<f64>>>()?[..] {
        [x, y, z] => Some(Vector3::new(x, y, z)),
        _ => None,
    }
}
