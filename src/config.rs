//! The configuration file: `[cell] [task] [controller] [plant] [learner] [log]`, one table each.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use learner::LearnerConfig;
use learner::reward::RewardKind;
use learner::search::Method;
use physics::arm::JointVector;
use physics::pancake::{PancakeConfig, WAM7_START_POSTURE};
use physics::skittles::{self, SkittlesConfig};
use rt_controller::ControllerConfig;
use serde::{Deserialize, Serialize};

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
    /// Where the skittle stands (task skittles), m.
    pub target_m: [f64; 2],
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

/// The simulated arm, pan and pancake.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlantConfig {
    /// URDF of the arm with its pan; the built-in WAM when absent.
    pub arm: Option<PathBuf>,
    /// Link whose frame is the pan: origin on its surface, z its normal.
    pub tip: String,
    /// Where rollouts start; the pan must be level there.
    pub start_posture_rad: Vec<f64>,
    pub pancake_mass_kg: f64,
    pub pancake_radius_m: f64,
    /// Start of the pancake relative to the centre of the pan.
    pub pancake_offset_m: [f64; 2],
    pub friction: f64,
    pub restitution: f64,
    pub contact_frequency_hz: f64,
    pub contact_damping_ratio: f64,
    pub solver_iterations: usize,
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
        }
    }
}

impl TaskConfig {
    /// The world of the task skittles.
    pub fn skittles(&self) -> SkittlesConfig {
        SkittlesConfig { target: self.target_m, ..Default::default() }
    }
}

impl Default for LogConfig {
    fn default() -> Self {
        LogConfig { level: "info".into(), format: "text".into() }
    }
}

impl Default for PlantConfig {
    fn default() -> Self {
        let world = PancakeConfig::default();
        PlantConfig {
            arm: None,
            tip: "pan".into(),
            start_posture_rad: WAM7_START_POSTURE.iter().copied().collect(),
            pancake_mass_kg: world.pancake_mass,
            pancake_radius_m: world.pancake_radius,
            pancake_offset_m: world.pancake_offset,
            friction: world.friction,
            restitution: world.restitution,
            contact_frequency_hz: world.contact_frequency_hz,
            contact_damping_ratio: world.contact_damping_ratio,
            solver_iterations: world.solver_iterations,
        }
    }
}

impl PlantConfig {
    pub fn world(&self, period_s: f64) -> PancakeConfig {
        PancakeConfig {
            period_s,
            pancake_mass: self.pancake_mass_kg,
            pancake_radius: self.pancake_radius_m,
            pancake_offset: self.pancake_offset_m,
            friction: self.friction,
            restitution: self.restitution,
            contact_frequency_hz: self.contact_frequency_hz,
            contact_damping_ratio: self.contact_damping_ratio,
            solver_iterations: self.solver_iterations,
            ..PancakeConfig::default()
        }
    }

    pub fn start_posture(&self) -> JointVector {
        let mut q = JointVector::zeros();
        for (q, value) in q.iter_mut().zip(&self.start_posture_rad) {
            *q = *value;
        }
        q
    }

    fn validate(&self) -> Result<()> {
        for (field, value, min, max) in [
            ("pancake_mass_kg", self.pancake_mass_kg, 1e-3, 2.0),
            ("pancake_radius_m", self.pancake_radius_m, 0.02, 0.125),
            ("pancake_offset_m[0]", self.pancake_offset_m[0], -0.1, 0.1),
            ("pancake_offset_m[1]", self.pancake_offset_m[1], -0.1, 0.1),
            ("friction", self.friction, 0.0, 2.0),
            ("restitution", self.restitution, 0.0, 1.0),
            ("contact_frequency_hz", self.contact_frequency_hz, 5.0, 500.0),
            ("contact_damping_ratio", self.contact_damping_ratio, 0.1, 20.0),
            ("solver_iterations", self.solver_iterations as f64, 1.0, 64.0),
        ] {
            if !(min..=max).contains(&value) {
                bail!("plant.{field} is {value}: use a value within {min}..={max}");
            }
        }
        let posture = &self.start_posture_rad;
        if posture.is_empty() || posture.len() > physics::arm::MAX_JOINTS {
            bail!(
                "plant.start_posture_rad has {} numbers: give one a joint of the arm, 1 to {}",
                posture.len(),
                physics::arm::MAX_JOINTS
            );
        }
        if let Some(bad) = posture.iter().find(|q| !q.is_finite()) {
            bail!("plant.start_posture_rad holds {bad}: give finite angles in rad");
        }
        Ok(())
    }
}

impl Config {
    /// The defaults of a task.
    pub fn of_task(name: &str) -> Config {
        let mut config = Config::default();
        config.task.name = name.into();
        let learner = &mut config.learner;
        match name {
            "landscape" => {
                learner.rollouts = 200;
                learner.action.start = vec![8.0, 2.0];
                learner.search.method = Method::Tempered;
                learner.reward.kind = RewardKind::Value;
            }
            "skittles" => {
                learner.rollouts = 200;
                learner.action.start = vec![0.0, 7.5];
                learner.search.method = Method::Regions;
                learner.action.min = skittles::BOX.0.to_vec();
                learner.action.max = skittles::BOX.1.to_vec();
                learner.reward.kind = RewardKind::Distance;
            }
            _ => {}
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

    /// The policy drives an arm; otherwise it is an action vector.
    pub fn has_arm(&self) -> bool {
        self.task.name == "pancake"
    }

    pub fn validate(&self) -> Result<()> {
        shm_types::cell::Cell::new(&self.cell.name).context("cell.name")?;
        let name = &self.task.name;
        if !["pancake", "landscape", "skittles"].contains(&name.as_str()) {
            bail!("task.name is '{name}': use pancake, landscape or skittles");
        }
        if name == "skittles" {
            self.task.skittles().validate().context("task.target_m")?;
        }
        let expected = if self.has_arm() { 0 } else { 2 };
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
    let mut table = toml::Table::try_from(Config::of_task(&given.task.name))
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
