//! URDF to [`ArmModel`]: finds the chain to the tip, merges what is fixed, refuses what would
//! make the dynamics wrong.

mod inertia;
mod tree;

use std::path::PathBuf;

use nalgebra::{Matrix3, Vector3};
use urdf_rs::Joint;

use super::model::{ArmModel, Body, JointLimits};
use super::{JointVector, MAX_JOINTS};
use tree::Tree;

/// Why a URDF is not an arm we can compute with.
#[derive(Debug, thiserror::Error)]
pub enum UrdfError {
    /// The text is not URDF, or an element lacks a required attribute.
    #[error("not readable as URDF: {0}; check the XML and the attributes it names")]
    Parse(String),
    /// Two links or two joints have one name.
    #[error("the name \"{0}\" is used twice; give every link and every joint its own name")]
    DuplicateName(String),
    /// A joint refers to a link that does not exist.
    #[error("joint \"{joint}\" refers to the unknown link \"{link}\"; add the link or correct it")]
    UnknownLink { joint: String, link: String },
    /// The requested tip is not a link.
    #[error("there is no link \"{tip}\" to be the tip; the links are {links}")]
    UnknownTip { tip: String, links: String },
    /// The links do not form one tree.
    #[error("the links do not form one tree: {0}; every link but one needs exactly one parent")]
    NotATree(String),
    /// A joint is of a kind this arm cannot have.
    #[error(
        "joint \"{joint}\" is {kind}; only revolute joints with limits and fixed joints are \
         supported"
    )]
    UnsupportedJoint { joint: String, kind: String },
    /// A moving joint lies beside or beyond the chain to the tip.
    #[error(
        "joint \"{joint}\" moves but is not on the chain to the tip \"{tip}\"; make it fixed or \
         choose another tip"
    )]
    MovingJointOffChain { joint: String, tip: String },
    /// Nothing moves.
    #[error("no revolute joint leads to the tip \"{0}\"; choose a tip further out")]
    NoMovingJoint(String),
    /// The chain is too long.
    #[error(
        "the chain to the tip has {0} revolute joints, at most {max} are supported; fix some",
        max = MAX_JOINTS
    )]
    TooManyJoints(usize),
    /// A moving body has no mass at all.
    #[error(
        "link \"{0}\" moves but has no inertia; give it an <inertial> with its mass and tensor"
    )]
    NoInertia(String),
    /// A mass is zero or negative.
    #[error("link \"{link}\" has mass {mass} kg; it must be greater than zero")]
    NonPositiveMass { link: String, mass: f64 },
    /// The inertia tensor cannot belong to a body.
    #[error("link \"{link}\" has an impossible inertia tensor: {reason}; correct its <inertia>")]
    ImpossibleInertia { link: String, reason: &'static str },
    /// The axis of a joint has no direction.
    #[error("joint \"{0}\" has an axis of zero or non-finite length; give <axis xyz> a direction")]
    InvalidAxis(String),
    /// A limit is missing or makes no sense.
    #[error("joint \"{joint}\": {reason}; set lower, upper, effort and velocity in its <limit>")]
    InvalidLimit { joint: String, reason: &'static str },
    /// A number is infinite or not a number.
    #[error("{0} is not finite; replace it by a number")]
    NotFinite(String),
}

/// Why a URDF file could not be loaded.
#[derive(Debug, thiserror::Error)]
pub enum UrdfFileError {
    /// The file could not be read.
    #[error("cannot read the URDF {}: {source}; check the path", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    /// The file does not describe an arm.
    #[error("{}: {source}", path.display())]
    Invalid { path: PathBuf, source: UrdfError },
}

/// See [`ArmModel::from_urdf`].
pub(super) fn parse(text: &str, tip: &str) -> Result<ArmModel, UrdfError> {
    let robot =
        urdf_rs::read_from_string(text).map_err(|error| UrdfError::Parse(error.to_string()))?;
    let tree = Tree::new(&robot)?;
    let chain = tree.moving_chain(tip)?;
    let placements = tree.place_links(&chain, tip)?;

    let mut limits = JointLimits {
        q_min: JointVector::zeros(),
        q_max: JointVector::zeros(),
        qd_max: JointVector::zeros(),
        tau_max: JointVector::zeros(),
    };
    let mut bodies = [UNUSED_BODY; MAX_JOINTS];
    for (i, &joint) in chain.iter().enumerate() {
        read_limits(joint, i, &mut limits)?;
        let X_AB0 = tree::joint_pose(joint, &placements)?;
        let mass = inertia::merge(i, joint, &placements)?;
        bodies[i] = Body {
            R_AB0: X_AB0.rotation.into_inner(),
            p_AB: X_AB0.translation.vector,
            mass: mass.mass,
            p_BBcm: mass.p_cm,
            I_BBcm: mass.I_cm,
        };
    }

    let X_BP = tree::placement_of(tip, &placements).X_BL;
    Ok(ArmModel {
        n_joints: chain.len(),
        bodies,
        R_BP: X_BP.rotation.into_inner(),
        p_BP: X_BP.translation.vector,
        joint_names: chain.iter().map(|joint| joint.name.clone()).collect(),
        limits,
    })
}

/// Fills the places of joints the arm does not have; never read by the algorithms.
const UNUSED_BODY: Body = Body {
    R_AB0: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
    p_AB: Vector3::new(0.0, 0.0, 0.0),
    mass: 0.0,
    p_BBcm: Vector3::new(0.0, 0.0, 0.0),
    I_BBcm: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
};

/// Copies the limits of joint `i`. A missing `<limit>` reads as zeros and is refused here.
fn read_limits(joint: &Joint, i: usize, limits: &mut JointLimits) -> Result<(), UrdfError> {
    let limit = &joint.limit;
    let invalid = |reason| UrdfError::InvalidLimit { joint: joint.name.clone(), reason };
    if ![limit.lower, limit.upper, limit.effort, limit.velocity].iter().all(|x| x.is_finite()) {
        return Err(invalid("a limit is missing or not finite"));
    }
    if limit.lower >= limit.upper {
        return Err(invalid(
            "the position limits are missing or the lower one is not below the upper one",
        ));
    }
    if limit.effort <= 0.0 {
        return Err(invalid("the effort limit is missing or not above zero"));
    }
    if limit.velocity <= 0.0 {
        return Err(invalid("the velocity limit is missing or not above zero"));
    }
    limits.q_min[i] = limit.lower;
    limits.q_max[i] = limit.upper;
    limits.qd_max[i] = limit.velocity;
    limits.tau_max[i] = limit.effort;
    Ok(())
}
