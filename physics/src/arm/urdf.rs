//! URDF to [`ArmModel`]: finds the chain to the tip, holds and merges what is beside it, and names
//! everything that would make the dynamics wrong, each with its line.

mod attributes;
mod capsules;
mod chain;
mod document;
mod dynamics_check;
mod finding;
mod inertia;
mod limits;
mod links;
mod shape;
mod tree;
mod xml;

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Isometry3, IsometryMatrix3, Matrix3, Vector3};

use super::MAX_JOINTS;
use super::model::{ArmModel, Body};
pub use capsules::{Appearance, Capsule};
pub use chain::ChainCandidate;
use finding::Findings;
pub use finding::{Finding, Note, UrdfError, UrdfFault, UrdfFileError};
pub use links::{LinkFrame, LinkTree};
use tree::Tree;
pub use xml::decode;

/// Joints or links a file may have: hands and humanoids have about a hundred.
const MAX_FILE_JOINTS: usize = 2000;

/// What is said about an arm beside its URDF and its tip.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ArmSettings {
    /// Joints before this link are held, too: the arm begins here. The root link when absent.
    pub base: Option<String>,
    /// Joints that are held, by name, and where, rad or m. Those beside the chain are held anyway.
    pub held: BTreeMap<String, f64>,
    /// Largest torques, N·m, one a joint; the file's if empty.
    pub torque_limits: Vec<f64>,
    /// Largest speeds, rad/s, one a joint; the file's if empty.
    pub speed_limits: Vec<f64>,
    /// What the tip link carries beyond what the file says. Its frame becomes the task frame.
    pub payload: Option<Payload>,
}

/// A body fixed to the tip link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Payload {
    /// Its frame in the tip link.
    pub X_TP: Isometry3<f64>,
    /// Mass, kg.
    pub mass: f64,
    /// Centre of mass in its frame, m.
    pub p_cm: Vector3<f64>,
    /// Inertia about the centre of mass in the axes of its frame, kg·m².
    pub I_cm: Matrix3<f64>,
}

/// A joint that does not move, because it is not on the chain.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldJoint {
    /// Its name and line.
    pub joint: String,
    pub line: u32,
    /// Where it is held, rad or m.
    pub position: f64,
    /// It slides: its position is in m.
    pub is_linear: bool,
    /// The settings say where.
    pub is_given: bool,
}

/// A URDF as it was read.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadedArm {
    /// What to compute with.
    pub model: ArmModel,
    /// What was assumed or left out.
    pub notes: Vec<Note>,
    /// The moving joints that stand still.
    pub held: Vec<HeldJoint>,
    /// All links of the file as frames.
    pub links: LinkTree,
    /// What it looks like.
    pub appearance: Appearance,
}

/// Reads a file in whatever encoding it has.
pub fn read_file(path: &Path) -> Result<String, UrdfFileError> {
    match std::fs::read(path) {
        Ok(bytes) => Ok(decode(&bytes)),
        Err(cause) => Err(UrdfFileError::Read { path: path.into(), cause }),
    }
}

/// The chains of a URDF that may be its arm, the likeliest first.
///
/// # Errors
/// [`UrdfError`]: it is no tree of links.
pub fn chains(text: &str) -> Result<Vec<ChainCandidate>, UrdfError> {
    let mut findings = Findings::default();
    let robot = document::read(text, &mut findings)?;
    Ok(chain::candidates(&Tree::new(&robot, &mut findings)?))
}

/// What the robot is called in its URDF.
pub fn robot_name(text: &str) -> Option<String> {
    document::read(text, &mut Findings::default()).ok().map(|robot| robot.name)
}

/// Is there a link of this name?
pub fn has_link(text: &str, name: &str) -> bool {
    document::read(text, &mut Findings::default())
        .is_ok_and(|robot| robot.links.iter().any(|link| link.name == name))
}

impl ArmModel {
    /// Reads an arm from URDF text; `tip` names the link whose frame becomes the task frame.
    ///
    /// The chain is the path from the root link to `tip`. Links held by fixed joints are merged
    /// into the body that carries them, also those beyond the tip or beside the chain. Joints that
    /// move but are not on the chain are held.
    ///
    /// # Errors
    /// [`UrdfError`] names everything that is wrong, with line, link or joint and the remedy.
    pub fn from_urdf(text: &str, tip: &str) -> Result<ArmModel, UrdfError> {
        Self::load(text, tip, &ArmSettings::default()).map(|loaded| loaded.model)
    }

    /// [`ArmModel::from_urdf`] with what `settings` say, and what was assumed beside the model.
    ///
    /// # Errors
    /// As [`ArmModel::from_urdf`].
    pub fn load(text: &str, tip: &str, settings: &ArmSettings) -> Result<LoadedArm, UrdfError> {
        load(text, tip, settings)
    }

    /// Reads an arm from a URDF file, see [`ArmModel::from_urdf`].
    ///
    /// # Errors
    /// [`UrdfFileError`] names the file as well.
    pub fn from_urdf_file(path: impl AsRef<Path>, tip: &str) -> Result<ArmModel, UrdfFileError> {
        let path = path.as_ref();
        Self::from_urdf(&read_file(path)?, tip)
            .map_err(|error| UrdfFileError::Invalid { path: path.into(), error })
    }
}

/// See [`ArmModel::load`].
fn load(text: &str, tip: &str, settings: &ArmSettings) -> Result<LoadedArm, UrdfError> {
    let mut findings = Findings::default();
    let robot = document::read(text, &mut findings)?;
    let tree = Tree::new(&robot, &mut findings)?;
    let chain = chain::moving(&tree, tip, settings, &mut findings)?;
    let (positions, held) = chain::hold(&tree, &chain, settings);
    let placements = tree.place_links(&chain, &positions, &mut findings);

    let X_BT = tree::placement_of(tip, &placements).X_BL;
    let (payload, X_BP) = match &settings.payload {
        None => (None, X_BT),
        Some(payload) => {
            let X_BP = X_BT * matrix_isometry(&payload.X_TP);
            (Some(moved(payload, &X_BP)), X_BP)
        }
    };
    let n_used = chain.len().min(MAX_JOINTS);
    let mut bodies = [UNUSED_BODY; MAX_JOINTS];
    let are_given = dynamics_check::are_given(&chain, &placements, &mut findings);
    for (i, &joint) in chain.iter().enumerate() {
        let X_AB0 = tree::joint_pose(joint, &placements, &mut findings);
        let payload = payload.as_ref().filter(|_| i + 1 == chain.len());
        if !are_given {
            continue;
        }
        let mass = inertia::merge(i, joint, &placements, payload, &mut findings);
        if let Some(body) = bodies.get_mut(i) {
            *body = Body {
                R_AB0: X_AB0.rotation.into_inner(),
                p_AB: X_AB0.translation.vector,
                mass: mass.mass,
                p_BBcm: mass.p_cm,
                I_BBcm: mass.I_cm,
            };
        }
    }
    let limits = limits::read(&chain[..n_used], &bodies[..n_used], settings, &mut findings);
    findings.check()?;
    let links = LinkTree::new(&tree, &chain, &positions, &mut findings);
    note_held(&held, &mut findings);

    let model = ArmModel {
        n_joints: chain.len(),
        bodies,
        R_BP: X_BP.rotation.into_inner(),
        p_BP: X_BP.translation.vector,
        joint_names: chain.iter().map(|joint| joint.name.clone()).collect(),
        limits,
    };
    dynamics_check::resist(&model, &chain, &mut findings)?;
    let appearance = Appearance::of(&tree, tip, &placements);
    Ok(LoadedArm { model, notes: findings.into_notes(), held, links, appearance })
}

/// The payload in the axes of the body whose frame its own lies in at `X_BP`.
fn moved(payload: &Payload, X_BP: &IsometryMatrix3<f64>) -> Payload {
    let R = X_BP.rotation.matrix();
    Payload {
        p_cm: R * payload.p_cm + X_BP.translation.vector,
        I_cm: R * payload.I_cm * R.transpose(),
        ..*payload
    }
}

fn matrix_isometry(pose: &Isometry3<f64>) -> IsometryMatrix3<f64> {
    IsometryMatrix3::from_parts(pose.translation, pose.rotation.to_rotation_matrix())
}

/// One note for all joints that nobody asked to be held.
fn note_held(held: &[HeldJoint], findings: &mut Findings) {
    let assumed: Vec<&HeldJoint> = held.iter().filter(|joint| !joint.is_given).collect();
    if assumed.is_empty() {
        return;
    }
    let one = |joint: &&HeldJoint| {
        let unit = if joint.is_linear { "m" } else { "rad" };
        format!("{} at {} {unit}", joint.joint, (joint.position * 1e6).round() / 1e6)
    };
    let text = format!(
        "not on the chain and held: {}; `held` in [plant] holds them elsewhere",
        assumed.iter().map(one).collect::<Vec<_>>().join(", ")
    );
    findings.note(assumed[0].line, text);
}

/// Fills the places of joints the arm does not have; never read by the algorithms.
const UNUSED_BODY: Body = Body {
    R_AB0: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
    p_AB: Vector3::new(0.0, 0.0, 0.0),
    mass: 0.0,
    p_BBcm: Vector3::new(0.0, 0.0, 0.0),
    I_BBcm: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
};
