//! The tree of links: which joints move the tip, which are held where, and on which moving body
//! each link sits.

use std::collections::{HashMap, HashSet};

use nalgebra::{IsometryMatrix3, Rotation3, Translation3, Unit, Vector3};

use super::document::{Joint, Kind, Link, Robot};
use super::finding::{Findings, UrdfError, UrdfFault};

/// A URDF whose links are known to form one tree.
pub(super) struct Tree<'a> {
    pub robot: &'a Robot,
    pub root: &'a Link,
    links: HashMap<&'a str, &'a Link>,
    /// The joint that carries each link, by the link's name; all but the root have one.
    joint_into: HashMap<&'a str, &'a Joint>,
    /// Every link after the one that carries it.
    pub order: Vec<(&'a Link, Option<&'a Joint>)>,
}

/// Where a link is.
pub(super) struct Placement<'a> {
    pub link: &'a Link,
    /// Index of the moving body that carries the link; none for links fixed to the world.
    pub body: Option<usize>,
    /// Pose of the link in that body, or in the world. A rotation matrix, not a quaternion: that
    /// would cost some accuracy at every fixed joint.
    pub X_BL: IsometryMatrix3<f64>,
}

/// The placement of a link that is known to exist.
pub(super) fn placement_of<'p, 'a>(
    name: &str,
    placements: &'p [Placement<'a>],
) -> &'p Placement<'a> {
    placements.iter().find(|p| p.link.name == name).expect("every link of the tree is placed")
}

impl<'a> Tree<'a> {
    /// Checks names and shape of the tree.
    pub fn new(robot: &'a Robot, findings: &mut Findings) -> Result<Self, UrdfError> {
        if robot.joints.len().max(robot.links.len()) > super::MAX_FILE_JOINTS {
            return Err(UrdfFault::TooLarge(robot.joints.len()).into());
        }
        let mut links = HashMap::new();
        for link in &robot.links {
            if links.insert(link.name.as_str(), link).is_some() {
                findings.fault(link.line, UrdfFault::DuplicateName(link.name.clone()));
            }
        }
        let mut joints = HashSet::new();
        let mut joint_into: HashMap<&str, &Joint> = HashMap::new();
        for joint in &robot.joints {
            if !joints.insert(joint.name.as_str()) {
                findings.fault(joint.line, UrdfFault::DuplicateName(joint.name.clone()));
            }
            for link in [&joint.parent, &joint.child] {
                if !links.contains_key(link.as_str()) {
                    let (joint_name, link) = (joint.name.clone(), link.clone());
                    findings.fault(joint.line, UrdfFault::UnknownLink { joint: joint_name, link });
                }
            }
            if joint_into.insert(&joint.child, joint).is_some() {
                let message = format!("the link \"{}\" has several parents", joint.child);
                findings.fault(joint.line, UrdfFault::NotATree(message));
            }
        }
        findings.check()?;

        let is_root = |link: &&Link| !joint_into.contains_key(link.name.as_str());
        let roots: Vec<&Link> = robot.links.iter().filter(is_root).collect();
        let root = match roots[..] {
            [root] => root,
            [] => {
                return Err(UrdfFault::NotATree("no link is without a parent".into()).into());
            }
            [_, other, ..] => {
                let names: Vec<_> = roots.iter().map(|link| link.name.as_str()).collect();
                let message = format!("the roots are {}", names.join(", "));
                findings.fault(other.line, UrdfFault::NotATree(message));
                findings.check()?;
                other
            }
        };
        let mut tree = Tree { robot, root, links, joint_into, order: vec![(root, None)] };
        let mut next = 0;
        while let Some(&(parent, _)) = tree.order.get(next) {
            for joint in tree.joints_of(parent) {
                tree.order.push((tree.links[joint.child.as_str()], Some(joint)));
            }
            next += 1;
        }
        match tree.order.len() == robot.links.len() {
            true => Ok(tree),
            false => Err(UrdfFault::NotATree("some links form a loop of their own".into()).into()),
        }
    }

    pub fn joints_of(&self, parent: &'a Link) -> impl Iterator<Item = &'a Joint> + use<'a> {
        self.robot.joints.iter().filter(|joint| joint.parent == parent.name)
    }

    pub fn link(&self, name: &str) -> Option<&'a Link> {
        self.links.get(name).copied()
    }

    /// The link of the name, or the fault that it is not there.
    pub fn expect_link(&self, role: &'static str, name: &str) -> Result<&'a Link, UrdfError> {
        self.link(name).ok_or_else(|| {
            let names: Vec<_> = self.robot.links.iter().map(|link| link.name.as_str()).collect();
            let (link, links) = (name.to_string(), names.join(", "));
            UrdfFault::NoSuchLink { role, link, links }.into()
        })
    }

    /// All joints from the root to a link that exists.
    pub fn path(&self, link: &str) -> Vec<&'a Joint> {
        let mut path = Vec::new();
        let mut at = link;
        while let Some(joint) = self.joint_into.get(at) {
            path.push(*joint);
            at = &joint.parent;
        }
        path.reverse();
        path
    }

    /// Says on which moving body each link sits; parents come before their children. Joints beside
    /// the chain stand still at their `positions`.
    pub fn place_links(
        &self,
        chain: &[&'a Joint],
        positions: &HashMap<&str, f64>,
        findings: &mut Findings,
    ) -> Vec<Placement<'a>> {
        let mut placements: Vec<Placement> = Vec::new();
        for &(link, joint) in &self.order {
            let Some(joint) = joint else {
                placements.push(Placement { link, body: None, X_BL: IsometryMatrix3::identity() });
                continue;
            };
            let on_chain = chain.iter().position(|moving| moving.name == joint.name);
            placements.push(match on_chain {
                Some(i) => {
                    Placement { link, body: Some(i), X_BL: z_to_axis(joint, findings).inverse() }
                }
                None => {
                    let parent = placement_of(&joint.parent, &placements);
                    let position = positions.get(joint.name.as_str()).copied().unwrap_or(0.0);
                    let mut X_BL = parent.X_BL * joint.X_PJ;
                    if position != 0.0 {
                        X_BL *= motion(joint, position, findings);
                    }
                    Placement { link, body: parent.body, X_BL }
                }
            });
        }
        placements
    }
}

/// Pose X_AB0 of a moving joint's body frame in the body before it, at q = 0.
pub(super) fn joint_pose(
    joint: &Joint,
    placements: &[Placement],
    findings: &mut Findings,
) -> IsometryMatrix3<f64> {
    let parent = placement_of(&joint.parent, placements);
    parent.X_BL * joint.X_PJ * z_to_axis(joint, findings)
}

/// What a held joint at `position` (rad or m) adds to its origin.
pub(super) fn motion(
    joint: &Joint,
    position: f64,
    findings: &mut Findings,
) -> IsometryMatrix3<f64> {
    let Some(axis) = joint.direction() else {
        findings.fault(joint.line, UrdfFault::InvalidAxis(joint.name.clone()));
        return IsometryMatrix3::identity();
    };
    let mut motion = IsometryMatrix3::identity();
    match joint.kind {
        Kind::Prismatic => motion.translation = Translation3::from(axis * position),
        Kind::Revolute | Kind::Continuous => {
            motion.rotation = Rotation3::from_axis_angle(&Unit::new_unchecked(axis), position);
        }
        Kind::Fixed | Kind::Floating | Kind::Planar | Kind::Spherical => {}
    }
    motion
}

/// The rotation from the URDF link frame to our body frame, whose z axis is the joint axis.
fn z_to_axis(joint: &Joint, findings: &mut Findings) -> IsometryMatrix3<f64> {
    let Some(axis) = joint.direction() else {
        findings.fault(joint.line, UrdfFault::InvalidAxis(joint.name.clone()));
        return IsometryMatrix3::identity();
    };
    // Opposite vectors leave the turning direction open: take x.
    let rotation = Rotation3::rotation_between(&Vector3::z(), &axis)
        .unwrap_or_else(|| Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    IsometryMatrix3::from_parts(Translation3::identity(), rotation)
}
