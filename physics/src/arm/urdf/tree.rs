//! The tree of links: which joints move the tip, and on which moving body each link sits.

use std::collections::{HashMap, HashSet};

use nalgebra::{IsometryMatrix3, Rotation3, Translation3, Vector3};
use urdf_rs::{Joint, JointType, Link, Robot};

use super::UrdfError;
use crate::arm::MAX_JOINTS;

/// A URDF whose links are known to form one tree.
pub(super) struct Tree<'a> {
    robot: &'a Robot,
    root: &'a Link,
    /// The joint that carries each link, by the link's name; all but the root have one.
    joint_into: HashMap<&'a str, &'a Joint>,
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
    pub fn new(robot: &'a Robot) -> Result<Self, UrdfError> {
        let mut links = HashSet::new();
        for link in &robot.links {
            if !links.insert(link.name.as_str()) {
                return Err(UrdfError::DuplicateName(link.name.clone()));
            }
        }
        let mut joints = HashSet::new();
        let mut joint_into: HashMap<&str, &Joint> = HashMap::new();
        for joint in &robot.joints {
            if !joints.insert(joint.name.as_str()) {
                return Err(UrdfError::DuplicateName(joint.name.clone()));
            }
            for link in [&joint.parent.link, &joint.child.link] {
                if !links.contains(link.as_str()) {
                    let (joint, link) = (joint.name.clone(), link.clone());
                    return Err(UrdfError::UnknownLink { joint, link });
                }
            }
            if joint_into.insert(&joint.child.link, joint).is_some() {
                let message = format!("the link \"{}\" has several parents", joint.child.link);
                return Err(UrdfError::NotATree(message));
            }
        }
        let roots: Vec<&Link> = robot
            .links
            .iter()
            .filter(|link| !joint_into.contains_key(link.name.as_str()))
            .collect();
        match roots[..] {
            [root] => Ok(Self { robot, root, joint_into }),
            [] => Err(UrdfError::NotATree("no link is without a parent".into())),
            _ => {
                let names: Vec<_> = roots.iter().map(|link| link.name.as_str()).collect();
                Err(UrdfError::NotATree(format!("the roots are {}", names.join(", "))))
            }
        }
    }

    /// The moving joints from the root to `tip`.
    pub fn moving_chain(&self, tip: &str) -> Result<Vec<&'a Joint>, UrdfError> {
        if !self.robot.links.iter().any(|link| link.name == tip) {
            let names: Vec<_> = self.robot.links.iter().map(|link| link.name.as_str()).collect();
            return Err(UrdfError::UnknownTip { tip: tip.into(), links: names.join(", ") });
        }
        let mut chain = Vec::new();
        let mut link = tip;
        // A loop apart from the root would be climbed for ever.
        for _ in 0..self.robot.links.len() {
            let Some(joint) = self.joint_into.get(link) else { break };
            if is_moving(joint)? {
                chain.push(*joint);
            }
            link = &joint.parent.link;
        }
        if link != self.root.name {
            return Err(UrdfError::NotATree(format!("the link \"{tip}\" is part of a loop")));
        }
        chain.reverse();
        match chain.len() {
            0 => Err(UrdfError::NoMovingJoint(tip.into())),
            1..=MAX_JOINTS => Ok(chain),
            n => Err(UrdfError::TooManyJoints(n)),
        }
    }

    /// Says on which moving body each link sits; parents come before their children.
    pub fn place_links(
        &self,
        chain: &[&'a Joint],
        tip: &str,
    ) -> Result<Vec<Placement<'a>>, UrdfError> {
        let root = Placement { link: self.root, body: None, X_BL: IsometryMatrix3::identity() };
        let mut placements = vec![root];
        let mut next = 0;
        while next < placements.len() {
            let parent = placements[next].link.name.as_str();
            for joint in self.robot.joints.iter().filter(|joint| joint.parent.link == parent) {
                let link = self.robot.links.iter().find(|link| link.name == joint.child.link);
                let link = link.expect("checked in new");
                let on_chain = chain.iter().position(|moving| moving.name == joint.name);
                let placement = match on_chain {
                    Some(i) => Placement { link, body: Some(i), X_BL: z_to_axis(joint)?.inverse() },
                    None if joint.joint_type == JointType::Fixed => Placement {
                        link,
                        body: placements[next].body,
                        X_BL: placements[next].X_BL * origin(joint)?,
                    },
                    None => {
                        let (joint, tip) = (joint.name.clone(), tip.into());
                        return Err(UrdfError::MovingJointOffChain { joint, tip });
                    }
                };
                placements.push(placement);
            }
            next += 1;
        }
        match placements.len() == self.robot.links.len() {
            true => Ok(placements),
            false => Err(UrdfError::NotATree("some links form a loop of their own".into())),
        }
    }
}

/// Pose X_AB0 of a moving joint's body frame in the body before it, at q = 0.
pub(super) fn joint_pose(
    joint: &Joint,
    placements: &[Placement],
) -> Result<IsometryMatrix3<f64>, UrdfError> {
    let parent = placement_of(&joint.parent.link, placements);
    Ok(parent.X_BL * origin(joint)? * z_to_axis(joint)?)
}

/// Converts a URDF pose: fixed-axis angles, R = Rz(yaw)·Ry(pitch)·Rx(roll).
pub(super) fn pose(
    pose: &urdf_rs::Pose,
    what: impl Fn() -> String,
) -> Result<IsometryMatrix3<f64>, UrdfError> {
    if !pose.xyz.iter().chain(pose.rpy.iter()).all(|x| x.is_finite()) {
        return Err(UrdfError::NotFinite(what()));
    }
    let [roll, pitch, yaw] = pose.rpy.0;
    let rotation = Rotation3::from_euler_angles(roll, pitch, yaw);
    Ok(IsometryMatrix3::from_parts(Translation3::from(pose.xyz.0), rotation))
}

fn origin(joint: &Joint) -> Result<IsometryMatrix3<f64>, UrdfError> {
    pose(&joint.origin, || format!("the origin of joint \"{}\"", joint.name))
}

/// The rotation from the URDF link frame to our body frame, whose z axis is the joint axis.
fn z_to_axis(joint: &Joint) -> Result<IsometryMatrix3<f64>, UrdfError> {
    let axis = Vector3::from(joint.axis.xyz.0);
    let axis = match axis.try_normalize(1e-9) {
        Some(axis) if axis.iter().all(|x| x.is_finite()) => axis,
        _ => return Err(UrdfError::InvalidAxis(joint.name.clone())),
    };
    // Opposite vectors leave the turning direction open: take x.
    let rotation = Rotation3::rotation_between(&Vector3::z(), &axis)
        .unwrap_or_else(|| Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    Ok(IsometryMatrix3::from_parts(Translation3::identity(), rotation))
}

/// Does a joint on the chain move? Only revolute and fixed joints are allowed there.
fn is_moving(joint: &Joint) -> Result<bool, UrdfError> {
    let kind = match joint.joint_type {
        JointType::Fixed => return Ok(false),
        JointType::Revolute if joint.mimic.is_none() => return Ok(true),
        JointType::Revolute => "a mimic joint",
        JointType::Continuous => "continuous, without position limits",
        JointType::Prismatic => "prismatic",
        JointType::Floating => "floating",
        JointType::Planar => "planar",
        JointType::Spherical => "spherical",
    };
    Err(UrdfError::UnsupportedJoint { joint: joint.name.clone(), kind: kind.into() })
}
