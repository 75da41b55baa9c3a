//! Eqs. (5) and (2) as the loop evaluates them, over many states at once.

use nalgebra::{DMatrix, Matrix6, Vector6};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rt_controller::hot::policy::Policy;
use rt_controller::hot::task_space::TaskState;
use shm_types::TASK_DIM;
use shm_types::policy::{OUTPUT_VELOCITY, PolicyMsg};
use shm_types::policy_json;

use crate::bytes::{floats, packed, refused};

/// A policy of springs, of systems, or an action.
#[pyclass(frozen)]
pub struct Springs {
    message: PolicyMsg,
    policy: Policy,
}

/// Accelerations (n×6), attractors (n×6), stiffnesses (n×6×6), activations (n×N).
type Evaluated<'py> =
    (Bound<'py, PyBytes>, Bound<'py, PyBytes>, Bound<'py, PyBytes>, Bound<'py, PyBytes>);

#[pymethods]
impl Springs {
    /// A policy from its JSON, checked.
    #[new]
    fn new(text: &str) -> PyResult<Springs> {
        let message = policy_json::from_json(text).map_err(refused)?;
        for (number, component) in message.components().iter().enumerate() {
            let d = message.task_dim as usize;
            let K = DMatrix::from_fn(d, d, |row, column| component.stiffness_at(row, column));
            if K.cholesky().is_none() {
                return Err(refused(format!(
                    "component {number}: stiffness must be positive definite"
                )));
            }
        }
        for (number, system) in message.systems().iter().enumerate() {
            let n = message.drive_dim();
            let sigma = DMatrix::from_fn(n, n, |row, column| system.covariance_at(row, column));
            if sigma.cholesky().is_none() {
                return Err(refused(format!(
                    "system {number}: covariance must be positive definite"
                )));
            }
        }
        Ok(Springs { message, policy: Policy::new(&message) })
    }

    /// The policy's JSON, as `skillet policy export` prints it.
    fn json(&self) -> PyResult<String> {
        policy_json::to_json(&self.message).map_err(refused)
    }

    #[getter]
    fn digest(&self) -> u64 {
        self.message.digest
    }

    /// Eq. (5), or Eq. (2) of systems, at times `t` (n), positions `x` (n×6) and velocities `xd` (n×6).
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        t: &[u8],
        x: &[u8],
        xd: &[u8],
    ) -> PyResult<Evaluated<'py>> {
        let (t, x, xd) = (floats(t)?, floats(x)?, floats(xd)?);
        let n = t.len();
        if x.len() != n * TASK_DIM || xd.len() != n * TASK_DIM {
            return Err(refused("x and xd: give six numbers for each time"));
        }
        if self.message.n_actions > 0 {
            return Err(refused("the policy is an action vector: it has nothing to evaluate"));
        }
        let (mut xdd, mut attractor, mut K, mut h) = (vec![], vec![], vec![], vec![]);
        for ((t, x), xd) in t.iter().zip(x.chunks_exact(TASK_DIM)).zip(xd.chunks_exact(TASK_DIM)) {
            let task = TaskState::at(Vector6::from_column_slice(x), Vector6::from_column_slice(xd));
            let command = self.policy.command(*t, &task);
            let activations = self.policy.activations(*t, &task);
            let n = self.message.components().len() + self.message.systems().len();
            let activations = &activations[..n];
            xdd.extend(command.xdd.iter().copied());
            attractor.extend(command.attractor.iter().copied());
            // By rows: systems need not be symmetric.
            K.extend(self.stiffness(activations).transpose().iter().copied());
            h.extend_from_slice(activations);
        }
        Ok((packed(py, &xdd), packed(py, &attractor), packed(py, &K), packed(py, &h)))
    }
}

impl Springs {
    /// Σ hᵢ Kᵢ, of systems −∂ẍ/∂x where the hᵢ stay what they are, and the orientation's own gain on what is
    /// not learnt, s⁻².
    fn stiffness(&self, activations: &[f64]) -> Matrix6<f64> {
        let (d, message) = (self.message.task_dim as usize, &self.message);
        let following = if message.output == OUTPUT_VELOCITY { message.following } else { 1.0 };
        let learnt = |row: usize, column: usize| -> f64 {
            let springs = message.components().iter().map(|one| one.stiffness_at(row, column));
            let systems =
                message.systems().iter().map(|one| -following * one.of_position_at(row, column));
            activations.iter().zip(springs.chain(systems)).map(|(h, k)| h * k).sum()
        };
        let of = |row: usize, column: usize| match (row < d && column < d, row == column) {
            (true, _) => learnt(row, column),
            (false, true) => self.message.orientation_stiffness,
            (false, false) => 0.0,
        };
        Matrix6::from_fn(of)
    }
}
