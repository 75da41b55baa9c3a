//! The table `[task.judge]`: what a rollout is worth, by expressions over its measures, by a program, or both.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use schemars::JsonSchema;
use search::range::{Range, range};
use serde::{Deserialize, Serialize};
use shm_types::measures::TRUTH;

/// Measures that every program returns.
pub const REWARD: &str = "reward";
pub const SUCCESS: &str = "success";
/// Time-outs, s.
const MIN_TIMEOUT_S: f64 = 0.001;
const MAX_TIMEOUT_S: f64 = 86_400.0;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct JudgeConfig {
    /// Reward as an expression over the measures, such as `1.5*min(apex_m, 0.55) + flip_angle_rad/pi`. Default: the
    /// measure `reward` of the program.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reward: Option<String>,
    /// Success as an expression over the measures, such as `caught and flip_angle_rad > 2.5`. Default: the measure
    /// `success` of the program; without one, only the reward distinguishes rollouts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub success: Option<String>,
    /// Program and arguments: a child process of the learner that judges every rollout. Default: none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub program: Vec<String>,
    /// Working folder of the program. Default: that of the configuration file, or of `--judge`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("format" = "path"))]
    pub directory: Option<PathBuf>,
    /// Longest time for a reply of the program; the first one includes its start. Default: 10.
    #[serde(skip_serializing_if = "is_usual_timeout")]
    pub timeout_s: f64,
    /// The program's measures besides reward and success: names with their units, such as `gap_m = "m"`. Default: none.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub measures: BTreeMap<String, String>,
}

impl Default for JudgeConfig {
    fn default() -> Self {
        JudgeConfig {
            reward: None,
            success: None,
            program: Vec::new(),
            directory: None,
            timeout_s: 10.0,
            measures: BTreeMap::new(),
        }
    }
}

/// `path` from any folder: a process in another one starts the program.
pub fn absolute(path: &Path) -> PathBuf {
    let here = std::env::current_dir().unwrap_or_default();
    // Without empty parts and dots.
    here.join(path).components().collect()
}

fn is_usual_timeout(timeout_s: &f64) -> bool {
    *timeout_s == JudgeConfig::default().timeout_s
}

impl JudgeConfig {
    /// With expressions only.
    pub fn written(reward: &str, success: &str) -> JudgeConfig {
        JudgeConfig {
            reward: Some(reward.into()),
            success: Some(success.into()),
            ..JudgeConfig::default()
        }
    }

    pub fn has_program(&self) -> bool {
        !self.program.is_empty()
    }

    /// The reward as an expression.
    pub fn reward(&self) -> &str {
        self.reward.as_deref().unwrap_or(REWARD)
    }

    /// The success as an expression, if there is one.
    pub fn success(&self) -> Option<&str> {
        self.success.as_deref().or(self.has_program().then_some(SUCCESS))
    }

    /// Names and units of what the program measures, in the order of its values; nothing without one.
    pub fn declared(&self) -> Vec<(String, String)> {
        if !self.has_program() {
            return Vec::new();
        }
        let all: [(String, String); 2] =
            [(REWARD.into(), "1".into()), (SUCCESS.into(), TRUTH.into())];
        all.into_iter().chain(self.measures.clone()).collect()
    }

    /// Another program. Where there was none, its reward and its success take the place of what was written.
    pub fn run(&mut self, program: Vec<String>, directory: PathBuf) {
        if !self.has_program() {
            *self = JudgeConfig::default();
        }
        (self.program, self.directory) = (program, Some(directory));
    }

    /// The settings that a session keeps: a program may be fixed, moved and given more time.
    pub fn without_place(&self) -> JudgeConfig {
        let program = self.program.iter().take(1).map(|_| String::new()).collect();
        let timeout_s = JudgeConfig::default().timeout_s;
        JudgeConfig { program, directory: None, timeout_s, ..self.clone() }
    }

    /// Every setting with its range, as fields of the table `task.judge`.
    pub fn ranges(&self) -> [Range; 1] {
        [range("timeout_s", self.timeout_s, MIN_TIMEOUT_S, MAX_TIMEOUT_S, "s")]
    }

    pub(super) fn validate(&self) -> Result<()> {
        if !self.has_program() && !self.measures.is_empty() {
            bail!("task.judge.measures are those of a program: name it in task.judge.program");
        }
        if !self.has_program() && self.reward.is_none() {
            bail!(
                "task.judge.reward is missing: write an expression over the measures, or name a program in \
                 task.judge.program"
            );
        }
        if self.program.first().is_some_and(String::is_empty) {
            bail!(
                "task.judge.program begins with an empty word: use [\"python3\", \"my_task.py\"]"
            );
        }
        Ok(())
    }
}
