//! The configuration file: `[cell] [task] [controller] [plant] [learner] [log]`, one table each.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use learner::LearnerConfig;
use physics::skittles;
use rt_controller::ControllerConfig;
use serde::{Deserialize, Serialize};

use crate::tasks::{self, Task, World};

#[path = "config/plant.rs"] // also where the fuzzer takes this file from here
pub mod plant;

pub use plant::PlantConfig;

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    pub cell: CellConfig,
    pub task: TaskConfig,
    pub log: LogConfig,
    pub plant: PlantConfig,
    pub controller: ControllerConfig,
    pub learner: LearnerConfig,
    pub metrics: MetricsConfig,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CellConfig {
    /// Prefix of everything controller and learner share.
    pub name: String,
    /// Where the controller keeps imported policies and what it served last.
    pub state_dir: Option<PathBuf>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TaskConfig {
    pub name: String,
    /// CSV `t_s,x_m,y_m,z_m,pitch_rad`; the built-in demonstration when absent.
    pub demonstration: Option<PathBuf>,
    /// Further ones, of other ways to do it: the search keeps a mode for each.
    pub other_demonstrations: Vec<PathBuf>,
    /// Where the target stands, of a task that lets it be chosen, m.
    pub target_m: [f64; 2],
    /// What its task lets be chosen, by name; see `skillet task list`.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub options: BTreeMap<String, String>,
    /// Instead of `learner.reward`: reward and success as expressions over the task's measures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub judge: Option<JudgeConfig>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JudgeConfig {
    /// `1.5*min(apex_m, 0.55) + flip_angle_rad/pi`
    pub reward: String,
    /// `caught and flip_angle_rad > 2.5`; without one, only the reward tells good from bad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub success: Option<String>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LogConfig {
    /// error, warn, info, debug or trace.
    pub level: String,
    /// text or json.
    pub format: String,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MetricsConfig {
    /// Loopback address of the controller's Prometheus endpoint; nothing listens when absent.
    pub listen: Option<SocketAddr>,
}

impl MetricsConfig {
    /// Nothing of Skillet is offered to a network.
    pub fn check(address: SocketAddr) -> Result<()> {
        if !address.ip().is_loopback() {
            bail!(
                "metrics.listen is {address}: use a loopback address, as 127.0.0.1:9464, and a \
                 proxy of your own for others to see it"
            );
        }
        Ok(())
    }
}

impl Default for CellConfig {
    fn default() -> Self {
        CellConfig { name: "skillet".into(), state_dir: None }
    }
}

impl Default for TaskConfig {
    fn default() -> Self {
        let target_m = skittles::TARGETS[0];
        TaskConfig {
            name: "pancake".into(),
            demonstration: None,
            other_demonstrations: Vec::new(),
            target_m,
            options: BTreeMap::new(),
            judge: None,
        }
    }
}

impl TaskConfig {
    /// What was chosen, or the default; `name` is one of the options of `task`.
    pub fn option<'a>(&'a self, task: &Task, name: &str) -> &'a str {
        let default = task.options.iter().find(|(option, _)| *option == name);
        let default = default.map_or("", |(_, values)| values[0]);
        self.options.get(name).map_or(default, String::as_str)
    }

    fn check_options(&self, task: &Task) -> Result<()> {
        for (name, value) in &self.options {
            let option = task.options.iter().find(|(option, _)| option == name);
            let Some((_, values)) = option else {
                let names: Vec<&str> = task.options.iter().map(|(option, _)| *option).collect();
                let there = if names.is_empty() { "none".into() } else { names.join(", ") };
                bail!(
                    "task.options.{name}: the task {} has no such option, but {there}",
                    task.name
                );
            };
            if !values.contains(&value.as_str()) {
                bail!("task.options.{name} is '{value}': use {}", values.join(", "));
            }
        }
        Ok(())
    }
}

impl Default for LogConfig {
    fn default() -> Self {
        LogConfig { level: "info".into(), format: "text".into() }
    }
}

impl Config {
    /// The defaults of a task.
    pub fn of_task(name: &str) -> Config {
        Config::of_options(name, BTreeMap::new())
    }

    /// The same, where something was chosen.
    pub fn of_options(name: &str, options: BTreeMap<String, String>) -> Config {
        let mut config = Config::default();
        (config.task.name, config.task.options) = (name.into(), options);
        // One that is not known is refused when the configuration is checked.
        if let Ok(task) = tasks::find(name) {
            (task.configure)(&mut config);
        }
        config
    }

    /// Reads `path`, or takes the defaults of the pancake. What the file does not say are the
    /// defaults of its task. Relative paths inside are relative to the file.
    pub fn load(path: Option<&Path>) -> Result<Config> {
        let Some(path) = path else { return Ok(Config::default()) };
        let text = std::fs::read_to_string(path).with_context(|| {
            format!("{}: cannot read the configuration; check the path", path.display())
        })?;
        let mut config = parse(&text)
            .with_context(|| format!("{}: not a valid configuration", path.display()))?;
        let folder = path.parent().unwrap_or(Path::new("."));
        for inner in [&mut config.task.demonstration, &mut config.plant.arm].into_iter().flatten() {
            *inner = folder.join(&*inner);
        }
        for inner in &mut config.task.other_demonstrations {
            *inner = folder.join(&*inner);
        }
        config.validate().with_context(|| path.display().to_string())?;
        Ok(config)
    }

    pub fn task(&self) -> Result<&'static Task> {
        tasks::find(&self.task.name)
    }

    /// What a success is called; `None` where only the reward tells good from bad.
    pub fn success(&self) -> Result<Option<&'static str>> {
        let usual = Config::of_options(&self.task.name, self.task.options.clone()).task.judge;
        Ok(match &self.task.judge {
            Some(judge) if Some(judge) != usual.as_ref() => {
                judge.success.as_ref().map(|_| "success")
            }
            _ => self.task()?.success,
        })
    }

    /// The policy drives an arm; otherwise it is an action vector.
    pub fn has_arm(&self) -> bool {
        self.task().is_ok_and(Task::has_arm)
    }

    pub fn validate(&self) -> Result<()> {
        shm_types::cell::Cell::new(&self.cell.name).context("cell.name")?;
        let (task, name) = (self.task()?, &self.task.name);
        self.task.check_options(task)?;
        (task.check)(self)?;
        let expected = match task.world {
            World::Arm(_) => 0,
            World::Action(world) => world(self).dim(),
        };
        let found = self.learner.action.start.len();
        if found != expected {
            bail!("learner.action.start has {found} numbers: the task {name} takes {expected}");
        }
        if !["error", "warn", "info", "debug", "trace"].contains(&self.log.level.as_str()) {
            bail!("log.level is '{}': use error, warn, info, debug or trace", self.log.level);
        }
        if !["text", "json"].contains(&self.log.format.as_str()) {
            bail!("log.format is '{}': use text or json", self.log.format);
        }
        if let Some(address) = self.metrics.listen {
            MetricsConfig::check(address)?;
        }
        self.plant.validate()?;
        self.plant.world(self.controller.period_s()).check().context("plant")?;
        self.controller.validate()?;
        self.learner.validate()?;
        Ok(())
    }

    pub fn to_toml(&self) -> Result<String> {
        toml::to_string(self).context("the configuration cannot be written as TOML")
    }
}

/// The file's values over the defaults of its task.
fn parse(text: &str) -> Result<Config, toml::de::Error> {
    // First as it is: toml then names line and field, and lists the fields it knows.
    let given: Config = toml::from_str(text)?;
    let mut table = toml::Table::try_from(Config::of_options(&given.task.name, given.task.options))
        .expect("a configuration is plain data");
    overlay(&mut table, toml::from_str(text)?);
    table.try_into()
}

fn overlay(base: &mut toml::Table, over: toml::Table) {
    for (key, value) in over {
        match (base.get_mut(&key), value) {
            (Some(toml::Value::Table(base)), toml::Value::Table(over)) => overlay(base, over),
            (_, value) => {
                base.insert(key, value);
            }
        }
    }
}

#[cfg(test)]
#[path = "config/tests.rs"] // also where the fuzzer takes this file from here
mod tests;
