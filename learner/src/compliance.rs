//! Reward for compliance: as stiff as needed, as compliant as possible.
//!
//! Variable impedance learning charges gains beside the task (Buchli, Stulp, Theodorou and Schaal,
//! "Learning variable impedance control", IJRR 2011, Sec. 4: a cost on the gains). Here it pays, once a
//! rollout succeeds, for what its policy has below `stiff`, by the logarithm: half the stiffness pays the
//! same anywhere. It follows from the policy alone, so a search knows it before the rollout.

use nalgebra::{Cholesky, DMatrix, DVector};
use search::Known;
use search::range::{Range, range};
use serde::{Deserialize, Serialize};
use shm_types::policy::PolicyMsg;

use crate::activation::mean_activations;
use crate::parameters::ParameterMap;

/// Name of the measure, of policies with stiffness.
pub const MEASURE: &str = "compliance";

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ComplianceConfig {
    /// Reward of a success per unit of compliance, which is a factor e less stiffness; 0: compliance is
    /// neither measured nor rewarded.
    pub weight: f64,
    /// Stiffness below which the reward starts: the mean over the movement of the geometric mean over all directions.
    pub stiff: f64,
    /// Stiffness below which the reward grows no further, at most `stiff`.
    pub soft: f64,
}

impl Default for ComplianceConfig {
    fn default() -> Self {
        ComplianceConfig { weight: 1.5, stiff: 900.0, soft: 50.0 }
    }
}

impl ComplianceConfig {
    /// No reward, as in sessions stored before it existed.
    pub fn off() -> ComplianceConfig {
        ComplianceConfig { weight: 0.0, ..ComplianceConfig::default() }
    }

    pub fn pays(&self) -> bool {
        self.weight > 0.0
    }

    /// Name and unit of the measure, if it is rewarded.
    pub fn declared(&self) -> Option<(String, String)> {
        self.pays().then(|| (MEASURE.into(), "1".into()))
    }

    pub fn ranges(&self) -> Vec<Range> {
        vec![
            range("weight", self.weight, 0.0, 100.0, "1"),
            range("stiff", self.stiff, 1.0, 2e4, "s⁻²"),
            range("soft", self.soft, 1.0, 2e4, "s⁻²").up_to(self.stiff),
        ]
    }

    /// c = Σᵢ h̄ᵢ min(ln(stiff/K̄ᵢ), ln(stiff/soft)), not below 0, with K̄ᵢ = det(Kᵢ)^(1/d) and h̄ᵢ the
    /// mean of hᵢ over the movement. 0 of a policy of systems, which has no springs.
    pub fn measure(&self, policy: &PolicyMsg) -> f64 {
        let d = policy.task_dim as usize;
        let log_k = policy.components().iter().map(|component| {
            let k = DMatrix::from_fn(d, d, |row, col| component.stiffness_at(row, col));
            // A policy was checked to be positive definite.
            Cholesky::new(k).map_or(0.0, |factor| factor.ln_determinant() / d as f64)
        });
        let paid = log_k.map(|log_k| self.stiff.ln() - log_k.max(self.soft.ln()));
        let weights = mean_activations(policy);
        weights.iter().zip(paid).map(|(h, paid)| h * paid).sum::<f64>().max(0.0)
    }

    /// The same for a search, but for a constant: ln det Kᵢ is the trace of log Kᵢ, which is linear in θ.
    pub(crate) fn known(&self, policy: &PolicyMsg, map: &ParameterMap) -> Option<Known> {
        if !self.pays() {
            return None;
        }
        let n = policy.components().len();
        let rows: Vec<_> = (0..n).map(|i| map.mean_log_stiffness(i).transpose()).collect();
        Some(Known {
            weights: DVector::from_vec(mean_activations(policy)),
            offsets: DVector::zeros(n),
            gradients: DMatrix::from_rows(&rows),
            least: self.soft.ln(),
        })
    }
}

#[cfg(test)]
mod tests;
