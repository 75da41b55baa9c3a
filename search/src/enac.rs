//! Episodic natural actor critic (Peters, Vijayakumar, Schaal, ECML 2005; Peters and Schaal,
//! Neurocomputing 2008), exploring in the parameters.
//!
//! The natural gradient w is the regression of the returns on the score, Rₘ = J + ψₘᵀw. In white
//! coordinates z = (θ − μ)/s the score is (z, (z² − 1)/√2), whose Fisher information is I.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::batch::{BatchConfig, FactorGaussian, Update};
use super::gradient::{StepConfig, advantages, white};
use crate::range::{Range, range};
use crate::trial::Trial;

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct EnacConfig {
    /// Ridge λ of the regression; with fewer trials than 2D + 1 unknowns it makes the solution unique.
    pub ridge: f64,
    /// Sizes of the steps.
    pub step: StepConfig,
    /// Batches of trials, and the exploration floor.
    pub batch: BatchConfig,
}

impl Default for EnacConfig {
    fn default() -> Self {
        EnacConfig { ridge: 1.0, step: StepConfig::default(), batch: BatchConfig::default() }
    }
}

impl EnacConfig {
    /// Settings and their ranges.
    pub fn ranges(&self) -> Vec<Range> {
        let ridge = range("ridge", self.ridge, 1e-6, 1e6, "1");
        [vec![ridge], self.step.ranges(), self.batch.ranges()].concat()
    }
}

impl Update for EnacConfig {
    fn batch(&self) -> &BatchConfig {
        &self.batch
    }

    /// w = Ψᵀ(ΨΨᵀ + λI)⁻¹R over centred Ψ (n×2D) and R: the ridge regression in the form whose
    /// matrix is n×n, whatever D is.
    fn update(&self, gaussian: &FactorGaussian, trials: &[Trial], floor: f64) -> FactorGaussian {
        let (n, dim) = (trials.len(), gaussian.mean.len());
        let z = white(gaussian, trials);
        let mut psi = DMatrix::from_fn(n, 2 * dim, |m, i| match i.checked_sub(dim) {
            None => z[m][i],
            Some(i) => (z[m][i].powi(2) - 1.0) / f64::sqrt(2.0),
        });
        // Centring takes J out of the regression.
        psi.column_iter_mut().for_each(|mut column| column.add_scalar_mut(-column.mean()));
        let returns = DVector::from_vec(advantages(trials));
        let gram = &psi * psi.transpose() + DMatrix::identity(n, n) * self.ridge;
        let Some(cholesky) = gram.cholesky() else { return gaussian.clone() };
        let w = psi.transpose() * cholesky.solve(&returns);
        let log_std = w.rows(dim, dim) / f64::sqrt(2.0);
        self.step.take(gaussian, &w.rows(0, dim).into_owned(), &log_std, floor)
    }
}
