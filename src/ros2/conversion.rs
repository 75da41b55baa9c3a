//! From what Skillet records to the topics of a bag or a graph.
//!
//! | topic | type | how often |
//! |---|---|---|
//! | `/joint_states`, `/skillet/pose`, `/skillet/pose_desired`, `/skillet/wrench` | `JointState`, `PoseStamped`, `WrenchStamped` | every tick given |
//! | `/tf` | `TFMessage` | every tenth tick of a bag; of a graph at most 100 times a second |
//! | `/tf_static`, `/robot_description` | `TFMessage`, `String` | once |
//! | `/skillet/policy` | `String`, a JSON object | policies, outcomes, trials and measures as they come |
//! | `/rosout` | `Log` | warnings as they come |

use std::path::Path;

use anyhow::Result;
use serde_json::{Map, Value, json};
use shm_types::episode::TickRecord;

use super::bag::{Bag, Contents};
use super::messages::{JointState, Log, PoseStamped, Text, TfMessage, Time, WARN, WrenchStamped};
use super::outlet::Durability::{TransientLocal, Volatile};
use super::outlet::{Outlet, Topic};
use super::robot::{Robot, Scope};
use crate::record::messages::{Measures, Outcome, Policy, Trial};

/// In a bag: 100 Hz at 1 kHz, what tf2 interpolates between.
const FRAMES_EVERY: u64 = 10;

/// Turns what is told into messages for an outlet.
pub struct Conversion<O> {
    outlet: O,
    arm: Option<Arm>,
    policies: Topic<Text>,
    /// The log topic of a recording with warnings.
    logs: Option<Topic<Log>>,
}

/// The arm of a task that has one, with its topics.
struct Arm {
    robot: Robot,
    is_described: bool,
    n_ticks: u64,
    frames_every: u64,
    descriptions: Topic<Text>,
    fixed: Topic<TfMessage>,
    moving: Topic<TfMessage>,
    joints: Topic<JointState>,
    poses: [Topic<PoseStamped>; 2],
    wrenches: Topic<WrenchStamped>,
}

impl Conversion<Bag> {
    /// Begins a bag that becomes `folder`, see [`Bag::create`].
    pub fn to_bag(folder: &Path, force: bool, robot: Option<Robot>) -> Result<Conversion<Bag>> {
        Conversion::new(Bag::create(folder, force)?, robot, FRAMES_EVERY)
    }

    /// Completes the bag.
    pub fn finish(self) -> Result<Contents> {
        self.outlet.finish()
    }
}

impl<O: Outlet> Conversion<O> {
    /// Declares the topics. Every so many ticks the moving frames are told.
    pub fn new(mut outlet: O, robot: Option<Robot>, frames_every: u64) -> Result<Conversion<O>> {
        let arm = robot.map(|robot| Arm::new(robot, frames_every, &mut outlet)).transpose()?;
        let policies = outlet.topic("/skillet/policy", Volatile)?;
        Ok(Conversion { outlet, arm, policies, logs: None })
    }

    /// Joints of the arm; 0 of a task without one.
    pub fn n_joints(&self) -> usize {
        self.arm.as_ref().map_or(0, |arm| arm.robot.n_joints())
    }

    pub fn tick(&mut self, record: &TickRecord, scope: Scope, at_ns: u64) -> Result<()> {
        match &mut self.arm {
            Some(arm) => arm.tick(&mut self.outlet, record, scope, at_ns),
            None => Ok(()),
        }
    }

    /// A policy went into the loop.
    pub fn policy(&mut self, policy: &Policy, at_ns: u64) -> Result<()> {
        let event = json!({
            "event": "policy", "session": hex(policy.session), "rollout": policy.rollout,
            "policy_digest": hex(policy.digest), "policy_id": policy.policy_id,
            "duration_s": policy.duration_s, "task_dim": policy.task_dim,
            "springs": policy.springs.len(), "systems": policy.systems.len(),
        });
        self.tell(&event, at_ns)
    }

    /// A rollout has ended.
    pub fn outcome(&mut self, outcome: &Outcome, at_ns: u64) -> Result<()> {
        let event = json!({
            "event": "outcome", "session": hex(outcome.session), "rollout": outcome.rollout,
            "policy_digest": hex(outcome.policy_digest), "n_records": outcome.n_records,
            "fault": outcome.fault,
        });
        self.tell(&event, at_ns)
    }

    /// A rollout was judged.
    pub fn trial(&mut self, trial: &Trial, at_ns: u64) -> Result<()> {
        let event = json!({
            "event": "trial", "session": hex(trial.session), "rollout": trial.rollout,
            "policy_digest": hex(trial.policy_digest), "reward": trial.reward,
            "success": trial.success, "set_aside": trial.set_aside, "fault": trial.fault,
        });
        self.tell(&event, at_ns)
    }

    /// A rollout was measured.
    pub fn measures(&mut self, measures: &Measures, at_ns: u64) -> Result<()> {
        let named = measures.measures.iter().map(|one| (one.name.clone(), json!(one.value)));
        let event = json!({
            "event": "measures", "session": hex(measures.session), "rollout": measures.rollout,
            "policy_digest": hex(measures.policy_digest),
            "measures": Value::Object(named.collect::<Map<_, _>>()),
        });
        self.tell(&event, at_ns)
    }

    fn tell(&mut self, event: &Value, at_ns: u64) -> Result<()> {
        self.outlet.write(&self.policies, &Text { data: event.to_string() }, at_ns)
    }

    pub fn warn(&mut self, msg: String, at_ns: u64) -> Result<()> {
        let (stamp, name) = (Time::of_ns(at_ns), "skillet".into());
        let log = Log { stamp, level: WARN, name, msg, ..Log::default() };
        let topic = match self.logs.take() {
            Some(topic) => topic,
            None => self.outlet.topic("/rosout", Volatile)?,
        };
        self.outlet.write(self.logs.insert(topic), &log, at_ns)
    }
}

impl Arm {
    fn new(robot: Robot, frames_every: u64, outlet: &mut impl Outlet) -> Result<Arm> {
        Ok(Arm {
            robot,
            is_described: false,
            n_ticks: 0,
            frames_every,
            descriptions: outlet.topic("/robot_description", TransientLocal)?,
            fixed: outlet.topic("/tf_static", TransientLocal)?,
            moving: outlet.topic("/tf", Volatile)?,
            joints: outlet.topic("/joint_states", Volatile)?,
            poses: [
                outlet.topic("/skillet/pose", Volatile)?,
                outlet.topic("/skillet/pose_desired", Volatile)?,
            ],
            wrenches: outlet.topic("/skillet/wrench", Volatile)?,
        })
    }

    fn tick(
        &mut self,
        outlet: &mut impl Outlet,
        record: &TickRecord,
        scope: Scope,
        at_ns: u64,
    ) -> Result<()> {
        let robot = &self.robot;
        if !self.is_described {
            let description = Text { data: robot.urdf().into() };
            outlet.write(&self.descriptions, &description, at_ns)?;
            outlet.write(&self.fixed, &robot.fixed_transforms(at_ns), at_ns)?;
            self.is_described = true;
        }
        outlet.write(&self.joints, &robot.joint_state(record, at_ns), at_ns)?;
        let state = robot.state(record);
        for (topic, pose) in self.poses.iter().zip(robot.poses(record, &state, scope, at_ns)) {
            outlet.write(topic, &pose, at_ns)?;
        }
        if let Some(wrench) = robot.wrench(record, &state, at_ns) {
            outlet.write(&self.wrenches, &wrench, at_ns)?;
        }
        if self.n_ticks.is_multiple_of(self.frames_every) {
            let transforms = robot.moving_transforms(record, scope, at_ns);
            outlet.write(&self.moving, &transforms, at_ns)?;
        }
        self.n_ticks += 1;
        Ok(())
    }
}

/// Numbers of 64 bits are not whole in most readers of JSON.
fn hex(id: u64) -> String {
    format!("{id:016x}")
}
