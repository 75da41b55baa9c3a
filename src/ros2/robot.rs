//! An arm and its object as ROS sees them: joints, frames, poses, and the wrench at the tip.
//!
//! Frames are the links of the URDF, whose root is the world; the tip and the object have frames of their own.
// Monogram notation.
#![allow(non_snake_case)]

use anyhow::{Context, Result};
use nalgebra::{Isometry3, Quaternion as RawQuaternion, UnitQuaternion, Vector3, Vector6};
use physics::arm::urdf::{LinkFrame, LinkTree};
use physics::arm::{ArmModel, JointVector};
use rt_controller::hot::task_space::{TaskState, orientation};
use rt_controller::hot::wrench::{ArmState, TaskInertia};
use shm_types::episode::TickRecord;

use super::messages::{
    Header, JointState, Pose, PoseStamped, TfMessage, TransformStamped, Wrench, WrenchStamped,
};
use crate::config::Config;

/// What a tick tells beside its record.
#[derive(Clone, Copy, Debug)]
pub struct Scope {
    /// Leading task coordinates that the policy has learnt; of the attractor, only they are used.
    pub n_learnt: usize,
    /// The record holds the pose of the object.
    pub has_object: bool,
}

/// Turns ticks into messages.
pub struct Robot {
    model: ArmModel,
    links: LinkTree,
    urdf: String,
    tip: String,
    /// Link and pose in it of a tip that is not itself a link, a pan of `plant.pan`.
    mount: Option<(String, Isometry3<f64>)>,
    object: &'static str,
}

impl Robot {
    /// The arm of `config`, with the text of its URDF.
    pub fn new(config: &Config, urdf: String) -> Result<Robot> {
        let (plant, settings) = (&config.plant, config.plant.arm_settings());
        let loaded = ArmModel::load(&urdf, &plant.tip, &settings).context("arm.urdf")?;
        let (tip, object) = (config.task()?.arm()?.solids)(config).names();
        let links = loaded.links;
        let is_taken = |name: &str| links.frames.iter().any(|frame| frame.link == name);
        let mount = settings.payload.map(|payload| (plant.tip.clone(), payload.X_TP));
        let tip = match &mount {
            None => plant.tip.clone(),
            Some(_) if is_taken(tip) => format!("skillet_{tip}"),
            Some(_) => tip.into(),
        };
        Ok(Robot { model: loaded.model, links, urdf, tip, mount, object })
    }

    pub fn urdf(&self) -> &str {
        &self.urdf
    }

    pub fn n_joints(&self) -> usize {
        self.model.n_joints()
    }

    pub fn joint_state(&self, record: &TickRecord, at_ns: u64) -> JointState {
        let n = self.n_joints();
        JointState {
            header: Header::new(at_ns, &self.links.root),
            name: self.model.joint_names().to_vec(),
            position: record.q[..n].to_vec(),
            velocity: record.qd[..n].to_vec(),
            effort: record.tau[..n].to_vec(),
        }
    }

    /// The links that do not move in those that carry them, and the tip where it is none.
    pub fn fixed_transforms(&self, at_ns: u64) -> TfMessage {
        let mut message = self.links(false, &JointVector::zeros(), at_ns);
        if let Some((link, pose)) = &self.mount {
            message.transforms.push(TransformStamped::new(at_ns, link, &self.tip, pose));
        }
        message
    }

    /// The links that joints move, and the object where it was recorded.
    pub fn moving_transforms(&self, record: &TickRecord, scope: Scope, at_ns: u64) -> TfMessage {
        let mut message = self.links(true, &JointVector::from(record.q), at_ns);
        if scope.has_object {
            let [w, i, j, k] = record.object_quaternion;
            let turn = UnitQuaternion::from_quaternion(RawQuaternion::new(w, i, j, k));
            let pose = Isometry3::from_parts(Vector3::from(record.object_position).into(), turn);
            let object = TransformStamped::new(at_ns, &self.links.root, self.object, &pose);
            message.transforms.push(object);
        }
        message
    }

    fn links(&self, moving: bool, q: &JointVector, at_ns: u64) -> TfMessage {
        let frames = self.links.frames.iter().filter(|frame| frame.joint.is_some() == moving);
        let transform = |frame: &LinkFrame| {
            TransformStamped::new(at_ns, &frame.parent, &frame.link, &frame.pose(q))
        };
        TfMessage { transforms: frames.map(transform).collect() }
    }

    /// The pose of the tip, and the pose the policy draws it to. Coordinates that the policy has not learnt
    /// are those of the tip.
    pub fn poses(
        &self,
        record: &TickRecord,
        state: &ArmState,
        scope: Scope,
        at_ns: u64,
    ) -> [PoseStamped; 2] {
        let task = TaskState::new(&state.tip);
        let mut attractor = task.x;
        for i in 0..scope.n_learnt.min(attractor.len()) {
            attractor[i] = record.attractor[i];
        }
        [(&task.x, task.R_WP), (&attractor, orientation(&attractor))].map(|(x, turn)| PoseStamped {
            header: Header::new(at_ns, &self.links.root),
            pose: Pose::from(&Isometry3::from_parts(Vector3::new(x[0], x[1], x[2]).into(), turn)),
        })
    }

    /// Force and torque that the commanded joint torques exert at the tip, beyond what holds and moves the
    /// arm, in the tip's axes: computed, not measured. None where the arm's inertia cannot be inverted.
    pub fn wrench(
        &self,
        record: &TickRecord,
        state: &ArmState,
        at_ns: u64,
    ) -> Option<WrenchStamped> {
        let force_W = TaskInertia::new(state)?.force(state, &JointVector::from(record.tau));
        let R_PW = state.tip.X_WP.rotation.inverse();
        let turned = |row: usize| (&(R_PW * part(&force_W, row))).into();
        let wrench = Wrench { force: turned(0), torque: turned(3) };
        Some(WrenchStamped { header: Header::new(at_ns, &self.tip), wrench })
    }

    /// What poses and wrench are computed from.
    pub fn state(&self, record: &TickRecord) -> ArmState {
        ArmState::new(&self.model, &JointVector::from(record.q), &JointVector::from(record.qd))
    }
}

/// Three entries of a vector from `row` on.
fn part(vector: &Vector6<f64>, row: usize) -> Vector3<f64> {
    Vector3::new(vector[row], vector[row + 1], vector[row + 2])
}
