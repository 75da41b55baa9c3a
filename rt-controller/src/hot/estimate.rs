//! Where the arm is while its sensors do not say: by its own dynamics, from where they last did.

use physics::arm::{ArmModel, JointVector};
use physics::plant::Measurement;

use crate::hot::limits;
use crate::hot::wrench::ArmState;

/// A joint that shows itself farther beyond its limit than this, rad, or so many times too fast, is
/// not where it says.
const POSITION_MAX: f64 = 1.0;
const SPEED_MAX: f64 = 10.0;

/// Positions, rad, and speeds, rad/s.
#[derive(Clone, Copy)]
pub(crate) struct Estimate {
    pub q: JointVector,
    pub qd: JointVector,
}

impl Estimate {
    /// What a measurement shows.
    pub fn shown(measured: &Measurement) -> Estimate {
        Estimate { q: measured.q, qd: measured.qd }
    }

    /// An arm can be there: finite, and not absurdly far beyond the limits.
    pub fn is_plausible(&self, model: &ArmModel) -> bool {
        let limits = model.limits();
        limits::is_finite(&self.q)
            && limits::is_finite(&self.qd)
            && (0..model.n_joints()).all(|i| {
                self.q[i] > limits.q_min[i] - POSITION_MAX
                    && self.q[i] < limits.q_max[i] + POSITION_MAX
                    && self.qd[i].abs() < SPEED_MAX * limits.qd_max[i]
            })
    }

    /// Goes on by one period under `tau`, N·m: q̈ = M⁻¹(τ − C q̇ − g), not beyond the joints' limits.
    pub fn reckon(&mut self, model: &ArmModel, tau: &JointVector, period_s: f64) {
        let state = ArmState::new(model, &self.q, &self.qd);
        if let Some(M) = state.mass_matrix.cholesky() {
            self.qd += M.solve(&(tau - state.bias)) * period_s;
        }
        let limits = model.limits();
        for i in 0..model.n_joints() {
            self.qd[i] = self.qd[i].clamp(-limits.qd_max[i], limits.qd_max[i]);
            let q = self.q[i] + self.qd[i] * period_s;
            self.q[i] = q.clamp(limits.q_min[i], limits.q_max[i]);
            if self.q[i] != q {
                self.qd[i] = 0.0;
            }
        }
    }
}
