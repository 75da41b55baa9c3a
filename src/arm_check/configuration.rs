//! The configuration that a checked arm works with, as TOML to paste.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use super::Checked;
use super::report::{DEMONSTRATION, assumed_limits};
use crate::config::Config;

impl Checked {
    /// What differs from the defaults, as a file that works where it is pasted. `folder` is where
    /// the file will be, when that is not here.
    pub fn configuration(&self, folder: Option<&Path>) -> Result<String> {
        let (plant, controller) = (&self.config.plant, &self.config.controller);
        let arm = plant.arm.clone().unwrap_or_default();
        let is_elsewhere = folder.is_some_and(|folder| !folder.as_os_str().is_empty());
        let arm: PathBuf = match is_elsewhere {
            true => arm.canonicalize().with_context(|| arm.display().to_string())?,
            false => arm,
        };
        let text = |value: &str| toml::Value::String(value.into()).to_string();
        let list = |values: &[f64]| {
            let values: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
            format!("[{}]", values.join(", "))
        };
        let mut lines = vec!["[task]".to_string()];
        lines.push(format!("demonstration = {}", text(DEMONSTRATION)));
        lines.push("\n[plant]".into());
        lines.push(format!("arm = {}", text(&arm.display().to_string())));
        lines.push(format!("tip = {}", text(&plant.tip)));
        if let Some(base) = &plant.base {
            lines.push(format!("base = {}", text(base)));
        }
        lines.push(format!("start_posture_rad = {}", list(&plant.start_posture_rad)));
        if let Some(pan) = &plant.pan {
            let (xyz, rpy) = (list(&pan.xyz_m), list(&pan.rpy_rad));
            let mass = pan.mass_kg;
            lines.push(format!("pan = {{ mass_kg = {mass:?}, xyz_m = {xyz}, rpy_rad = {rpy} }}"));
        }
        if !plant.held.is_empty() {
            let held = toml::Value::try_from(&plant.held)?;
            lines.push(format!("held = {held}"));
        }
        for (field, values) in assumed_limits(&self.arm) {
            lines.push(format!("{field} = {}  # assumed: the URDF has none", list(&values)));
        }
        let defaults = Config::default().controller;
        if controller != &defaults {
            lines.push("\n[controller]".into());
            lines.push(format!("workspace_radius_m = {:?}", controller.workspace_radius_m));
            lines.push(format!("workspace_floor_m = {:?}", controller.workspace_floor_m));
        }
        Ok(lines.join("\n") + "\n")
    }
}
