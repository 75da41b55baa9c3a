//! What controllers and learners tell, as messages of a recording.

use learner::modes::ModeReport;
use learner::summary::TrialReport;
use shm_types::episode::EpisodeHeader;
use shm_types::measures;
use shm_types::news::{MeasuresNews, TRIAL_SET_ASIDE, TRIAL_SUCCESS, TrialNews};
use shm_types::policy::{LinearSystem, PolicyMsg};

use super::messages::{Measure, Measures, Mixture, Mode, Outcome, Policy, Spring, System, Trial};

impl From<&PolicyMsg> for Policy {
    fn from(message: &PolicyMsg) -> Policy {
        let d = message.task_dim as usize;
        let springs = message.components().iter().map(|component| Spring {
            center: component.center,
            width: component.width,
            attractor_m_rad: component.attractor.to_vec(),
            stiffness_per_s2: component.stiffness[..d * (d + 1) / 2].to_vec(),
        });
        let systems = message.systems().iter();
        let target = if message.n_systems > 0 { message.target.to_vec() } else { Vec::new() };
        Policy {
            digest: message.digest,
            session: message.session,
            rollout: message.rollout,
            policy_id: message.policy_id,
            task_dim: message.task_dim,
            duration_s: message.duration_s,
            decay_per_s: message.decay_rate,
            damping_per_s: message.damping,
            springs: springs.collect(),
            action: message.action[..message.n_actions as usize].to_vec(),
            damping_ratio: message.damping_ratio,
            systems: systems.map(|one| System::of(one, d, message.drive_dim())).collect(),
            activation: message.activation,
            output: message.output,
            following_per_s: message.following,
            orientation: message.orientation,
            target_m_rad: target,
        }
    }
}

impl System {
    /// The message of a system with `d` learnt coordinates and a drive of `drive_dim`.
    fn of(system: &LinearSystem, d: usize, drive_dim: usize) -> System {
        let block =
            |entry: &dyn Fn(usize, usize) -> f64| (0..d * d).map(|k| entry(k / d, k % d)).collect();
        System {
            log_prior: system.log_prior,
            center: system.center[..drive_dim].to_vec(),
            covariance: system.covariance[..drive_dim * (drive_dim + 1) / 2].to_vec(),
            of_position: block(&|row, column| system.of_position_at(row, column)),
            of_velocity: block(&|row, column| system.of_velocity_at(row, column)),
            of_drive: system.of_drive[..d].to_vec(),
            offset: system.offset[..d].to_vec(),
        }
    }
}

impl From<&EpisodeHeader> for Outcome {
    fn from(header: &EpisodeHeader) -> Outcome {
        Outcome {
            session: header.session,
            rollout: header.rollout,
            policy_digest: header.policy_digest,
            applied_tick: header.applied_tick,
            n_records: header.n_records,
            fault: header.fault,
        }
    }
}

impl Measures {
    /// The measures of the rollout of `trial`.
    pub fn of(trial: &Trial, measures: &measures::Measures) -> Measures {
        Measures {
            session: trial.session,
            rollout: trial.rollout,
            policy_digest: trial.policy_digest,
            measures: by_name(measures),
        }
    }
}

impl From<&MeasuresNews> for Measures {
    fn from(news: &MeasuresNews) -> Measures {
        Measures {
            session: news.session,
            rollout: news.rollout,
            policy_digest: news.policy_digest,
            measures: by_name(&news.measures),
        }
    }
}

fn by_name(measures: &measures::Measures) -> Vec<Measure> {
    let named = measures.iter().map(|measure| Measure {
        name: measure.name.into(),
        unit: measure.unit.into(),
        value: measure.value,
    });
    named.collect()
}

impl From<&[ModeReport]> for Mixture {
    fn from(reports: &[ModeReport]) -> Mixture {
        let modes = reports.iter().map(|report| Mode {
            number: report.number as u32,
            prior: report.mode.prior,
            n_trials: report.n_trials as u64,
            best_rollout: report.best.map_or(0, |(rollout, _)| rollout),
            best_reward: report.best.map_or(0.0, |(_, reward)| reward),
            tolerance: report.tolerance,
            forbidden: report.forbidden,
            mean: report.mode.mean.as_slice().to_vec(),
            covariance: report.mode.covariance.as_slice().to_vec(),
        });
        Mixture { modes: modes.collect() }
    }
}

impl Mixture {
    /// As much as an observer is told.
    pub fn of_news(news: &TrialNews) -> Option<Mixture> {
        let modes = news.validate().ok().filter(|modes| !modes.is_empty())?;
        let modes = modes.iter().enumerate().map(|(i, mode)| Mode {
            number: i as u32 + 1,
            prior: mode.prior,
            n_trials: mode.n_trials,
            best_rollout: mode.best_rollout,
            best_reward: mode.best_reward,
            tolerance: mode.tolerance(),
            forbidden: mode.forbidden != 0,
            mean: Vec::new(),
            covariance: Vec::new(),
        });
        Some(Mixture { modes: modes.collect() })
    }
}

impl From<&TrialNews> for Trial {
    fn from(news: &TrialNews) -> Trial {
        Trial {
            session: news.session,
            rollout: news.rollout,
            policy_digest: news.policy_digest,
            reward: news.reward,
            success: news.has(TRIAL_SUCCESS),
            set_aside: news.has(TRIAL_SET_ASIDE),
            fault: news.fault,
        }
    }
}

impl Trial {
    /// The message of a trial as the learner reports it.
    pub fn new(session: u64, policy_digest: u64, report: &TrialReport) -> Trial {
        Trial {
            session,
            rollout: report.rollout,
            policy_digest,
            reward: report.reward,
            success: report.success,
            set_aside: report.set_aside,
            fault: report.fault,
        }
    }
}
