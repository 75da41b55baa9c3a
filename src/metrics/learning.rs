//! How the learning of a cell goes, for its metrics: what a learner tells everybody.

use std::time::Duration;

use shm_types::cell::Cell;
use shm_types::ports::ObserverPorts;

use crate::watch::session::WatchedSession;

const SOON: Duration = Duration::from_millis(20);

pub struct Learning {
    cell: Cell,
    ports: Option<ObserverPorts>,
    session: WatchedSession,
}

impl Learning {
    pub fn of(cell: &Cell) -> Learning {
        Learning { cell: cell.clone(), ports: None, session: WatchedSession::default() }
    }

    /// Takes what was told since the last time. What cannot be heard now is told again later.
    pub fn listen(&mut self) {
        // Services that were made anew have other ports.
        self.ports = self.ports.take().filter(ObserverPorts::is_current);
        self.ports = self.ports.take().or_else(|| ObserverPorts::open(&self.cell, SOON).ok());
        let Some(ports) = &self.ports else { return };
        while let Ok(Some(news)) = ports.trials.receive() {
            self.session.take(&news);
        }
    }

    /// Name, help and value; none before the first trial.
    pub fn gauges(&self) -> Vec<(&'static str, &'static str, f64)> {
        let (Some(last), Some((_, best))) = (self.session.trials.back(), self.session.best())
        else {
            return Vec::new();
        };
        vec![
            ("session_trials", "Trials of the session so far", last.rollout as f64),
            ("session_rollouts", "Trials the session is to have", self.session.rollouts as f64),
            ("reward", "Reward of the last trial", last.reward),
            ("best_reward", "Best reward of the session", best),
            (
                "success_ratio",
                "Share of successes in the last 20 trials",
                self.session.success_last20(),
            ),
            ("modes", "Modes of the search", self.session.modes.len() as f64),
        ]
    }
}
