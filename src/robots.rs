//! Built-in arms: URDF, demonstration and settings, so that no file has to be written.

use std::path::Path;

use anyhow::{Context, Result, bail};

use crate::config::Config;

/// An arm, and what a task needs to be learnt on it.
pub struct Robot {
    pub name: &'static str,
    pub about: &'static str,
    task: &'static str,
    urdf: &'static str,
    demonstration: &'static str,
    settings: &'static str,
}

macro_rules! robot {
    ($name:literal, $about:literal) => {
        Robot {
            name: $name,
            about: $about,
            task: "pancake",
            urdf: include_str!(concat!("../robots/", $name, "/", $name, "_pan.urdf")),
            demonstration: include_str!(concat!("../demos/pancake_", $name, ".csv")),
            settings: include_str!(concat!("../config/pancake-", $name, ".toml")),
        }
    };
}

/// In the order in which people see them. The WAM is what a task has by itself.
pub const ALL: [Robot; 4] = [
    robot!("panda", "Franka Emika Panda"),
    robot!("iiwa14", "KUKA LBR iiwa 14 R820"),
    robot!("xarm7", "UFACTORY xArm7"),
    robot!("ur10e", "Universal Robots UR10e, six joints"),
];

/// The folder of the demonstrations in a clone.
const DEMOS: &str = "demos";

/// Names and contents of the demonstrations of a flip that come with the tool.
pub fn demonstrations() -> impl Iterator<Item = (String, &'static str)> {
    let first = ("pancake.csv".to_owned(), include_str!("../demos/pancake.csv"));
    let others =
        ALL.iter().map(|robot| (format!("{}_{}.csv", robot.task, robot.name), robot.demonstration));
    std::iter::once(first).chain(others).map(|(name, text)| (format!("{DEMOS}/{name}"), text))
}

/// What `demos/…` holds without a clone.
pub fn demonstration(path: &Path) -> Option<&'static str> {
    demonstrations().find(|(name, _)| path == Path::new(name)).map(|(_, text)| text)
}

impl Robot {
    pub fn find(name: &str) -> Result<&'static Robot> {
        let names = || ALL.each_ref().map(|robot| robot.name).join(", ");
        ALL.iter()
            .find(|robot| robot.name == name)
            .with_context(|| format!("no built-in arm '{name}': use {}", names()))
    }

    /// Puts its files into `dir` and returns the settings that name them.
    pub fn settle(&self, task: &str, dir: &Path) -> Result<Config> {
        if task != self.task {
            bail!(
                "the arm {} comes with what the task {} needs, not with a demonstration for {task}: \
                 write a configuration, `skillet arm check` begins one",
                self.name,
                self.task
            );
        }
        let failed = || format!("{}: cannot write the arm's files", dir.display());
        std::fs::create_dir_all(dir).with_context(failed)?;
        let mut config = Config::of_text(self.settings, Config::of_options)
            .with_context(|| format!("the settings of the arm {}", self.name))?;
        let (arm, demonstration) = (dir.join("arm.urdf"), dir.join("demonstration.csv"));
        std::fs::write(&arm, self.urdf).with_context(failed)?;
        std::fs::write(&demonstration, self.demonstration).with_context(failed)?;
        (config.plant.arm, config.task.demonstration) = (Some(arm), Some(demonstration));
        Ok(config)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setup;

    #[test]
    fn every_arm_comes_with_all_that_its_task_needs() {
        for robot in &ALL {
            let dir = tempfile::tempdir().unwrap();
            let config = robot.settle("pancake", dir.path()).unwrap();
            config.validate().unwrap();
            assert!(!setup::check(&config).unwrap().is_empty(), "{}", robot.name);
        }
        let dir = tempfile::tempdir().unwrap();
        let error = ALL[0].settle("landscape", dir.path()).unwrap_err().to_string();
        assert!(error.contains("arm check"), "{error}");
        let error = Robot::find("pr2").err().unwrap().to_string();
        assert!(error.contains("panda, iiwa14, xarm7, ur10e"), "{error}");
    }
}
