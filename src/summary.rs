//! The result of `skillet learn`, for people and for machines.

use std::path::Path;
use std::time::Duration;

use learner::summary::Summary as Achievement;
use serde_json::json;
use shm_types::command::Status;

use crate::session_folder::SessionFolder;
use crate::{early, fields};

/// The result of a session, for people and for machines.
pub struct Summary {
    pub task: String,
    /// What a success is called; `None` where only the reward tells good from bad.
    pub success: Option<&'static str>,
    pub seed: u64,
    /// Rollouts the session is to have.
    pub rollouts: u64,
    pub result: Achievement,
    /// As `skillet policy modes --json` lists them.
    pub modes: Vec<serde_json::Value>,
    pub folder: SessionFolder,
    pub wall: Duration,
    pub rollouts_per_s: f64,
    pub interrupted: bool,
    /// The controller's last words; absent when it was gone before it could be asked.
    pub status: Option<Status>,
}

impl Summary {
    pub fn json(&self, report: &Path) -> serde_json::Value {
        let wakeup_us = |status: &Status| {
            fields::times_us(status.wakeup_p50_ns, status.wakeup_p99_ns, status.wakeup_max_ns)
        };
        let timing = self.status.map(|status| {
            json!({
                "realtime": status.is_paced(),
                "realtime_priority": status.privileged == 1,
                "deadline_misses": status.deadline_misses,
                "wakeup_us": wakeup_us(&status),
                "tick_us": fields::times_us(status.tick_p50_ns, status.tick_p99_ns, status.tick_max_ns),
            })
        });
        json!({
            "task": self.task,
            "seed": self.seed,
            "trials": self.result.trials,
            "rollouts": self.rollouts,
            "first_success": self.result.first_success,
            "successes": self.result.successes,
            "faults": self.result.faults,
            "ended_early": early::by_reason(&self.result.ended_early),
            "set_aside": self.result.set_aside,
            "modes": self.modes,
            "success_last20": self.result.success_last20,
            "means_last20": self.result.means_last20,
            "mean_successes_last20": self.result.mean_successes_last20,
            "best_reward": self.result.best_reward,
            "best_rollout": self.result.best_rollout,
            "session": self.folder.dir(),
            "report": report,
            "wall_s": self.wall.as_secs_f64(),
            "rollouts_per_s": self.rollouts_per_s,
            "interrupted": self.interrupted,
            "timing": timing,
        })
    }

    pub fn text(&self, report: &Path) -> String {
        let result = &self.result;
        let achieved = match (self.success, result.first_success) {
            (Some(success), Some(rollout)) => format!(
                "first {success} at rollout {rollout}, {:.0} % of the last 20 succeed{}",
                100.0 * result.success_last20,
                self.means()
            ),
            (Some(success), None) => format!("no {success} yet"),
            _ if self.modes.len() == 1 => "one solution found".into(),
            _ => format!("{} solutions found", self.modes.len()),
        };
        let mut text = format!(
            "{}, seed {}: {} rollouts, {achieved}\n\
             best reward {:.3} at rollout {}; {:.1} rollouts/s\n",
            self.task,
            self.seed,
            result.trials,
            result.best_reward,
            result.best_rollout.unwrap_or(0),
            self.rollouts_per_s,
        );
        if result.set_aside > 0 {
            text += &format!("{} rollouts set aside, not learnt from\n", result.set_aside);
        }
        if let Some(early) = early::sentence(&early::by_reason(&result.ended_early)) {
            text += &format!("{early}\n");
        }
        for (name, value) in self.notes().iter().skip(1) {
            text += &format!("{name}: {value}\n");
        }
        text +=
            &format!("session  {}\nreport   {}\n", self.folder.dir().display(), report.display());
        if self.interrupted {
            let dir = self.folder.dir().display();
            text +=
                &format!("stopped early; resume with: skillet learn {} --out {dir}\n", self.task);
        }
        text
    }

    /// Which of the last rollouts were no draws.
    fn means(&self) -> String {
        match (self.result.means_last20, self.result.mean_successes_last20) {
            (0, _) => String::new(),
            (n, successes) => format!(" ({n} executed the mean, {successes} succeeded)"),
        }
    }

    /// What the report shows beside the figures.
    pub fn notes(&self) -> Vec<(String, String)> {
        let us = |ns: u64| ns as f64 * 1e-3;
        let mut notes =
            vec![("rollouts per second".to_string(), format!("{:.1}", self.rollouts_per_s))];
        if let Some(status) = self.status.filter(|status| status.is_paced()) {
            notes.push((
                "wake-up p50 / p99 / max".into(),
                format!(
                    "{:.1} / {:.1} / {:.1} µs",
                    us(status.wakeup_p50_ns),
                    us(status.wakeup_p99_ns),
                    us(status.wakeup_max_ns)
                ),
            ));
            notes.push(("deadlines missed".into(), status.deadline_misses.to_string()));
        }
        notes
    }
}
