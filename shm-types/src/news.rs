//! What a learner tells observers: its trials and what the search has found.

#[cfg(feature = "transport")]
use iceoryx2::prelude::ZeroCopySend;
use thiserror::Error;

use crate::SCHEMA;
use crate::measures::{Measures, MeasuresError};

/// Trials that an observer gets when it comes.
pub const TRIAL_HISTORY: usize = 128;
/// Modes in one message: those with the largest priors.
pub const MAX_MODES: usize = 8;
/// No reward: those may be negative.
pub const TOLERANCE_UNKNOWN: f64 = f64::MIN;

/// Bits of [`TrialNews::flags`].
pub const TRIAL_SUCCESS: u64 = 1;
pub const TRIAL_SET_ASIDE: u64 = 2;
/// The mean of the search was executed, not a draw around it.
pub const TRIAL_MEAN: u64 = 4;
/// Its success had to be as the session was wished to go on.
pub const TRIAL_UNDER_WISH: u64 = 8;

message! {
    /// One mode of the search, in the order of falling priors.
    pub struct ModeNews as "skillet/ModeNews/1" {
        pub prior: f64,
        pub n_trials: u64,
        /// Best of its trials; rollout 0 when it has none.
        pub best_rollout: u64,
        pub best_reward: f64,
        /// Expected reward under noise; [`TOLERANCE_UNKNOWN`] where nothing is known.
        pub tolerance: f64,
        /// 1: it must not be used.
        pub forbidden: u64,
    }
}

message! {
    /// A trial that is durable.
    pub struct TrialNews as "skillet/TrialNews/1" {
        pub schema: u64,
        pub session: u64,
        pub rollout: u64,
        /// Rollouts the session is to have.
        pub rollouts: u64,
        pub policy_digest: u64,
        /// First fault of the rollout, or 0.
        pub fault: u64,
        /// `TRIAL_*`.
        pub flags: u64,
        pub reward: f64,
        /// Modes in use; they are told now and then, not with every trial.
        pub n_modes: u64,
        pub modes: [ModeNews; MAX_MODES],
    }
}

message! {
    /// What was measured of a trial that is durable.
    pub struct MeasuresNews as "skillet/MeasuresNews/1" {
        pub schema: u64,
        pub session: u64,
        pub rollout: u64,
        pub policy_digest: u64,
        pub measures: Measures,
    }
}

/// Why news were not believed.
#[derive(Debug, Error, PartialEq)]
pub enum NewsError {
    #[error("schema {found:#x} instead of {SCHEMA:#x}: learner and observer are different builds")]
    Schema { found: u64 },
    #[error("n_modes is {0}: at most {MAX_MODES} fit")]
    Modes(u64),
    #[error("{field} of rollout {rollout} is not finite")]
    NotFinite { field: &'static str, rollout: u64 },
    #[error("rollout {rollout}: {error}")]
    Measures { rollout: u64, error: MeasuresError },
}

impl ModeNews {
    pub const ZERO: ModeNews = ModeNews {
        prior: 0.0,
        n_trials: 0,
        best_rollout: 0,
        best_reward: 0.0,
        tolerance: TOLERANCE_UNKNOWN,
        forbidden: 0,
    };

    /// Expected reward under noise, where it is known.
    pub fn tolerance(&self) -> Option<f64> {
        (self.tolerance != TOLERANCE_UNKNOWN).then_some(self.tolerance)
    }

    fn is_finite(&self) -> bool {
        [self.prior, self.best_reward, self.tolerance].iter().all(|value| value.is_finite())
    }
}

impl MeasuresNews {
    /// Checks everything.
    pub fn validate(&self) -> Result<(), NewsError> {
        if self.schema != SCHEMA {
            return Err(NewsError::Schema { found: self.schema });
        }
        let rollout = self.rollout;
        self.measures.validate().map_err(|error| NewsError::Measures { rollout, error })
    }
}

impl TrialNews {
    pub fn has(&self, flag: u64) -> bool {
        self.flags & flag != 0
    }

    /// Checks everything, and returns the modes in use.
    pub fn validate(&self) -> Result<&[ModeNews], NewsError> {
        let rollout = self.rollout;
        if self.schema != SCHEMA {
            return Err(NewsError::Schema { found: self.schema });
        }
        if !self.reward.is_finite() {
            return Err(NewsError::NotFinite { field: "reward", rollout });
        }
        let modes = usize::try_from(self.n_modes).ok().and_then(|n| self.modes.get(..n));
        let modes = modes.ok_or(NewsError::Modes(self.n_modes))?;
        if modes.iter().all(ModeNews::is_finite) {
            Ok(modes)
        } else {
            Err(NewsError::NotFinite { field: "modes", rollout })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refuses_what_an_observer_must_not_show() {
        let news = TrialNews {
            schema: SCHEMA,
            session: 1,
            rollout: 2,
            rollouts: 100,
            policy_digest: 3,
            fault: 0,
            flags: TRIAL_SUCCESS,
            reward: 0.5,
            n_modes: 1,
            modes: [ModeNews::ZERO; MAX_MODES],
        };
        assert_eq!(news.validate().map(<[_]>::len), Ok(1));
        assert!(news.has(TRIAL_SUCCESS) && !news.has(TRIAL_SET_ASIDE));
        let many = TrialNews { n_modes: 9, ..news };
        assert_eq!(many.validate(), Err(NewsError::Modes(9)));
        let foreign = TrialNews { schema: 1, ..news };
        assert_eq!(foreign.validate(), Err(NewsError::Schema { found: 1 }));
        let mut unmeasured = news;
        unmeasured.modes[0].tolerance = f64::NAN;
        let error = NewsError::NotFinite { field: "modes", rollout: 2 };
        assert_eq!(unmeasured.validate(), Err(error));
    }
}
