//! A search behind its checks, started from a point, along directions, or from demonstrations.

use std::sync::Mutex;

use learner::Demonstration;
use learner::config::LearnerConfig;
use learner::modes::assess;
use learner::parameters::PolicyIds;
use learner::problem::Problem;
use nalgebra::DMatrix;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use search::trial::Trial;
use search::{AskTell, Bounds, SearchConfig, SearchSnapshot, Space};
use serde::de::DeserializeOwned;
use serde_json::Value;
use shm_types::policy_json;

use crate::bytes::{packed, refused, vector};

/// What the methods share. A search is not `Sync`; the lock makes it one, and is never held while Python runs.
struct State {
    desk: AskTell,
    /// What the search was told, for the modes.
    told: Vec<Trial>,
}

#[pyclass(frozen)]
pub struct Core {
    state: Mutex<State>,
    /// θ ↔ policy, where the search begins from demonstrations.
    problem: Option<Problem>,
    settings: SearchConfig,
    dim: usize,
}

impl Core {
    fn of(desk: AskTell, problem: Option<Problem>, settings: SearchConfig) -> Core {
        let dim = desk.mean().len();
        Core { state: Mutex::new(State { desk, told: Vec::new() }), problem, settings, dim }
    }

    /// A panic of another thread has left nothing half done: a trial is learnt by the search before it is noted.
    fn state(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

#[pymethods]
impl Core {
    /// A search of `settings` (JSON of `[learner.search]`) around `start` (D), within [`low`, `high`] (D), along
    /// the columns of `directions` (D×k, by rows).
    #[staticmethod]
    #[pyo3(signature = (settings, seed, start, low=None, high=None, directions=None))]
    fn around(
        settings: &str,
        seed: u64,
        start: &[u8],
        low: Option<&[u8]>,
        high: Option<&[u8]>,
        directions: Option<&[u8]>,
    ) -> PyResult<Core> {
        let settings: SearchConfig = parsed(settings)?;
        settings.validate().map_err(refused)?;
        let theta_0 = vector(start)?;
        let dim = theta_0.len();
        if dim == 0 || theta_0.iter().any(|value| !value.is_finite()) {
            return Err(refused("start: give at least one number, all finite"));
        }
        let space = match directions {
            Some(bytes) => {
                let entries = vector(bytes)?;
                let columns = entries.len() / dim;
                let along = DMatrix::from_row_iterator(dim, columns, entries.iter().copied());
                Space::along(theta_0, along).map_err(refused)?
            }
            None => Space::white(theta_0),
        };
        let bounds = match (low, high) {
            (Some(low), Some(high)) => {
                let (low, high) = (vector(low)?, vector(high)?);
                Some(Bounds::new(dim, low.as_slice(), high.as_slice()).map_err(refused)?)
            }
            _ => None,
        };
        if bounds.as_ref().is_some_and(|bounds| !bounds.contains(&space.theta_0)) {
            return Err(refused("start: it lies outside the box"));
        }
        let desk = AskTell::new(search::build(&settings, seed, Space { bounds, ..space }));
        Ok(Core::of(desk, None, settings))
    }

    /// The search of a session with the settings `learner` (JSON of `[learner]`) from `demonstrations`: names
    /// and texts of CSV files.
    #[staticmethod]
    fn from_demonstrations(learner: &str, demonstrations: Vec<(String, String)>) -> PyResult<Core> {
        let config: LearnerConfig = parsed(learner)?;
        config.validate().map_err(refused)?;
        let parse = |(name, text): &(String, String)| Demonstration::parse(name, text);
        let demonstrations =
            demonstrations.iter().map(parse).collect::<Result<Vec<_>, _>>().map_err(refused)?;
        if demonstrations.is_empty() {
            return Err(refused("demonstrations: give at least one file"));
        }
        let problem = Problem::new(&config, &demonstrations).map_err(refused)?;
        let desk = AskTell::new(problem.search(&config));
        Ok(Core::of(desk, Some(problem), config.search))
    }

    #[getter]
    fn dim(&self) -> usize {
        self.dim
    }

    /// All settings, those that were not given too: JSON.
    #[getter]
    fn settings(&self) -> PyResult<String> {
        serde_json::to_string(&self.settings).map_err(refused)
    }

    /// Measures the search wants told, in its order, each with the truth value without which there is none.
    #[getter]
    fn targets(&self) -> Vec<(String, Option<String>)> {
        let targets = self.settings.targets().iter();
        targets.map(|target| (target.measure.clone(), target.when.clone())).collect()
    }

    fn ask<'py>(&self, py: Python<'py>, rollout: u64) -> PyResult<Bound<'py, PyBytes>> {
        if rollout == 0 {
            return Err(refused("rollouts are counted from 1"));
        }
        let proposal = py.detach(|| self.state().desk.ask(rollout));
        Ok(packed(py, proposal.theta.iter()))
    }

    fn tell(
        &self,
        py: Python<'_>,
        rollout: u64,
        theta: &[u8],
        reward: f64,
        success: bool,
        measured: Vec<Option<f64>>,
    ) -> PyResult<()> {
        let trial = Trial { rollout, theta: vector(theta)?, reward, success, measured };
        let told = py.detach(|| {
            let mut state = self.state();
            state.desk.tell(&trial)?;
            state.told.push(trial);
            Ok::<(), search::TellError>(())
        });
        told.map_err(refused)
    }

    /// Gives up a rollout that gave no reward, so that no later one reckons with it.
    fn withdraw(&self, py: Python<'_>, rollout: u64) {
        py.detach(|| {
            self.state().desk.withdraw(rollout);
        });
    }

    fn mean<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let mean = self.state().desk.mean().clone();
        packed(py, mean.iter())
    }

    /// Mean, standard deviations and floor of the distribution `rollout` is drawn from.
    fn snapshot<'py>(
        &self,
        py: Python<'py>,
        rollout: u64,
    ) -> (Bound<'py, PyBytes>, Bound<'py, PyBytes>, f64) {
        let SearchSnapshot { mean, std, floor } = py.detach(|| self.state().desk.snapshot(rollout));
        (packed(py, mean.iter()), packed(py, std.iter()), floor)
    }

    /// What the search has found, judged by the trials it was told.
    fn modes<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let reports = py.detach(|| {
            let state = self.state();
            assess(&state.desk.modes(), &state.told, &[])
        });
        let table = |report: &learner::modes::ModeReport| {
            let row = PyDict::new(py);
            row.set_item("prior", report.mode.prior)?;
            row.set_item("mean", packed(py, report.mode.mean.iter()))?;
            row.set_item("covariance", packed(py, report.mode.covariance.iter()))?;
            row.set_item("n_trials", report.n_trials)?;
            row.set_item("best_rollout", report.best.map(|(rollout, _)| rollout))?;
            row.set_item("best_reward", report.best.map(|(_, reward)| reward))?;
            row.set_item("tolerance", report.tolerance)?;
            Ok(row)
        };
        reports.iter().map(table).collect()
    }

    /// The policy of θ as JSON, where the search began from demonstrations.
    fn decode(&self, theta: &[u8]) -> PyResult<String> {
        let Some(problem) = &self.problem else {
            return Err(refused(
                "this search began at a point: only one from demonstrations makes policies",
            ));
        };
        let theta = vector(theta)?;
        if theta.len() != self.dim || theta.iter().any(|value| !value.is_finite()) {
            return Err(refused(format!("theta: give {} finite numbers", self.dim)));
        }
        let policy = problem.decode(&theta, PolicyIds::default());
        policy_json::to_json(&policy).map_err(refused)
    }
}

/// Settings in two steps: an error then says what stands there, not at which byte of a text nobody wrote.
fn parsed<T: DeserializeOwned>(text: &str) -> PyResult<T> {
    let value: Value = serde_json::from_str(text).map_err(refused)?;
    serde_json::from_value(value).map_err(refused)
}
