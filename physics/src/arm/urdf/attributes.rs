//! The attributes of a URDF as numbers and poses; what is no number is found, not guessed.

use nalgebra::{IsometryMatrix3, Rotation3, Translation3, Vector3};
use roxmltree::Node;

use super::finding::{Findings, UrdfFault};
use super::xml::{Source, attribute, child};

/// Reads attributes and notes what cannot be read.
pub(super) struct Reader<'s, 'f> {
    pub source: &'s Source,
    pub findings: &'f mut Findings,
    /// Line of the first value that is a formula of xacro.
    pub unexpanded: Option<u32>,
}

impl<'s, 'f> Reader<'s, 'f> {
    pub fn new(source: &'s Source, findings: &'f mut Findings) -> Self {
        Reader { source, findings, unexpanded: None }
    }

    /// The pose of the `<origin>` below `node`: fixed-axis angles, R = Rz(yaw)·Ry(pitch)·Rx(roll).
    pub fn pose(&mut self, node: &Node, place: &str) -> IsometryMatrix3<f64> {
        let Some(origin) = child(node, "origin") else { return IsometryMatrix3::identity() };
        let xyz = self.triple(&origin, place, "xyz").unwrap_or_default();
        let rpy = self.triple(&origin, place, "rpy").unwrap_or_default();
        if !xyz.iter().chain(rpy.iter()).all(|x| x.is_finite()) {
            self.findings.fault(self.source.line(origin), UrdfFault::NotFinite(place.into()));
        }
        let rotation = Rotation3::from_euler_angles(rpy.x, rpy.y, rpy.z);
        IsometryMatrix3::from_parts(Translation3::from(xyz), rotation)
    }

    pub fn triple(&mut self, node: &Node, place: &str, name: &'static str) -> Option<Vector3<f64>> {
        let value = attribute(node, name)?;
        let separators = |c: char| c.is_whitespace() || c == ',';
        let words = value.split(separators).filter(|word| !word.is_empty());
        let numbers: Option<Vec<f64>> = words.map(|word| word.parse().ok()).collect();
        match numbers.as_deref() {
            Some(&[x, y, z]) => Some(Vector3::new(x, y, z)),
            _ => {
                self.not_a_number(node, place, name, value, "three numbers");
                None
            }
        }
    }

    pub fn number(&mut self, node: &Node, place: &str, name: &'static str) -> Option<f64> {
        let value = attribute(node, name)?;
        let number = value.parse().ok();
        if number.is_none() {
            self.not_a_number(node, place, name, value, "a number");
        }
        number
    }

    pub fn required(&mut self, node: &Node, place: &str, name: &'static str) -> f64 {
        if attribute(node, name).is_none() {
            let fault = UrdfFault::Missing { place: place.into(), what: name };
            self.findings.fault(self.source.line(*node), fault);
        }
        self.number(node, place, name).unwrap_or(0.0)
    }

    pub fn not_a_number(
        &mut self,
        node: &Node,
        place: &str,
        attribute: &'static str,
        value: &str,
        expected: &'static str,
    ) {
        if value.contains("${") {
            self.unexpanded.get_or_insert(self.source.line(*node));
            return;
        }
        let (place, value) = (place.to_string(), value.to_string());
        let fault = UrdfFault::NotANumber { place, attribute, value, expected };
        self.findings.fault(self.source.line(*node), fault);
    }
}
