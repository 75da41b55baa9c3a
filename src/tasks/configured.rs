//! What of a configuration depends on its task: defaults, choices, checks.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result, bail};

use learner::compliance::ComplianceConfig;

use super::{Task, World, find};
use crate::config::{Config, TaskConfig};

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
        if let Ok(task) = find(name) {
            if !task.has_arm() {
                config.learner.compliance = ComplianceConfig::off();
            }
            (task.configure)(&mut config);
        }
        config
    }

    /// Reads and checks `path`, or takes the defaults of the pancake.
    pub fn load(path: Option<&Path>) -> Result<Config> {
        let Some(path) = path else { return Ok(Config::of_task(&TaskConfig::default().name)) };
        let config = Config::read(path, Config::of_options)?;
        config.validate().with_context(|| path.display().to_string())?;
        Ok(config)
    }

    pub fn task(&self) -> Result<&'static Task> {
        find(&self.task.name)
    }

    /// What a success is called; `None` where only the reward tells good from bad.
    pub fn success(&self) -> Result<Option<&'static str>> {
        let usual = Config::of_options(&self.task.name, self.task.options.clone()).task.judge;
        Ok(match &self.task.judge {
            Some(judge) if Some(judge) != usual.as_ref() => judge.success().map(|_| "success"),
            _ => self.task()?.success,
        })
    }

    /// The policy drives an arm; otherwise it is an action vector.
    pub fn has_arm(&self) -> bool {
        self.task().is_ok_and(Task::has_arm)
    }

    pub fn validate(&self) -> Result<()> {
        let (task, name) = (self.task()?, &self.task.name);
        self.task.check_options(task)?;
        (task.check)(self)?;
        let expected = match task.world {
            World::Arm(_) => 0,
            World::Action(world) => world(self).dim(),
        };
        if !task.has_arm() && self.learner.compliance.pays() {
            bail!(
                "learner.compliance.weight is {}: the task {name} has no arm, so no stiffness to reward; \
                 set it to 0",
                self.learner.compliance.weight
            );
        }
        if !task.has_arm() && !self.learner.encoding.is_springs() {
            bail!(
                "learner.encoding is {}: the task {name} has no arm and takes no demonstration; leave it out",
                self.learner.encoding.name()
            );
        }
        let found = self.learner.action.start.len();
        if found != expected {
            bail!("learner.action.start has {found} numbers: the task {name} takes {expected}");
        }
        self.validate_settings()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tasks::ALL;

    #[test]
    fn what_a_file_does_not_say_are_the_defaults_of_its_task() {
        let folder = tempfile::TempDir::new().unwrap();
        let path = folder.path().join("c.toml");
        std::fs::write(&path, "[task]\nname = \"landscape\"\n[learner]\nseed = 7\n").unwrap();
        let mut expected = Config::of_task("landscape");
        expected.learner.seed = 7;
        assert_eq!(Config::load(Some(&path)).unwrap(), expected);
    }

    #[test]
    fn every_task_has_valid_defaults_whatever_is_chosen() {
        for task in ALL {
            Config::of_task(task.name).validate().unwrap();
            for (option, values) in task.options {
                for value in *values {
                    let options = BTreeMap::from([(option.to_string(), value.to_string())]);
                    Config::of_options(task.name, options).validate().unwrap();
                }
            }
        }
        let mut config = Config::of_task("landscape");
        config.learner.action.start.clear();
        let message = format!("{:#}", config.validate().unwrap_err());
        assert!(message.contains("the task landscape takes 2"), "{message}");
    }

    #[test]
    fn what_cannot_be_chosen_is_refused_with_what_can() {
        let with = |name: &str, option: &str, value: &str| {
            let options = BTreeMap::from([(option.to_string(), value.to_string())]);
            format!("{:#}", Config::of_options(name, options).validate().unwrap_err())
        };
        assert!(with("landscape", "height", "low").contains("no such option, but none"));
        let task = ALL.iter().find(|task| !task.options.is_empty()).unwrap();
        let (option, values) = task.options[0];
        let message = with(task.name, option, "soft");
        assert!(message.contains("is 'soft'") && message.contains(values[1]), "{message}");
    }
}
