//! The part of a URDF that mechanics and drawings need: links with their inertials and simple shapes, joints. Meshes,
//! materials, transmissions, safety controllers and whatever a simulator added are passed over.

use nalgebra::{IsometryMatrix3, Matrix3, Vector3};
use roxmltree::Node;

use super::attributes::Reader;
use super::finding::{Findings, UrdfError, UrdfFault};
use super::shape::{self, Bar};
use super::xml::{Source, attribute, child, is};

/// A URDF as it was written, each element with its line.
pub(super) struct Robot {
    /// Empty where it has none.
    pub name: String,
    pub links: Vec<Link>,
    pub joints: Vec<Joint>,
}

/// A link.
pub(super) struct Link {
    pub name: String,
    pub line: u32,
    pub inertial: Option<Inertial>,
    /// It has a shape to be seen or touched: it is a body and not only a frame.
    pub has_shape: bool,
    /// Those of its shapes that are no meshes.
    pub bars: Vec<Bar>,
}

/// Mass (kg), its pose in the link and its tensor (kg·m²) in that pose's axes.
pub(super) struct Inertial {
    pub line: u32,
    pub X_LC: IsometryMatrix3<f64>,
    pub mass: f64,
    pub I_C: Matrix3<f64>,
}

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    Fixed,
    Revolute,
    Continuous,
    Prismatic,
    Floating,
    Planar,
    Spherical,
}

/// A joint.
pub(super) struct Joint {
    pub name: String,
    pub line: u32,
    pub kind: Kind,
    pub X_PJ: IsometryMatrix3<f64>,
    pub parent: String,
    pub child: String,
    /// As written; it need not have length one.
    pub axis: Vector3<f64>,
    pub limit: Limit,
    pub mimic: Option<Mimic>,
}

/// What `<limit>` says, rad, N·m and rad/s, or their linear counterparts.
#[derive(Default)]
pub(super) struct Limit {
    pub line: Option<u32>,
    pub lower: Option<f64>,
    pub upper: Option<f64>,
    pub effort: Option<f64>,
    pub velocity: Option<f64>,
}

/// position = multiplier · (position of `joint`) + offset.
pub(super) struct Mimic {
    pub joint: String,
    pub multiplier: f64,
    pub offset: f64,
}

impl Joint {
    pub fn is_moving(&self) -> bool {
        self.kind != Kind::Fixed
    }

    /// It turns about one axis, on its own.
    pub fn is_revolute(&self) -> bool {
        matches!(self.kind, Kind::Revolute | Kind::Continuous) && self.mimic.is_none()
    }

    /// The axis with length one.
    pub fn direction(&self) -> Option<Vector3<f64>> {
        self.axis.try_normalize(1e-9).filter(|axis| axis.iter().all(|x| x.is_finite()))
    }

    /// Line of its limits, or of the joint where it has none.
    pub fn limit_line(&self) -> u32 {
        self.limit.line.unwrap_or(self.line)
    }
}

/// Reads all of it before it gives up.
pub(super) fn read(text: &str, findings: &mut Findings) -> Result<Robot, UrdfError> {
    let source = Source::new(text).map_err(|(line, fault)| {
        findings.fault(line, fault);
        findings.check().expect_err("there is a fault")
    })?;
    let document = source.parse().expect("it was parsed before");
    let root = document.root_element();
    let mut reader = Reader::new(&source, findings);
    if !is(&root, "robot") {
        let fault = other_root(root.tag_name().name());
        reader.findings.fault(source.line(root), fault);
        reader.findings.check()?;
    }
    let name = root.attribute("name").unwrap_or_default().to_string();
    let mut robot = Robot { name, links: Vec::new(), joints: Vec::new() };
    for node in root.children() {
        if is(&node, "link") {
            robot.links.extend(reader.link(&node));
        } else if is(&node, "joint") {
            robot.joints.extend(reader.joint(&node));
        }
    }
    let unexpanded = reader.unexpanded;
    let is_xacro = |node: &Node| {
        let name = node.tag_name();
        name.namespace().is_some_and(|namespace| namespace.contains("xacro"))
            && ["include", "macro", "if", "unless"].contains(&name.name())
    };
    let has_only_macros = robot.links.is_empty() && root.descendants().any(|node| is_xacro(&node));
    if let Some(line) = unexpanded.or(has_only_macros.then(|| source.line(root))) {
        findings.fault(line, UrdfFault::Xacro);
    }
    findings.check()?;
    if robot.links.is_empty() {
        let fault = UrdfFault::Missing { place: "the robot".into(), what: "<link>" };
        findings.fault(source.line(root), fault);
    }
    findings.check()?;
    add_root(&mut robot, findings);
    Ok(robot)
}

fn other_root(root: &str) -> UrdfFault {
    let advice = match root {
        "sdf" | "gazebo" | "world" | "model" => "SDF is another format: look for a URDF next to it",
        "mujoco" => "MJCF is another format: look for the URDF it was made from",
        "COLLADA" => "this is a mesh: give the URDF that refers to it",
        _ => "give a URDF file",
    };
    UrdfFault::NotUrdf { root: root.into(), advice }
}

impl Reader<'_, '_> {
    fn link(&mut self, node: &Node) -> Option<Link> {
        let line = self.source.line(*node);
        let name = self.name(node, "a <link>")?;
        let inertial = child(node, "inertial").and_then(|node| self.inertial(&node, &name));
        let has_shape = child(node, "visual").or(child(node, "collision")).is_some();
        let bars = shape::bars(node);
        Some(Link { name, line, inertial, has_shape, bars })
    }

    fn inertial(&mut self, node: &Node, link: &str) -> Option<Inertial> {
        let line = self.source.line(*node);
        let X_LC = self.pose(node, &format!("the inertial origin of link \"{link}\""));
        let place = format!("the inertial of link \"{link}\"");
        let mass = match child(node, "mass") {
            Some(mass) => self.required(&mass, &place, "value"),
            None => 0.0,
        };
        let mut entries = [0.0; 6];
        if let Some(inertia) = child(node, "inertia") {
            let names = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];
            for (entry, name) in entries.iter_mut().zip(names) {
                // A product that is not there is zero; a moment that is not there is forgotten.
                *entry = match name {
                    "ixx" | "iyy" | "izz" => self.required(&inertia, &place, name),
                    _ => self.number(&inertia, &place, name).unwrap_or(0.0),
                };
            }
        }
        if !mass.is_finite() || !entries.iter().all(|x| x.is_finite()) {
            self.findings.fault(line, UrdfFault::NotFinite(place));
        }
        let [xx, xy, xz, yy, yz, zz] = entries;
        let I_C = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        Some(Inertial { line, X_LC, mass, I_C })
    }

    fn joint(&mut self, node: &Node) -> Option<Joint> {
        let line = self.source.line(*node);
        let name = self.name(node, "a <joint>")?;
        let place = format!("joint \"{name}\"");
        let kind = self.kind(node, &place);
        let mut end = |tag: &'static str| {
            let link = child(node, tag).and_then(|end| attribute(&end, "link")).map(str::to_string);
            if link.is_none() {
                let what = if tag == "parent" { "<parent link>" } else { "<child link>" };
                self.findings.fault(line, UrdfFault::Missing { place: place.clone(), what });
            }
            link
        };
        let (parent, child_link) = (end("parent"), end("child"));
        let X_PJ = self.pose(node, &format!("the origin of joint \"{name}\""));
        let axis = child(node, "axis")
            .and_then(|axis| self.triple(&axis, &place, "xyz"))
            .unwrap_or(Vector3::x());
        let limit = child(node, "limit").map_or(Limit::default(), |limit| Limit {
            line: Some(self.source.line(limit)),
            lower: self.number(&limit, &place, "lower"),
            upper: self.number(&limit, &place, "upper"),
            effort: self.number(&limit, &place, "effort"),
            velocity: self.number(&limit, &place, "velocity"),
        });
        let mimic = child(node, "mimic").and_then(|mimic| {
            Some(Mimic {
                joint: attribute(&mimic, "joint")?.to_string(),
                multiplier: self.number(&mimic, &place, "multiplier").unwrap_or(1.0),
                offset: self.number(&mimic, &place, "offset").unwrap_or(0.0),
            })
        });
        let (parent, child) = (parent?, child_link?);
        Some(Joint { name, line, kind: kind?, X_PJ, parent, child, axis, limit, mimic })
    }

    fn kind(&mut self, node: &Node, place: &str) -> Option<Kind> {
        let Some(kind) = attribute(node, "type") else {
            let fault = UrdfFault::Missing { place: place.into(), what: "type" };
            self.findings.fault(self.source.line(*node), fault);
            return None;
        };
        match kind.to_ascii_lowercase().as_str() {
            "fixed" => Some(Kind::Fixed),
            "revolute" => Some(Kind::Revolute),
            "continuous" => Some(Kind::Continuous),
            "prismatic" => Some(Kind::Prismatic),
            "floating" => Some(Kind::Floating),
            "planar" => Some(Kind::Planar),
            "spherical" | "ball" => Some(Kind::Spherical),
            _ => {
                let expected = "a type of URDF (revolute, continuous, prismatic, fixed, …)";
                self.not_a_number(node, place, "type", kind, expected);
                None
            }
        }
    }

    fn name(&mut self, node: &Node, element: &str) -> Option<String> {
        let name = attribute(node, "name").map(str::to_string);
        if name.is_none() {
            let fault = UrdfFault::Missing { place: element.into(), what: "name" };
            self.findings.fault(self.source.line(*node), fault);
        }
        name
    }
}

/// Adds the link that a part of a larger robot hangs on and does not bring along, such as "world".
fn add_root(robot: &mut Robot, findings: &mut Findings) {
    let has_link = |name: &str| robot.links.iter().any(|link| link.name == name);
    let mut roots: Vec<&Joint> =
        robot.joints.iter().filter(|joint| !has_link(&joint.parent)).collect();
    roots.dedup_by_key(|joint| &joint.parent);
    let is_carried = |link: &Link| robot.joints.iter().any(|joint| joint.child == link.name);
    if let [joint] = roots[..]
        && robot.links.iter().all(is_carried)
    {
        let text = format!("the link \"{}\" is not in the file: taken as the world", joint.parent);
        findings.note(joint.line, text);
        let (name, line) = (joint.parent.clone(), joint.line);
        let bars = Vec::new();
        robot.links.push(Link { name, line, inertial: None, has_shape: false, bars });
    }
}
