//! Progress of a session: a bar on a terminal, otherwise an occasional line.

use std::cell::Cell;

use indicatif::{ProgressBar, ProgressStyle};
use learner::summary::{Summary, TrialReport};
use serde::{Deserialize, Serialize};

use crate::bar::bar;
use crate::early::{self, EndedEarly};
use crate::stderr::say;
use crate::tty;

/// The learner process's output after each trial, one JSON object per line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrialLine {
    pub rollout: u64,
    /// How many there are; where several cells learn, not the number of the newest.
    #[serde(default)]
    pub trials: u64,
    pub reward: f64,
    pub success: bool,
    /// `None` before the first rewarded trial.
    pub best_reward: Option<f64>,
    pub successes: u64,
    pub first_success: Option<u64>,
    /// Why the controller refused its policy, where it did.
    #[serde(default)]
    pub refused: Option<String>,
    /// How many rollouts ended early, by reason.
    #[serde(default)]
    pub ended_early: EndedEarly,
}

impl TrialLine {
    /// The line before the first trial of this run.
    pub fn so_far(summary: &Summary) -> TrialLine {
        TrialLine {
            rollout: summary.trials,
            trials: summary.trials,
            reward: 0.0,
            success: false,
            best_reward: summary.best_rollout.map(|_| summary.best_reward),
            successes: summary.successes,
            first_success: summary.first_success,
            refused: None,
            ended_early: early::by_reason(&summary.ended_early),
        }
    }

    pub fn add(&mut self, trial: &TrialReport) {
        self.rollout = trial.rollout;
        self.trials += 1;
        self.reward = trial.reward;
        self.success = trial.success;
        if !trial.set_aside {
            let best = self.best_reward.map_or(trial.reward, |best| best.max(trial.reward));
            self.best_reward = Some(best);
        }
        early::add(&mut self.ended_early, trial.fault);
        if trial.success {
            self.successes += 1;
            self.first_success = self.first_success.or(Some(trial.rollout));
        }
    }
}

/// Rollouts per line without a terminal.
const LINE_EVERY: u64 = 10;

pub struct Progress {
    bar: Option<ProgressBar>,
    rollouts: u64,
    has_success: bool,
    /// A refusal was shown; one says how the others are.
    has_refused: Cell<bool>,
}

impl Progress {
    /// For a session of `rollouts`, of which `done` are over already; `has_success` when the task
    /// knows success.
    pub fn new(rollouts: u64, done: u64, has_success: bool) -> Progress {
        let first = match done {
            0 => "starting controller and learner".to_string(),
            // A long session prints nothing else until it has been restored.
            _ => format!("resuming after {done} rollouts"),
        };
        let bar = tty::can_draw(&std::io::stderr()).then(|| {
            let style = ProgressStyle::with_template(
                "{bar:30.cyan/blue} {pos}/{len}  {msg}  {elapsed_precise}",
            );
            let bar = bar(Some(rollouts));
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar.set_position(done);
            bar.set_message(first.clone());
            bar
        });
        if bar.is_none() && done > 0 {
            say(&first);
        }
        Progress { bar, rollouts, has_success, has_refused: Cell::new(false) }
    }

    pub fn trial(&self, trial: &TrialLine) {
        if let Some(reason) = trial.refused.as_ref().filter(|_| !self.has_refused.replace(true)) {
            let rollout = trial.rollout;
            self.note(&format!(
                "rollout {rollout}: the controller refused the policy, so the trial earns no reward: {reason}; \
                 see learner.log for further refusals"
            ));
        }
        let best = trial.best_reward.map_or("none".into(), |best| format!("{best:.3}"));
        let mut message = format!("reward {:.3}  best {best}", trial.reward);
        if self.has_success {
            let first = trial.first_success.map_or(String::new(), |n| format!(" (first {n})"));
            message += &format!("  successes {}{first}", trial.successes);
        }
        if let Some(early) = early::sentence(&trial.ended_early) {
            message += &format!("  {early}");
        }
        match &self.bar {
            Some(bar) => {
                bar.set_position(trial.trials);
                bar.set_message(message);
            }
            None if trial.trials.is_multiple_of(LINE_EVERY) || trial.trials == self.rollouts => {
                say(&format!("rollout {}/{}  {message}", trial.trials, self.rollouts));
            }
            None => {}
        }
    }

    pub fn note(&self, text: &str) {
        match &self.bar {
            Some(bar) => bar.println(text),
            None => say(text),
        }
    }

    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
