//! Progress of a cell's learning for its metrics, from the learner's messages.

use std::time::{Duration, Instant};

use shm_types::cell::Cell;
use shm_types::measures::Measures;
use shm_types::ports::ObserverPorts;

use crate::watch::session::WatchedSession;

const SOON: Duration = Duration::from_millis(20);

pub struct Learning {
    cell: Cell,
    ports: Option<ObserverPorts>,
    session: WatchedSession,
    ticked: Option<Instant>,
}

impl Learning {
    pub fn of(cell: &Cell) -> Learning {
        Learning {
            cell: cell.clone(),
            ports: None,
            session: WatchedSession::default(),
            ticked: None,
        }
    }

    /// Reads the messages since the last call. Missed ones are resent later.
    pub fn listen(&mut self) {
        // Services that were made anew have other ports.
        self.ports = self.ports.take().filter(ObserverPorts::is_current);
        self.ports = self.ports.take().or_else(|| ObserverPorts::open(&self.cell, SOON).ok());
        let Some(ports) = &self.ports else { return };
        while let Ok(Some(news)) = ports.trials.receive() {
            self.session.take(&news);
        }
        while let Ok(Some(news)) = ports.measures.receive() {
            self.session.measured(&news);
        }
        while let Ok(Some(_)) = ports.telemetry.receive() {
            self.ticked = Some(Instant::now());
        }
    }

    /// Name, help and age of what else is told; none of what was never heard.
    pub fn ages(&self) -> impl Iterator<Item = (&'static str, &'static str, Duration)> {
        let tick = self.ticked.map(|at| ("tick_age", "Since the newest tick", at.elapsed()));
        let trial = self.session.trial_age().map(|age| ("trial_age", "Since the last trial", age));
        tick.into_iter().chain(trial)
    }

    /// Measures of the newest trial.
    pub fn measures(&self) -> Option<&Measures> {
        self.session.measures.as_ref()
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
                "Share of successes in the last 20 draws around the search's mean",
                self.session.success_last20(),
            ),
            ("modes", "Modes of the search", self.session.modes.len() as f64),
        ]
    }
}
