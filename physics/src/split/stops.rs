//! Joint stops: rigid, inelastic, and they only push back.

use super::MassFactor;
use crate::arm::{Jacobian, JointLimits, JointMatrix, JointVector, MAX_JOINTS};

/// Most sweeps over the joints; a stop that pushes another joint onto its own needs a few.
const SWEEPS: usize = 100;
/// A sweep that changes every speed by less than this is the last, rad/s.
const SETTLED: f64 = 1e-13;

/// Speeds at the end of a period that carry no joint beyond its stops, rad/s.
pub(super) struct Stops {
    lower: JointVector,
    upper: JointVector,
}

/// An arm that came to rest on stops.
pub(super) struct Stopped {
    /// Speeds at the end of the period, rad/s.
    pub qd: JointVector,
    joints: [bool; MAX_JOINTS],
}

impl Stops {
    /// At `q` (rad), for a period of `dt` s. A joint that is beyond a stop need not come back.
    pub fn of(q: &JointVector, limits: &JointLimits, dt: f64) -> Stops {
        Stops {
            lower: (limits.q_min - q).map(|room| (room / dt).min(0.0)),
            upper: (limits.q_max - q).map(|room| (room / dt).max(0.0)),
        }
    }

    /// The speeds once the stops have pushed, if any had to:
    /// q̇' = q̇ + M⁻¹λ within the bounds, λ_i pushing inwards and only where q̇'_i is on its bound.
    ///
    /// Gauss-Seidel over the joints; it converges because M is positive definite.
    pub fn stop(&self, qd: &JointVector, M: &MassFactor) -> Option<Stopped> {
        let is_free = |i: usize| (self.lower[i]..=self.upper[i]).contains(&qd[i]);
        if (0..MAX_JOINTS).all(is_free) {
            return None;
        }
        let response = M.inverse();
        let (mut qd, mut lambda) = (*qd, JointVector::zeros());
        for _ in 0..SWEEPS {
            let before = qd;
            for i in 0..MAX_JOINTS {
                let alone = qd[i] - response[(i, i)] * lambda[i];
                let push = (alone.clamp(self.lower[i], self.upper[i]) - alone) / response[(i, i)];
                qd += response.column(i) * (push - lambda[i]);
                lambda[i] = push;
            }
            if (qd - before).amax() < SETTLED {
                break;
            }
        }
        Some(Stopped { qd, joints: std::array::from_fn(|i| lambda[i] != 0.0) })
    }
}

impl Stopped {
    /// Jacobian and mass matrix of the arm whose stopped joints do not give way.
    pub fn held(&self, J: &Jacobian, M: &JointMatrix) -> (Jacobian, JointMatrix) {
        let (mut J, mut M) = (*J, *M);
        for i in (0..MAX_JOINTS).filter(|i| self.joints[*i]) {
            J.column_mut(i).fill(0.0);
            M.row_mut(i).fill(0.0);
            M.column_mut(i).fill(0.0);
            M[(i, i)] = 1.0;
        }
        (J, M)
    }
}
