//! The configuration file: `[cell] [task] [controller] [plant] [learner] [log]`, one table each.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use learner::LearnerConfig;
use learner::compliance::ComplianceConfig;
use physics::skittles;
use rt_controller::ControllerConfig;
use schemars::JsonSchema;
use search::range::{ANY, Range, inside, range, within};
use serde::{Deserialize, Serialize};

#[path = "config/judge.rs"] // also where the fuzzer takes this file from here
pub mod judge;
#[path = "config/plant.rs"]
pub mod plant;

pub use judge::JudgeConfig;
pub use plant::PlantConfig;

const LEVELS: [&str; 5] = ["error", "warn", "info", "debug", "trace"];
const FORMATS: [&str; 2] = ["text", "json"];

/// The defaults of a task, by its name and chosen options.
pub type Defaults = fn(&str, BTreeMap<String, String>) -> Config;

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// The cell: a controller and its learner.
    pub cell: CellConfig,
    /// The task, its demonstrations and its judge.
    pub task: TaskConfig,
    /// The log of controller and learner.
    pub log: LogConfig,
    /// The arm with its pan and the pancake, simulated or external.
    pub plant: PlantConfig,
    /// The real-time loop.
    pub controller: ControllerConfig,
    /// A session: the policy, the search and the reward.
    pub learner: LearnerConfig,
    /// Metrics for Prometheus.
    pub metrics: MetricsConfig,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CellConfig {
    /// Name of the cell: the prefix of everything controller and learner share.
    pub name: String,
    /// Folder in which the controller keeps imported policies and its serving state. Default: the
    /// folder of its name in `$SKILLET_STATE_DIR`, `$STATE_DIRECTORY` or `~/.local/state/skillet`.
    #[schemars(extend("format" = "path"))]
    pub state_dir: Option<PathBuf>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TaskConfig {
    /// Name of the task; `skillet task list` shows them.
    pub name: String,
    /// Demonstration: a CSV with `t_s,x_m,y_m,z_m,pitch_rad`, or with quaternions. Default: the task's own.
    #[schemars(extend("format" = "path"))]
    pub demonstration: Option<PathBuf>,
    /// Further demonstrations: other solutions, or repetitions, as `learner.demonstrations_are` says.
    #[schemars(extend("items" = { "type": "string", "format": "path" }))]
    pub other_demonstrations: Vec<PathBuf>,
    /// Position of the target, for a task with a choice of target.
    pub target_m: [f64; 2],
    /// Options of the task, by name; see `skillet task list`. Default: the first value of each.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub options: BTreeMap<String, String>,
    /// Judge that replaces `learner.reward`: expressions over the measures, or a program. Default: none, or the task's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub judge: Option<JudgeConfig>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LogConfig {
    /// Least severe level that is logged.
    #[schemars(extend("enum" = LEVELS))]
    pub level: String,
    /// Format of a line of the log.
    #[schemars(extend("enum" = FORMATS))]
    pub format: String,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MetricsConfig {
    /// Loopback address of the controller's Prometheus endpoint. Default: none.
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
            let hint = match path.starts_with("config") {
                true => "; the ready-made ones are in a clone, or below share/skillet",
                false => "",
            };
            format!("{}: cannot read the configuration; check the path{hint}", path.display())
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

    /// Every number with its range and its unit.
    pub fn ranges(&self) -> Vec<Range> {
        let of_controller = self.controller.ranges();
        let controller =
            of_controller.map(|(f, value, min, max, unit)| range(f, value, min, max, unit));
        [
            self.own_ranges(),
            inside("controller.", controller),
            inside("learner.", self.learner.ranges()),
        ]
        .concat()
    }

    /// Those of the tables `task` and `plant`.
    fn own_ranges(&self) -> Vec<Range> {
        let target =
            |i: usize| within(&format!("task.target_m[{i}]"), self.task.target_m[i], ANY, "m");
        let judge = self.task.judge.iter().flat_map(JudgeConfig::ranges);
        [
            vec![target(0), target(1)],
            inside("task.judge.", judge),
            inside("plant.", self.plant.ranges()),
        ]
        .concat()
    }

    /// Checks everything that does not depend on the task.
    pub fn validate_settings(&self) -> Result<()> {
        shm_types::cell::Cell::new(&self.cell.name).context("cell.name")?;
        if !LEVELS.contains(&self.log.level.as_str()) {
            bail!("log.level is '{}': use error, warn, info, debug or trace", self.log.level);
        }
        if !FORMATS.contains(&self.log.format.as_str()) {
            bail!("log.format is '{}': use text or json", self.log.format);
        }
        if let Some(address) = self.metrics.listen {
            MetricsConfig::check(address)?;
        }
        if let Some(range) = self.own_ranges().iter().find(|range| !range.holds()) {
            bail!("{} is {}: use {}", range.field, range.value, range.allowed());
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
