//! A configuration file, checked with every file it names: what `skillet learn` checks before it starts a
//! process, one outcome each instead of the first fault.

use std::fs::File;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use learner::Demonstration;
use learner::problem::Problem;
use physics::arm::ArmModel;
use serde_json::{Value, json};

use crate::config::{Config, JudgeConfig};
use crate::judging::command::{check_program, folder};
use crate::{holding, judging, setup};

/// What was checked, and what is wrong with it.
pub struct Outcome {
    /// The setting, as `plant.arm`.
    pub setting: &'static str,
    pub file: Option<PathBuf>,
    /// What was found where nothing is wrong.
    pub found: String,
    pub fault: Option<String>,
}

impl Outcome {
    fn of(setting: &'static str, file: Option<&Path>, result: Result<String>) -> Outcome {
        let file = file.map(Path::to_path_buf);
        match result {
            Ok(found) => Outcome { setting, file, found, fault: None },
            Err(error) => {
                let (found, fault) = (String::new(), Some(format!("{error:#}")));
                Outcome { setting, file, found, fault }
            }
        }
    }

    /// A line for a person to read.
    pub fn line(&self) -> String {
        let file = self.file.as_ref().map(|file| format!("{}: ", file.display()));
        let file = file.unwrap_or_default();
        match &self.fault {
            None => format!("ok      {}: {file}{}\n", self.setting, self.found),
            // Most faults name their setting and their file themselves.
            Some(fault) => {
                let file = if fault.contains(file.trim_end_matches(": ")) { "" } else { &file };
                let named = fault.contains(self.setting);
                let setting = if named { String::new() } else { format!("{}: ", self.setting) };
                format!("FAILED  {setting}{file}{fault}\n")
            }
        }
    }

    pub fn json(&self) -> Value {
        let Outcome { setting, file, found, fault } = self;
        json!({ "setting": setting, "file": file, "ok": fault.is_none(), "found": found, "fault": fault })
    }
}

/// Checks the file at `path`. An error means that it cannot be read.
pub fn check(path: &Path) -> Result<Vec<Outcome>> {
    File::open(path).with_context(|| format!("{}: cannot read; check the path", path.display()))?;
    let read = Config::read(path, Config::of_options);
    let config = match read.and_then(|config| config.validate().map(|()| config)) {
        Ok(config) => config,
        Err(error) => return Ok(vec![Outcome::of("settings", Some(path), Err(error))]),
    };
    let said = format!("task {}, every setting within its range", config.task.name);
    let mut all = vec![Outcome::of("settings", Some(path), Ok(said))];
    let mut model = None;
    if config.has_arm() {
        all.push(check_arm(&config, &mut model));
        all.extend(check_demonstrations(&config, model.as_ref()));
    }
    all.extend(check_programs(&config));
    // What follows would only repeat a fault of the arm.
    if model.is_some() || !config.has_arm() {
        let judge = judging::judge(&config).map(|_| "every measure it needs is measured".into());
        all.push(Outcome::of(judge_setting(&config), None, judge));
    }
    Ok(all)
}

fn judge_setting(config: &Config) -> &'static str {
    if config.task.judge.is_some() { "task.judge" } else { "learner.reward" }
}

/// With what was assumed where the URDF says nothing or not quite what a body can be.
fn check_arm(config: &Config, model: &mut Option<ArmModel>) -> Outcome {
    let result = setup::arm(config).and_then(|arm| {
        holding::check_start(config, &arm)?;
        let notes = setup::load_arm(config)?.notes;
        let notes: String = notes.iter().map(|note| format!("; {note}")).collect();
        let found = format!("{} joints, level in the start posture{notes}", arm.n_joints());
        *model = Some(arm);
        Ok(found)
    });
    Outcome::of("plant.arm", config.plant.arm.as_deref(), result)
}

/// Each demonstration by itself, then the policy that is fitted to them.
fn check_demonstrations(config: &Config, model: Option<&ArmModel>) -> Vec<Outcome> {
    let first = config.task.demonstration.as_deref();
    let mut read: Vec<Demonstration> = Vec::new();
    let others = config.task.other_demonstrations.iter();
    let named = others.map(|path| ("task.other_demonstrations", Some(path.as_path())));
    let mut all = Vec::new();
    for (setting, path) in [("task.demonstration", first)].into_iter().chain(named) {
        let demonstration = match path {
            Some(path) => setup::read_demonstration(path),
            None => setup::built_in_demonstration(config),
        };
        let fits = demonstration.and_then(|demonstration| {
            if let Some(model) = model {
                setup::check_followed(config, model, &demonstration)?;
            }
            setup::check_as_long(&demonstration, read.first().unwrap_or(&demonstration))?;
            Ok(demonstration)
        });
        let found = fits.map(|demonstration| {
            let found = format!(
                "{:.2} s, within the reach and speed of the arm",
                demonstration.duration_s()
            );
            read.push(demonstration);
            found
        });
        all.push(Outcome::of(setting, path, found));
    }
    if model.is_some() && all.iter().all(|outcome| outcome.fault.is_none()) {
        let problem = Problem::new(&config.learner, &read).map_err(anyhow::Error::from);
        let found = problem.map(|problem| {
            format!("{} numbers describe a policy", problem.spaces[0].theta_0.len())
        });
        all.push(Outcome::of("learner", None, found));
    }
    all
}

/// The programs, and every file among their words.
fn check_programs(config: &Config) -> Vec<Outcome> {
    let here = std::env::current_dir().unwrap_or_default();
    let judge = config.task.judge.as_ref().filter(|judge| judge.has_program());
    let judge =
        judge.map(|judge: &JudgeConfig| ("task.judge.program", &judge.program, folder(judge), ""));
    let hint = "the program of a plant runs in the folder in which `skillet` is started";
    let plant = Some(&config.plant.program).filter(|words| !words.is_empty());
    let plant = plant.map(|words| ("plant.program", words, here, hint));
    let mut all = Vec::new();
    for (setting, words, folder, hint) in judge.into_iter().chain(plant) {
        let mut found = check_program(setting, words, &folder).map(|()| words.join(" "));
        if !hint.is_empty() {
            found = found.context(hint);
        }
        all.push(Outcome::of(setting, None, found));
        for file in words.iter().map(|word| folder.join(word)).filter(|file| file.is_file()) {
            let opened = File::open(&file).context("cannot read").map(|_| "can be read".into());
            all.push(Outcome::of(setting, Some(&file), opened));
        }
    }
    all
}
