//! The tasks that can be learnt. Each is one file, which defines everything about it.
//!
//! A new task is a file with a `TASK` in it, and its name in the list below.

use anyhow::{Context, Result, bail};
use learner::judge::{Declared, Measurer, PlantMeasures};
use learner::prediction::Predictor;
use physics::action::ActionWorld;
use physics::arm::{ArmModel, JointVector};
use physics::plant::Plant;
use physics::referee::Referee;

use crate::config::Config;
use crate::record::solids::Solids;
use crate::report::Pictures;

pub mod camera;
mod configured;
pub mod executor;

/// The modules, and all tasks in display order.
macro_rules! tasks {
    ($($name:ident),* $(,)?) => {
        $(pub mod $name;)*
        pub const ALL: &[&Task] = &[$(&$name::TASK),*];
    };
}

tasks! { pancake, landscape, skittles, archery, obstacle, via_points, ball_in_a_cup, custom }

/// Everything the loop, the learner and the report need from a task.
pub struct Task {
    pub name: &'static str,
    /// In a line, for people.
    pub about: &'static str,
    pub world: World,
    /// Its settings, where they differ from the defaults.
    pub configure: fn(&mut Config),
    /// That its own settings make sense.
    pub check: fn(&Config) -> Result<()>,
    /// `task.target_m`, or `--target`, says where its target stands.
    pub has_target: bool,
    /// Choices in `task.options`, each with its values, the default first.
    pub options: &'static [(&'static str, &'static [&'static str])],
    /// Units of an action's entries, as endings of names; empty where there are none.
    pub action_units: &'static [&'static str],
    /// What a success is called; `None` where only the reward tells good from bad.
    pub success: Option<&'static str>,
    /// What the report shows beside reward and measures.
    pub pictures: fn(&Config) -> Pictures,
}

/// What its rollouts happen in.
pub enum World {
    Arm(ArmTask),
    /// Without an arm: the policy is an action vector.
    Action(fn(&Config) -> Box<dyn ActionWorld>),
}

/// What an arm does.
#[derive(Clone, Copy)]
pub struct ArmTask {
    /// The arm and the demonstration where the configuration names no file, so that the task needs none.
    pub urdf: &'static str,
    pub demonstration: &'static str,
    pub world: fn(&Config) -> Result<ArmWorld>,
    /// What its measures will be, where a policy alone tells; for searches that learn from measures.
    pub predictor: Option<fn(&Config) -> Result<Predictor>>,
    /// Tip and object, as 3-D viewers draw them.
    pub solids: fn(&Config) -> Solids,
}

/// An arm and what surrounds it.
pub struct ArmWorld {
    pub model: ArmModel,
    /// Start posture, rad.
    pub q0: JointVector,
    pub plant: Box<dyn Plant>,
    pub referee: Referee,
    pub measurer: Box<dyn Measurer>,
}

impl Task {
    pub fn has_arm(&self) -> bool {
        matches!(self.world, World::Arm(_))
    }

    /// What an arm does in it.
    pub fn arm(&self) -> Result<&ArmTask> {
        match &self.world {
            World::Arm(arm) => Ok(arm),
            World::Action(_) => bail!("the task {} has no arm", self.name),
        }
    }

    /// What can be computed of its measures before a rollout.
    pub fn predictor(&self, config: &Config) -> Result<Option<Predictor>> {
        match self.world {
            World::Arm(arm) => arm.predictor.map(|of| of(config)).transpose(),
            World::Action(_) => Ok(None),
        }
    }

    /// What is measured of its rollouts.
    pub fn measurer(&self, config: &Config) -> Result<Box<dyn Measurer>> {
        match self.world {
            World::Arm(arm) => Ok((arm.world)(config)?.measurer),
            World::Action(world) => {
                let measured = world(config).measure(&config.learner.action.start);
                let declared = measured.iter().map(|m| (m.name.to_string(), m.unit.to_string()));
                Ok(Box::new(PlantMeasures(declared.collect::<Declared>())))
            }
        }
    }
}

/// The task `name`.
pub fn find(name: &str) -> Result<&'static Task> {
    ALL.iter().find(|task| task.name == name).copied().with_context(|| {
        let names: Vec<&str> = ALL.iter().map(|task| task.name).collect();
        let (last, others) = names.split_last().expect("there are tasks");
        format!("task.name is '{name}': use {} or {last}", others.join(", "))
    })
}
