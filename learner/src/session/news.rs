//! What observers are told: every trial, and now and then what the search has found.

use shm_types::SCHEMA;
use shm_types::news::{
    MAX_MODES, MeasuresNews, ModeNews, TOLERANCE_UNKNOWN, TRIAL_HISTORY, TRIAL_MEAN,
    TRIAL_SET_ASIDE, TRIAL_SUCCESS, TRIAL_UNDER_WISH, TrialNews,
};
use shm_types::ports::LearnerPorts;

use super::Event;
use crate::learner::Learner;
use crate::modes::ModeReport;
use crate::store::TrialRecord;

/// Trials between two looks at the modes, and after how many more trials one is as dear as another ten trials: judging
/// them takes longer than a trial of a fast task, and the longer the more trials there are.
const MODES_EVERY: usize = 10;
const DEARER: usize = 200;

/// What was last told of the modes.
#[derive(Default)]
pub struct News {
    modes: Vec<ModeNews>,
}

impl News {
    /// Tells all trials again: to the services of a new controller, or of a learner that resumes.
    pub fn all(&mut self, ports: &LearnerPorts, learner: &Learner) {
        let trials = learner.trials();
        for trial in &trials[trials.len().saturating_sub(TRIAL_HISTORY)..] {
            self.send(ports, learner, trial);
        }
    }

    /// Tells the newest trial in all cells.
    pub fn trial(
        &mut self,
        cells: &[&LearnerPorts],
        learner: &Learner,
        on_event: &mut dyn FnMut(Event<'_>),
    ) {
        let Some(newest) = learner.trials().last() else { return };
        let n = learner.trials().len();
        let every = MODES_EVERY * (n / DEARER + 1).min(MODES_EVERY);
        if n.is_multiple_of(every) || learner.is_done() {
            // What cannot be judged is told again later; nothing depends on it.
            let reports = learner.mode_reports().unwrap_or_default();
            self.modes = reports.iter().take(MAX_MODES).map(news_of_mode).collect();
            on_event(Event::Modes(&reports));
        }
        for ports in cells {
            self.send(ports, learner, newest);
            News::measures(ports, learner, newest);
        }
    }

    /// Tells trials again that count for something else than before.
    pub fn again(&self, ports: &LearnerPorts, learner: &Learner, rollouts: &[u64]) {
        for trial in learner.trials().iter().filter(|trial| rollouts.contains(&trial.rollout)) {
            self.send(ports, learner, trial);
        }
    }

    fn send(&self, ports: &LearnerPorts, learner: &Learner, trial: &TrialRecord) {
        let mut modes = [ModeNews::ZERO; MAX_MODES];
        modes[..self.modes.len()].copy_from_slice(&self.modes);
        let flag = |bit, is_set| if is_set { bit } else { 0 };
        let news = TrialNews {
            schema: SCHEMA,
            session: learner.session_id(),
            rollout: trial.rollout,
            rollouts: learner.rollouts(),
            policy_digest: trial.policy_digest,
            fault: trial.fault,
            flags: flag(TRIAL_SUCCESS, trial.success)
                | flag(TRIAL_SET_ASIDE, trial.set_aside)
                | flag(TRIAL_MEAN, trial.is_mean)
                | flag(TRIAL_UNDER_WISH, learner.is_under_wish(trial.rollout)),
            reward: trial.reward,
            n_modes: self.modes.len() as u64,
            modes,
        };
        // Nobody listening is no failure.
        let _ = ports.trials.send_copy(news);
    }

    /// Tells what was measured of the newest trial.
    fn measures(ports: &LearnerPorts, learner: &Learner, trial: &TrialRecord) {
        let _ = ports.measures.send_copy(MeasuresNews {
            schema: SCHEMA,
            session: learner.session_id(),
            rollout: trial.rollout,
            policy_digest: trial.policy_digest,
            measures: trial.measures,
        });
    }
}

fn news_of_mode(report: &ModeReport) -> ModeNews {
    let (best_rollout, best_reward) = report.best.unwrap_or((0, 0.0));
    ModeNews {
        prior: report.mode.prior,
        n_trials: report.n_trials as u64,
        best_rollout,
        best_reward,
        tolerance: report.tolerance.unwrap_or(TOLERANCE_UNKNOWN),
        forbidden: u64::from(report.forbidden),
    }
}
