//! The configuration file: `[cell] [task] [controller] [plant] [learner] [log]`, one table each.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use learner::LearnerConfig;
use learner::compliance::ComplianceConfig;
use physics::skittles;
use rt_controller::ControllerConfig;
use serde::{Deserialize, Serialize};

#[path = "config/judge.rs"] // also where the fuzzer takes this file from here
pub mod judge;
#[path = "config/plant.rs"]
pub mod plant;

pub use judge::JudgeConfig;
pub use plant::PlantConfig;

/// The defaults of a task, by its name and chosen options.
pub type Defaults = fn(&str, BTreeMap<String, String>) -> Config;

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
    /// Where the controller keeps imported policies and its serving state.
    pub state_dir: Option<PathBuf>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TaskConfig {
    pub name: String,
    /// CSV `t_s,x_m,y_m,z_m,pitch_rad`, or with quaternions. Default: the built-in demonstration.
    pub demonstration: Option<PathBuf>,
    /// Further demonstrations of other solutions: the search keeps a mode for each.
    pub other_demonstrations: Vec<PathBuf>,
    /// Position of the target, for a task with a choice of target, m.
    pub target_m: [f64; 2],
    /// Options of the task, by name; see `skillet task list`.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub options: BTreeMap<String, String>,
    /// Replaces `learner.reward`: reward and success as expressions over the measures, or a program.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub judge: Option<JudgeConfig>,
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
    /// Loopback address of the controller's Prometheus endpoint; disabled by default.
    pub listen: Option<SocketAddr>,
}

impl MetricsConfig {
    /// Metrics are never offered to a network.
    pub fn check(address: SocketAddr) -> Result<()> {
        if !address.ip().is_loopback() {
            bail!(
                "metrics.listen is {address}: use a loopback address such as 127.0.0.1:9464, and a \
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

impl Default for LogConfig {
    fn default() -> Self {
        LogConfig { level: "info".into(), format: "text".into() }
    }
}

/// The configuration within a session's folder.
pub const SESSION_FILE: &str = "session.toml";

impl Config {
    /// Reads `path`; omitted settings are those of `of` for its task and options. Relative
    /// paths inside are relative to the file.
    pub fn read(path: &Path, of: Defaults) -> Result<Config> {
        let text = std::fs::read_to_string(path).with_context(|| {
            format!("{}: cannot read the configuration; check the path", path.display())
        })?;
        // A session's own file is complete: what an older one does not say was not there to be chosen.
        let is_complete = path.file_name().is_some_and(|name| name == SESSION_FILE);
        let parsed = if is_complete { toml::from_str(&text) } else { parse(&text, of) };
        let mut config =
            parsed.with_context(|| format!("{}: not a valid configuration", path.display()))?;
        let folder = path.parent().unwrap_or(Path::new("."));
        for inner in [&mut config.task.demonstration, &mut config.plant.arm].into_iter().flatten() {
            *inner = folder.join(&*inner);
        }
        for inner in &mut config.task.other_demonstrations {
            *inner = folder.join(&*inner);
        }
        if let Some(judge) = config.task.judge.as_mut().filter(|judge| judge.has_program()) {
            let inner = judge.directory.take().unwrap_or_default();
            judge.directory = Some(judge::absolute(&folder.join(inner)));
        }
        Ok(config)
    }

    /// A built-in configuration.
    pub fn of_text(text: &str, of: Defaults) -> Result<Config> {
        Ok(parse(text, of)?)
    }

    /// Checks everything that does not depend on the task.
    pub fn validate_settings(&self) -> Result<()> {
        shm_types::cell::Cell::new(&self.cell.name).context("cell.name")?;
        if !["error", "warn", "info", "debug", "trace"].contains(&self.log.level.as_str()) {
            bail!("log.level is '{}': use error, warn, info, debug or trace", self.log.level);
        }
        if !["text", "json"].contains(&self.log.format.as_str()) {
            bail!("log.format is '{}': use text or json", self.log.format);
        }
        if let Some(address) = self.metrics.listen {
            MetricsConfig::check(address)?;
        }
        self.task.judge.as_ref().map_or(Ok(()), JudgeConfig::validate)?;
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
fn parse(text: &str, of: Defaults) -> Result<Config, toml::de::Error> {
    // First as it is: toml then names line and field, and lists the fields it knows.
    let given: Config = toml::from_str(text)?;
    let mut defaults = of(&given.task.name, given.task.options);
    defaults.learner = defaults.learner.encoded(given.learner.encoding);
    if let Some(judge) = &given.task.judge {
        // A reward of one's own says itself what compliance is worth, if anything.
        defaults.learner.compliance = ComplianceConfig::off();
        if judge.has_program() {
            // Its reward and its success take the place of those that the task would write.
            defaults.task.judge = None;
        }
    }
    let mut table = toml::Table::try_from(defaults).expect("a configuration is plain data");
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
