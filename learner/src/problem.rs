//! What a session searches: θ ↔ policy, where the search starts and along which directions.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use shm_types::policy::PolicyMsg;

use crate::config::LearnerConfig;
use crate::demonstration::Demonstration;
use crate::error::LearnerError;
use crate::exploration::{Column, ExplorationKind, directions};
use crate::initial_policy::initial_policy;
use crate::parameters::{ParameterMap, PolicyIds};
use crate::prediction::Predictor;
#[cfg(feature = "session")]
use crate::store::Added;
use search::{Search, Space};

/// A configured search problem; the same for a session and for a study without one.
#[derive(Clone)]
pub struct Problem {
    encoding: Encoding,
    /// One for each demonstration, or that of the action.
    pub spaces: Vec<Space>,
    /// The rollouts after which each of them joined; 0 for those the session began with.
    joined: Vec<u64>,
}

/// How θ becomes a policy.
#[derive(Clone)]
enum Encoding {
    /// Eq. (5): attractors and stiffnesses, scaled.
    Springs(Arc<ParameterMap>),
    /// Sec. 4.2: θ is the action.
    Action,
}

impl Problem {
    /// Starts from the policies fitted to `demonstrations`, at least one.
    pub fn new(
        config: &LearnerConfig,
        demonstrations: &[Demonstration],
    ) -> Result<Problem, LearnerError> {
        let initial = initial_policy(&demonstrations[0], &config.initial_policy());
        Problem::around(&initial, config, demonstrations)
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
            return Ok(Problem { encoding: Encoding::Action, spaces, joined: vec![0] });
        }
        let map = ParameterMap::new(initial, config.scales)?;
        let mut spaces = Vec::new();
        for demonstration in demonstrations {
            let start = if spaces.is_empty() {
                *initial
            } else {
                initial_policy(demonstration, &config.initial_policy())
            };
            spaces.push(space(&start, &map, config, demonstration)?);
        }
        let joined = vec![0; spaces.len()];
        Ok(Problem { encoding: Encoding::Springs(Arc::new(map)), spaces, joined })
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
            let Encoding::Springs(map) = &self.encoding else {
                return Err(misfit("this task has no arm that could be shown a movement".into()));
            };
            let parsed = Demonstration::parse(file, text);
            let demonstration = parsed.map_err(|error| misfit(error.to_string()))?;
            let start = initial_policy(&demonstration, &config.initial_policy());
            let lasts_s = map.decode(&self.spaces[0].theta_0, PolicyIds::default()).duration_s;
            if (start.duration_s - lasts_s).abs() > 1e-6 {
                return Err(misfit(format!(
                    "it lasts {:.2} s, and the policies of this session {lasts_s:.2} s: make it \
                     as long, they share their clock",
                    start.duration_s
                )));
            }
            self.spaces.push(space(&start, map, config, &demonstration)?);
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

    /// The same problem, where the task can compute some of its measures.
    pub fn with_prediction(self, config: &LearnerConfig, predictor: Option<Predictor>) -> Problem {
        let (Some(predictor), Encoding::Springs(map)) = (predictor, &self.encoding) else {
            return self;
        };
        let (targets, map) = (config.search.targets().to_vec(), Arc::clone(map));
        let decode = move |theta: &DVector<f64>| map.decode(theta, PolicyIds::default());
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
        match &self.encoding {
            Encoding::Springs(map) => map.decode(theta, ids),
            Encoding::Action => {
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
        search::build_joined(&config.search, config.seed, joined)
    }
}

/// Where the search from one demonstration begins, and along which directions it goes.
fn space(
    start: &PolicyMsg,
    map: &ParameterMap,
    config: &LearnerConfig,
    demonstration: &Demonstration,
) -> Result<Space, LearnerError> {
    let theta_0 = map.encode(start)?;
    Ok(match config.exploration.kind {
        ExplorationKind::White => Space::white(theta_0),
        ExplorationKind::Demonstration => {
            let columns = directions(
                start,
                map,
                &config.exploration,
                &config.initial_policy(),
                demonstration,
            )?;
            let bounds = map.near(start, config.exploration.attractor_reach_m);
            Space {
                directions: columns.iter().map(|(_, direction)| *direction).collect(),
                known: config.compliance.known(start, map),
                bounds: Some(bounds),
                ..Space::along(theta_0, matrix(map.dim(), &columns))?
            }
        }
    })
}

fn matrix(dim: usize, columns: &[Column]) -> DMatrix<f64> {
    DMatrix::from_fn(dim, columns.len(), |row, column| columns[column].0[row])
}
