//! What a session searches: θ ↔ policy, where the search starts and along which directions.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use shm_types::policy::PolicyMsg;

use crate::config::LearnerConfig;
use crate::demonstration::Demonstration;
use crate::encoding::{self, Encoding};
use crate::error::LearnerError;
use crate::exploration::{Column, ExplorationKind, directions};
use crate::parameters::PolicyIds;
use crate::prediction::Predictor;
#[cfg(feature = "session")]
use crate::store::Added;
use search::{Search, Space};

/// A configured search problem; the same for a session and for a study without one.
#[derive(Clone)]
pub struct Problem {
    policies: Policies,
    /// One for each demonstration, or that of the action.
    pub spaces: Vec<Space>,
    /// The rollouts after which each of them joined; 0 for those the session began with.
    joined: Vec<u64>,
}

/// How θ becomes a policy.
#[derive(Clone)]
enum Policies {
    /// θ encodes the policy of an arm with a demonstration.
    Arm(Arc<Encoding>),
    /// Sec. 4.2: θ is the action.
    Action,
}

impl Problem {
    /// Starts from the policies fitted to `demonstrations`, at least one.
    pub fn new(
        config: &LearnerConfig,
        demonstrations: &[Demonstration],
    ) -> Result<Problem, LearnerError> {
        let first = config.demonstrations_are.starts(demonstrations).next();
        let first = first.expect("at least one demonstration");
        Problem::around(&encoding::fit(&config.encoding(), first)?, config, demonstrations)
    }

    /// Starts from `initial`, the policy that was fitted to the first of `demonstrations`, and from
    /// those fitted to the others; or from an action when there is none.
    pub fn around(
        initial: &PolicyMsg,
        config: &LearnerConfig,
        demonstrations: &[Demonstration],
    ) -> Result<Problem, LearnerError> {
        if demonstrations.is_empty() {
            let spaces = vec![config.action.space()];
            return Ok(Problem { policies: Policies::Action, spaces, joined: vec![0] });
        }
        let encoding = Encoding::new(initial, config.encoding())?;
        let mut spaces = Vec::new();
        for shown in config.demonstrations_are.starts(demonstrations) {
            let start = if spaces.is_empty() { *initial } else { encoding.refit(shown)? };
            spaces.push(space(&start, &encoding, config, shown)?);
        }
        let joined = vec![0; spaces.len()];
        Ok(Problem { policies: Policies::Arm(Arc::new(encoding)), spaces, joined })
    }

    /// The same problem with the starts that were `added` to it since.
    #[cfg(feature = "session")]
    pub fn with_added(
        mut self,
        config: &LearnerConfig,
        added: &[Added],
    ) -> Result<Problem, LearnerError> {
        for Added { after, file, text, .. } in added {
            let misfit = |reason: String| LearnerError::Added { file: file.clone(), reason };
            let Policies::Arm(encoding) = &self.policies else {
                return Err(misfit("this task has no arm and takes no demonstration".into()));
            };
            let parsed = Demonstration::parse(file, text);
            let shown = [parsed.map_err(|error| misfit(error.to_string()))?];
            let found_s = shown[0].duration_s();
            let lasts_s = encoding.decode(&self.spaces[0].theta_0, PolicyIds::default()).duration_s;
            if (found_s - lasts_s).abs() > 1e-6 {
                return Err(misfit(format!(
                    "it lasts {found_s:.2} s, but policies of this session last {lasts_s:.2} s: \
                     give it the same duration"
                )));
            }
            let start = encoding.refit(&shown).map_err(|error| misfit(error.to_string()))?;
            self.spaces.push(space(&start, encoding, config, &shown)?);
            self.joined.push(*after);
        }
        Ok(self)
    }

    /// A start joins with the proposal of `rollout`.
    pub fn grows_at(&self, rollout: u64) -> bool {
        rollout > 1 && self.joined.iter().any(|after| after + 1 == rollout)
    }

    /// The newest start that was added came after this many rollouts; 0 if there is none.
    pub fn grew_after(&self) -> u64 {
        self.joined.last().copied().unwrap_or(0)
    }

    /// The same problem, where the task can compute some of its measures: from springs whose orientations are
    /// rotation vectors.
    pub fn with_prediction(self, config: &LearnerConfig, predictor: Option<Predictor>) -> Problem {
        let (Some(predictor), Policies::Arm(encoding)) = (predictor, &self.policies) else {
            return self;
        };
        if !encoding.drives_springs() || encoding.is_on_sphere() {
            return self;
        }
        let (targets, encoding) = (config.search.targets().to_vec(), Arc::clone(encoding));
        let decode = move |theta: &DVector<f64>| encoding.decode(theta, PolicyIds::default());
        let prediction = predictor.along(targets, decode);
        let with = |space| Space { prediction: Some(prediction.clone()), ..space };
        Problem { spaces: self.spaces.into_iter().map(with).collect(), ..self }
    }

    /// θ is where the session began: at one of its first demonstrations, or at the action.
    pub fn starts_at(&self, theta: &DVector<f64>) -> bool {
        let mut starts = self.spaces.iter().zip(&self.joined);
        starts.any(|(space, after)| *after == 0 && space.theta_0 == *theta)
    }

    /// The sealed policy of θ.
    pub fn decode(&self, theta: &DVector<f64>, ids: PolicyIds) -> PolicyMsg {
        let PolicyIds { session, rollout, policy_id } = ids;
        match &self.policies {
            Policies::Arm(encoding) => encoding.decode(theta, ids),
            Policies::Action => {
                let policy = PolicyMsg::of_action(theta.as_slice());
                PolicyMsg { session, rollout, policy_id, ..policy }.sealed()
            }
        }
    }

    /// The configured search, before its first trial.
    pub fn search(&self, config: &LearnerConfig) -> Box<dyn Search> {
        self.search_for(config, 1)
    }

    /// The one that proposes `rollout`, before it was told anything.
    pub fn search_for(&self, config: &LearnerConfig, rollout: u64) -> Box<dyn Search> {
        let starts = self.joined.iter().copied().zip(self.spaces.iter().cloned());
        let joined = starts.filter(|(after, _)| *after < rollout).collect();
        let mut search = config.search.clone();
        search.power.noise = search.power.noise.max(config.people.reward_noise());
        search::build_joined(&search, config.seed, joined)
    }
}

/// Where the search from what was `shown` begins, and along which directions it goes.
fn space(
    start: &PolicyMsg,
    encoding: &Encoding,
    config: &LearnerConfig,
    shown: &[Demonstration],
) -> Result<Space, LearnerError> {
    let theta_0 = encoding.encode(start)?;
    Ok(match config.exploration.kind {
        ExplorationKind::White => Space::white(theta_0),
        ExplorationKind::Demonstration => {
            let columns = directions(start, encoding, &config.exploration, shown)?;
            let bounds = encoding.near(start, config.exploration.attractor_reach_m);
            Space {
                directions: columns.iter().map(|(_, direction)| *direction).collect(),
                // It pays for springs alone.
                known: encoding
                    .springs(start)
                    .and_then(|(springs, map)| config.compliance.known(&springs, map)),
                bounds: Some(bounds),
                ..Space::along(theta_0, matrix(encoding.dim(), &columns))?
            }
        }
    })
}

fn matrix(dim: usize, columns: &[Column]) -> DMatrix<f64> {
    DMatrix::from_fn(dim, columns.len(), |row, column| columns[column].0[row])
}
