//! Writes what is seen of a cell to the topics of a recording or of a live view.
//!
//! | topic | schema | how often |
//! |---|---|---|
//! | `/tick` | `Tick` | every tick given |
//! | `/tf`; `/joint_states`, `/springs` | Foxglove's | see [`Detail`] |
//! | `/bodies` | Foxglove's `SceneUpdate` | on request: they stay |
//! | `/policy`, `/outcome`, `/trial`, `/measures`, `/mixture` | our own | as they come |
//! | `/log` | Foxglove's `Log` | as it comes |

use std::collections::VecDeque;
use std::sync::Arc;

use foxglove::messages::{FrameTransforms, JointStates, Log, SceneUpdate, Timestamp, log};
use foxglove::{Channel, Context};
use shm_types::episode::EpisodeHeader;
use shm_types::policy::PolicyMsg;
use shm_types::telemetry::TelemetryTick;

use super::drawing::Drawing;
use super::loop_policy::LoopPolicy;
use super::messages::{Measures, Mixture, Outcome, Policy, Tick, Trial};

/// Policies remembered: the one in the loop, and those that are on their way to it.
const KNOWN: usize = 8;

/// What is written with a tick.
#[derive(Clone, Copy)]
pub struct Detail {
    /// The pancake's pose in the tick itself.
    pub object: bool,
    /// Where everything is, for a 3-D view.
    pub frames: bool,
    /// Joint states in their standard form, stiffness and attractor as a drawing.
    pub springs: bool,
}

pub struct Scribe {
    context: Arc<Context>,
    ticks: Channel<Tick>,
    transforms: Channel<FrameTransforms>,
    joints: Channel<JointStates>,
    bodies: Channel<SceneUpdate>,
    springs: Channel<SceneUpdate>,
    policies: Channel<Policy>,
    outcomes: Channel<Outcome>,
    trials: Channel<Trial>,
    measures: Channel<Measures>,
    mixtures: Channel<Mixture>,
    logs: Channel<Log>,
    /// What to draw, for a task with an arm.
    drawing: Option<Drawing>,
    known: VecDeque<LoopPolicy>,
    /// Time of the newest tick, used for messages without their own time.
    now_ns: u64,
}

impl Scribe {
    pub fn new(drawing: Option<Drawing>) -> Scribe {
        let context = Context::new();
        let topic = |name: &str| context.channel_builder(name);
        Scribe {
            ticks: topic("/tick").build(),
            transforms: topic("/tf").build(),
            joints: topic("/joint_states").build(),
            bodies: topic("/bodies").build(),
            springs: topic("/springs").build(),
            policies: topic("/policy").build(),
            outcomes: topic("/outcome").build(),
            trials: topic("/trial").build(),
            measures: topic("/measures").build(),
            mixtures: topic("/mixture").build(),
            logs: topic("/log").build(),
            drawing,
            known: VecDeque::new(),
            now_ns: 0,
            context,
        }
    }

    /// Where files and servers listen.
    pub fn context(&self) -> &Arc<Context> {
        &self.context
    }

    /// What has no time of its own is written at `at_ns`, until a tick says otherwise.
    pub fn set_now(&mut self, at_ns: u64) {
        self.now_ns = at_ns;
    }

    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// A tick of the loop, at `at_ns` since the epoch, with as much beside it as `detail` says.
    pub fn tick(&mut self, seen: &TelemetryTick, at_ns: u64, detail: Detail) {
        self.now_ns = at_ns;
        let policy = self.known.iter().find(|policy| policy.digest == seen.policy_digest);
        let n_joints = self.drawing.as_ref().map_or(0, Drawing::n_joints);
        self.ticks.log_with_time(&Tick::new(seen, n_joints, policy, detail.object), at_ns);
        let Some(drawing) = &self.drawing else { return };
        let at = timestamp(at_ns);
        if detail.frames {
            self.transforms.log_with_time(&drawing.transforms(&seen.record, at), at_ns);
        }
        if detail.springs {
            self.joints.log_with_time(&drawing.joint_states(&seen.record, at), at_ns);
            self.springs.log_with_time(&self.springs(drawing, seen, at), at_ns);
        }
    }

    fn springs(&self, drawing: &Drawing, seen: &TelemetryTick, at: Timestamp) -> SceneUpdate {
        let policy = self.known.iter().find(|policy| policy.digest == seen.policy_digest);
        let stiffness = match policy {
            Some(policy) if seen.record.phase >= 2 => policy.at(&seen.record).1,
            _ => Vec::new(),
        };
        drawing.springs(&seen.record, &stiffness, at)
    }

    /// Frames and springs of a tick, for a viewer with a format of its own; `None` without an arm.
    pub fn drawn(&self, seen: &TelemetryTick) -> Option<(FrameTransforms, SceneUpdate)> {
        let (drawing, at) = (self.drawing.as_ref()?, timestamp(self.now_ns));
        Some((drawing.transforms(&seen.record, at), self.springs(drawing, seen, at)))
    }

    /// What such a viewer draws once.
    pub fn drawn_once(&self) -> Option<SceneUpdate> {
        self.drawing.as_ref().map(|drawing| drawing.bodies(timestamp(self.now_ns)))
    }

    /// Arm, pan and pancake: once is enough, but for viewers that come later.
    pub fn bodies(&self) {
        if let Some(drawing) = &self.drawing {
            let bodies = drawing.bodies(timestamp(self.now_ns));
            self.bodies.log_with_time(&bodies, self.now_ns);
        }
    }

    /// A policy that goes into the loop. What the loop would not take is not believed here either.
    pub fn policy(&mut self, message: &PolicyMsg) {
        let is_known = self.known.iter().any(|known| known.digest == message.digest);
        let Some(policy) = LoopPolicy::new(message).filter(|_| !is_known) else { return };
        self.known.push_front(policy);
        self.known.truncate(KNOWN);
        self.policies.log_with_time(&Policy::from(message), self.now_ns);
    }

    /// The policies that are known again: a new file must stand alone.
    pub fn policies_again(&mut self) {
        for policy in self.known.iter().rev() {
            self.policies.log_with_time(&Policy::from(policy.message()), self.now_ns);
        }
    }

    pub fn outcome(&self, header: &EpisodeHeader) {
        self.outcomes.log_with_time(&Outcome::from(header), self.now_ns);
    }

    pub fn trial(&self, trial: &Trial) {
        self.trials.log_with_time(trial, self.now_ns);
    }

    pub fn measures(&self, measures: &Measures) {
        self.measures.log_with_time(measures, self.now_ns);
    }

    pub fn mixture(&self, mixture: &Mixture) {
        self.mixtures.log_with_time(mixture, self.now_ns);
    }

    /// Something a person should know who looks at the recording.
    pub fn warn(&self, message: String) {
        let log = Log {
            timestamp: Some(timestamp(self.now_ns)),
            level: log::Level::Warning as i32,
            message,
            name: "skillet".into(),
            ..Log::default()
        };
        self.logs.log_with_time(&log, self.now_ns);
    }
}

fn timestamp(at_ns: u64) -> Timestamp {
    const SECOND: u64 = 1_000_000_000;
    Timestamp::new((at_ns / SECOND) as u32, (at_ns % SECOND) as u32)
}
