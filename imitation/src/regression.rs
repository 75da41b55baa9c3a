//! Gaussian mixture regression: what a mixture over inputs and outputs says of the outputs.

use nalgebra::{DMatrix, DVector};
use thiserror::Error;

use crate::gmm::{self, GmmError, GmmOptions};
use crate::integrate::first_order;
use crate::mixture::Mixture;
use crate::recording::{Recording, RecordingError, check_set};
use crate::systems::Systems;

/// What a movement is read as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Map {
    /// t → x.
    TimeToPosition,
    /// t → ẋ.
    TimeToVelocity,
    /// x → ẋ.
    PositionToVelocity,
}

/// The conditional p(output | input) of a Gaussian mixture over both.
#[derive(Clone, Debug, PartialEq)]
pub struct Regression {
    /// Eq. (2) with ξʷ = ξᵀ = the input: the conditional expectation.
    pub systems: Systems,
    /// Covariance of the output under component i for a given input (dᵒ×dᵒ).
    pub covariances: Vec<DMatrix<f64>>,
}

/// Why a regression cannot be made.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum RegressionError {
    #[error(transparent)]
    Recordings(#[from] RecordingError),
    #[error(transparent)]
    Mixture(#[from] GmmError),
    #[error(
        "{n_inputs} inputs of {dim} coordinates: there must be one input and one output at least"
    )]
    Inputs { n_inputs: usize, dim: usize },
}

impl Regression {
    /// Splits a mixture over [input; output] with `n_inputs` input coordinates, which come first:
    ///
    /// Aᵢ = Σᵢᵒᴵ(Σᵢᴵ)⁻¹,  bᵢ = μᵢᵒ − Aᵢ μᵢᴵ,  Cov = Σᵢᵒ − Aᵢ Σᵢᴵᵒ
    ///
    /// (Ghahramani and Jordan 1994; ref. 16 of the paper).
    pub fn new(joint: &Mixture, n_inputs: usize) -> Result<Regression, RegressionError> {
        let dim = joint.dim();
        if n_inputs == 0 || n_inputs >= dim {
            return Err(RegressionError::Inputs { n_inputs, dim });
        }
        let (inputs, outputs) = ((0, n_inputs), (n_inputs, dim - n_inputs));
        let block = |S: &DMatrix<f64>, rows: (usize, usize), columns: (usize, usize)| {
            S.view((rows.0, columns.0), (rows.1, columns.1)).clone_owned()
        };
        let mut systems = Systems {
            priors: joint.priors.clone(),
            centers: joint.means.iter().map(|mean| mean.rows(0, n_inputs).clone_owned()).collect(),
            covariances: Vec::new(),
            A: Vec::new(),
            b: Vec::new(),
        };
        let mut covariances = Vec::new();
        for (mean, covariance) in joint.means.iter().zip(&joint.covariances) {
            let S_I = block(covariance, inputs, inputs);
            let S_IO = block(covariance, inputs, outputs);
            let factor = S_I.clone().cholesky().expect("a block of a covariance is one");
            let A = factor.solve(&S_IO).transpose();
            let conditional = block(covariance, outputs, outputs) - &A * &S_IO;
            covariances.push((&conditional + conditional.transpose()) / 2.0);
            systems.b.push(mean.rows(n_inputs, dim - n_inputs) - &A * mean.rows(0, n_inputs));
            systems.A.push(A);
            systems.covariances.push(S_I);
        }
        Ok(Regression { systems, covariances })
    }

    /// Fits a mixture of `k` components to the recordings read as `map`, and splits it.
    ///
    /// Driven by time, the recordings are taken to share a clock: align them first if they do not.
    pub fn fit(
        recordings: &[Recording],
        map: Map,
        k: usize,
        options: &GmmOptions,
        seed: u64,
    ) -> Result<Regression, RegressionError> {
        let joint = map.joint(recordings)?;
        let fitted = gmm::fit(&joint, k, options, seed).map_err(|error| map.named(error))?;
        Regression::new(&fitted.mixture, map.n_inputs(recordings[0].dim()))
    }

    /// E[output | input] (dᵒ), Eq. (2).
    pub fn output(&self, input: &DVector<f64>) -> DVector<f64> {
        self.systems.output(input, input)
    }

    /// Cov[output | input] (dᵒ×dᵒ): within the components, and between what they expect,
    ///
    /// Σᵢ hᵢ (Covᵢ + yᵢ yᵢᵀ) − ȳ ȳᵀ,  yᵢ = Aᵢ ξ + bᵢ,  ȳ = Σᵢ hᵢ yᵢ.
    pub fn covariance(&self, input: &DVector<f64>) -> DMatrix<f64> {
        let h = self.systems.activations(input);
        let mean = self.output(input);
        let components = self.covariances.iter().zip(self.systems.A.iter().zip(&self.systems.b));
        let zero = DMatrix::zeros(mean.len(), mean.len());
        h.iter().zip(components).fold(zero, |sum, (h, (covariance, (A, b)))| {
            let off = A * input + b - &mean;
            sum + (covariance + &off * off.transpose()) * *h
        })
    }
}

impl Map {
    /// Inputs and outputs of every point of the recordings, one a column: the data of a joint mixture.
    pub fn joint(self, recordings: &[Recording]) -> Result<DMatrix<f64>, RecordingError> {
        let d = check_set(recordings)?;
        let n: usize = recordings.iter().map(Recording::n_points).sum();
        let n_inputs = self.n_inputs(d);
        let mut joint = DMatrix::zeros(n_inputs + d, n);
        let mut columns = joint.column_iter_mut();
        for recording in recordings {
            let outputs = match self {
                Map::TimeToPosition => &recording.points,
                Map::TimeToVelocity | Map::PositionToVelocity => &recording.velocities(),
            };
            for (t, mut column) in columns.by_ref().take(recording.n_points()).enumerate() {
                match self {
                    Map::PositionToVelocity => {
                        column.rows_mut(0, d).copy_from(&recording.points.column(t));
                    }
                    _ => column[0] = recording.time_s(t),
                }
                column.rows_mut(n_inputs, d).copy_from(&outputs.column(t));
            }
        }
        Ok(joint)
    }

    /// Inputs for movements of `d` coordinates.
    pub fn n_inputs(self, d: usize) -> usize {
        match self {
            Map::PositionToVelocity => d,
            _ => 1,
        }
    }

    /// The movement (d×T) that `regression` makes from `start` (d), a point each `period_s` (s) over
    /// `duration_s` (s). Positions over time do not depend on the start.
    pub fn reproduce(
        self,
        regression: &Regression,
        start: &DVector<f64>,
        duration_s: f64,
        period_s: f64,
    ) -> DMatrix<f64> {
        let at = |t: f64| regression.output(&DVector::from_element(1, t));
        match self {
            Map::TimeToPosition => {
                let n = (duration_s / period_s).round() as usize + 1;
                let points: Vec<_> = (0..n).map(|k| at(k as f64 * period_s)).collect();
                DMatrix::from_columns(&points)
            }
            Map::TimeToVelocity => first_order(start, duration_s, period_s, |t, _| at(t)),
            Map::PositionToVelocity => {
                first_order(start, duration_s, period_s, |_, x| regression.output(x))
            }
        }
    }

    /// The error with the coordinates of the recordings instead of those of the joint data.
    fn named(self, error: GmmError) -> GmmError {
        match error {
            GmmError::Still { coordinate, value } if self != Map::PositionToVelocity => {
                // The first coordinate of the data is time, which moves.
                GmmError::Still { coordinate: coordinate - 1, value }
            }
            other => other,
        }
    }
}

#[cfg(test)]
mod tests;
